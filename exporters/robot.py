"""Worlds for robots: SDF (Gazebo) and URDF, with meshes beside them to see and to run into; metres, Z up."""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from recon.exporters.collision import CollisionShape, collision_shapes
from recon.exporters.obj import obj_output
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.stl import stl_of
from recon.model import Model


def write_sdf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """A world with the building as one static model and light from above; meshes in `<stem>.meshes`.

    What is seen are the faces; what collides are convex shapes, at most 5 cm thick, behind each: simulators take any
    mesh that is to be run into for its convex hull.
    """
    collisions = collision_shapes(model.faces)
    folder, meshes = _meshes(model, collisions, stem, options)
    shapes = f"""
        <visual name="visual">
          <geometry><mesh><uri>{escape(f"{folder}/visual.obj")}</uri></mesh></geometry>
        </visual>""" * bool(model.faces)
    for shape in collisions:
        size = f"<box><size>{_row(shape.size)}</size></box>"
        mesh = f"<mesh><uri>{escape(f'{folder}/{shape.name}.stl')}</uri></mesh>"
        shapes += f"""
        <collision name="{shape.name}">
          <pose>{_row([*shape.middle, *shape.angles])}</pose>
          <geometry>{size if shape.is_box else mesh}</geometry>
        </collision>"""
    text = f"""<?xml version="1.0"?>
<sdf version="1.9">
  <world name={quoteattr(stem)}>
    <gravity>0 0 -9.81</gravity>
    <scene>
      <ambient>0.8 0.8 0.8 1</ambient>
      <background>0.9 0.9 0.9 1</background>
      <shadows>false</shadows>
    </scene>
    <light type="directional" name="above">
      <cast_shadows>false</cast_shadows>
      <pose>0 0 10 0 0 0</pose>
      <diffuse>0.6 0.6 0.6 1</diffuse>
      <direction>-0.3 0.2 -0.9</direction>
    </light>
    <model name="building">
      <static>true</static>
      <link name="building">{shapes}
      </link>
    </model>
  </world>
</sdf>
"""
    return Output(text.encode(), meshes)


def write_urdf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """The building as one link without a joint; meshes as `write_sdf`."""
    collisions = collision_shapes(model.faces)
    folder, meshes = _meshes(model, collisions, stem, options)
    seen = f"{folder}/visual.obj"
    shapes = f"\n    <visual><geometry><mesh filename={quoteattr(seen)}/></geometry></visual>" * bool(model.faces)
    for shape in collisions:
        box = f'<box size="{_row(shape.size)}"/>'
        mesh = f"<mesh filename={quoteattr(f'{folder}/{shape.name}.stl')}/>"
        shapes += f"""
    <collision name="{shape.name}">
      <origin xyz="{_row(shape.middle)}" rpy="{_row(shape.angles)}"/>
      <geometry>{box if shape.is_box else mesh}</geometry>
    </collision>"""
    link = f'  <link name="building">{shapes}\n  </link>\n'
    return Output(f'<?xml version="1.0"?>\n<robot name={quoteattr(stem)}>\n{link}</robot>\n'.encode(), meshes)


def _meshes(
    model: Model, collisions: list[CollisionShape], stem: str, options: ExportOptions
) -> tuple[str, dict[str, bytes]]:
    """The name of the folder, and its files."""
    folder = f"{stem}.meshes"
    if not model.faces:
        return folder, {}
    visual = obj_output(model, "visual", options, z_up=True)
    files = {"visual.obj": visual.content} | visual.beside
    for shape in collisions:
        if not shape.is_box:
            files[f"{shape.name}.stl"] = stl_of(shape.corners)
    return folder, {f"{folder}/{name}": content for name, content in files.items()}


def _row(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in np.asarray(values, dtype=np.float64).round(9) + 0.0)
