"""The model in the report: a picture from above, and a view in 3D to turn."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from recon.dollhouse import render_dollhouse
from recon.geometry import Array
from recon.model import Model
from recon.report.html import folded, jpeg

if TYPE_CHECKING:
    import trimesh

SIZE = 1200, 750
"""Pixels of the picture."""
TEXELS = 6_000_000
"""In all pictures of the 3D view together: some 2 MB, which a phone can hold."""
LARGEST, SMALLEST = 512, 32
"""Texels a side of one picture."""
FIELD_OF_VIEW = 45.0
"""Degrees, of the 3D view, up and down."""
VIEW = np.array([0.45, 1.0, 0.85])
"""From the middle of the building to the eye: right, up and towards the viewer (Y up)."""
NEARER = 0.9
"""Of the distance at which a ball around the building just fits; buildings are flat."""
GLOW = 0.6
"""Share of a face's colour that needs no light."""
PLAIN = 0.6
"""Of the brightness of faces without a picture: under the viewer's lamp they would be white before white."""


def house(model: Model) -> str:
    """A picture of the building with its ceilings off, and the same in 3D, behind a click."""
    if not model.faces:
        return ""
    picture = f'<img class="house" alt="The model from above" src="{jpeg(render_dollhouse(model, SIZE))}">'
    viewer = f'<iframe title="The model in 3D" loading="lazy" srcdoc="{_viewer(model)}"></iframe>'
    return picture + folded("Turn it in 3D (drag to turn, wheel or two fingers to come nearer)", viewer)


def _viewer(model: Model) -> str:
    """A page of its own (three.js and the model, by trimesh), with quotes escaped for `srcdoc`."""
    from trimesh.viewer import scene_to_html

    return str(scene_to_html(_scene(model), escape_quotes=True))


def _scene(model: Model) -> trimesh.Scene:
    """The faces without ceilings, pictures made small, seen from above at an angle."""
    import trimesh

    from recon.exporters.gltf import write_glb
    from recon.exporters.options import ExportOptions

    open_top = replace(model, faces=tuple(face for face in model.faces if face.kind != "ceiling"))
    content = write_glb(open_top, "house", ExportOptions(texture_size=_texture_size(len(open_top.faces)))).content
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    _lighten(scene)
    scene.camera = trimesh.scene.Camera("eye", (1600, 1000), fov=(1.6 * FIELD_OF_VIEW, FIELD_OF_VIEW))
    scene.camera_transform = _eye(np.asarray(scene.bounds))
    return scene


def _lighten(scene: trimesh.Scene) -> None:
    """Faces glow a little in their own colours: the viewer has one lamp, and walls along its light would be black."""
    for mesh in scene.geometry.values():
        material = mesh.visual.material
        if material.baseColorTexture is not None:
            material.emissiveTexture, material.emissiveFactor = material.baseColorTexture, [GLOW] * 3
        elif material.baseColorFactor is not None:
            material.baseColorFactor = [*(PLAIN * np.asarray(material.baseColorFactor[:3])).astype(np.uint8), 255]


def _texture_size(faces: int) -> int:
    """The largest power of two that keeps `faces` square pictures within TEXELS."""
    side = np.sqrt(TEXELS / max(faces, 1))
    return int(np.clip(2 ** np.floor(np.log2(max(side, 1.0))), SMALLEST, LARGEST))


def _eye(bounds: Array) -> Array:
    """(4, 4) pose of the camera (looking along its -z, y up) that has all of `bounds` (2, 3) in view."""
    middle, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2
    back = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
    pose[:3, 3] = middle + back * max(radius, 0.5) / np.tan(np.radians(FIELD_OF_VIEW / 2)) * NEARER
    return pose
