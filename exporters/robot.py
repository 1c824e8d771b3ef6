"""Worlds for robots: SDF (Gazebo) and URDF, with meshes beside them to see and to run into; metres, Z up."""

from __future__ import annotations

from xml.sax.saxutils import escape, quoteattr

import numpy as np

from recon.exporters.collision import convex_bodies
from recon.exporters.obj import obj_output
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.stl import stl_of
from recon.model import Model


def write_sdf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """A world with the building as one static model and light from above; meshes in `<stem>.meshes`.

    What is seen are the faces; what collides are bodies 5 cm thick behind each, which thin robots cannot slip through.
    """
    folder, meshes = _meshes(model, stem, options)
    shapes = "".join(
        f"""
        <{tag} name="{tag}">
          <geometry><mesh><uri>{escape(f"{folder}/{file}")}</uri></mesh></geometry>
        </{tag}>"""
        for tag, file in (("visual", "visual.obj"), ("collision", "collision.stl"))
        if model.faces
    )
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
    folder, meshes = _meshes(model, stem, options)
    shapes = "".join(
        f"\n    <{tag}><geometry><mesh filename={quoteattr(f'{folder}/{file}')}/></geometry></{tag}>"
        for tag, file in (("visual", "visual.obj"), ("collision", "collision.stl"))
        if model.faces
    )
    link = f'  <link name="building">{shapes}\n  </link>\n'
    return Output(f'<?xml version="1.0"?>\n<robot name={quoteattr(stem)}>\n{link}</robot>\n'.encode(), meshes)


def _meshes(model: Model, stem: str, options: ExportOptions) -> tuple[str, dict[str, bytes]]:
    """The name of the folder, and its files."""
    folder = f"{stem}.meshes"
    if not model.faces:
        return folder, {}
    visual = obj_output(model, "visual", options, z_up=True)
    bodies = [vertices[triangles] for face in model.faces for vertices, triangles in convex_bodies(face)]
    files = {"visual.obj": visual.content, "collision.stl": stl_of(np.concatenate(bodies))} | visual.beside
    return folder, {f"{folder}/{name}": content for name, content in files.items()}
