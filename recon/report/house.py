"""The model in the report: a picture from above, and a view in 3D to turn."""

from __future__ import annotations

import base64
import importlib.util
import json
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from recon.dollhouse import render_dollhouse
from recon.geometry import Array
from recon.model import Model
from recon.report.html import folded, jpeg

SIZE = 1200, 750
"""Pixels of the picture."""
TEXELS = 6_000_000
"""In all pictures of the 3D view together: some 2 MB, which a phone can hold."""
LARGEST, SMALLEST = 512, 32
"""Texels a side of one picture."""
FIELD_OF_VIEW = np.radians(45.0)
"""Of the 3D view, up and down."""
VIEW = np.array([0.45, 1.2, 0.85])
"""From the middle of the building to the eye: right, up and towards the viewer (Y up)."""
MARGIN = 1.06
"""Of the distance at which all just fits."""
GLOW = 0.55
"""Share of a face's colour that needs no light: the viewer has one lamp, and walls along its light would be black."""
LAMP = 0.5
TEMPLATE = Path("resources", "templates", "viewer.zip"), "viewer.html.template"
"""In the package trimesh: a page with three.js in it."""
RENDERER = "new THREE.WebGLRenderer({antialias:true});"
CHANGES = {
    RENDERER: f"{RENDERER}renderer.outputEncoding=THREE.sRGBEncoding;",
    "0xffffff,1.75": f"0xffffff,{LAMP}",
}
"""Of that page: colours as screens want them, a weaker lamp."""


def house(model: Model) -> str:
    """A picture of the building with its ceilings off, and the same in 3D, behind a click."""
    if not model.faces:
        return ""
    picture = f'<img class="house" alt="The model from above" src="{jpeg(render_dollhouse(model, SIZE))}">'
    viewer = f'<iframe title="The model in 3D" loading="lazy" srcdoc="{_viewer(model)}"></iframe>'
    return picture + folded("Turn it in 3D (drag to turn, wheel or two fingers to come nearer)", viewer)


def _viewer(model: Model) -> str:
    """A page of its own (three.js, as trimesh ships it, and the model), with quotes escaped for `srcdoc`."""
    package = importlib.util.find_spec("trimesh")  # found, not imported, which takes half a second
    assert package is not None and package.origin is not None
    archive, name = TEMPLATE
    with zipfile.ZipFile(Path(package.origin).parent / archive) as files:
        page = files.read(name).decode("utf-8")
    for old, new in {**CHANGES, "$B64GLTF": base64.b64encode(_scene(model)).decode("ascii")}.items():
        page = page.replace(old, new)
    return page.replace('"', "&quot;")


def _scene(model: Model) -> bytes:
    """GLB of the faces without ceilings, pictures made small, seen from above at an angle."""
    from recon.exporters.detail import with_detail
    from recon.exporters.gltf import write_glb
    from recon.exporters.options import ExportOptions

    open_top = replace(model, faces=tuple(face for face in model.faces if face.kind != "ceiling"))
    options = ExportOptions(texture_size=_texture_size(len(open_top.faces)), texture_format="jpg")
    content = write_glb(with_detail(open_top, options)[0], "house", options).content
    (length,) = struct.unpack_from("<I", content, 12)
    document, rest = json.loads(content[20 : 20 + length]), content[20 + length :]
    _lighten(document.get("materials", []))
    points = np.concatenate([face.vertices for face in model.faces])[:, [0, 2, 1]] * [1, 1, -1]
    _look(document, points)
    for node in document["nodes"]:  # what is said of each face, nobody asks the view
        node.pop("extras", None)
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest


def _lighten(materials: list[dict[str, Any]]) -> None:
    """Faces glow a little in their own colours."""
    for material in materials:
        surface = material["pbrMetallicRoughness"]
        if "baseColorTexture" in surface:
            material |= {"emissiveTexture": surface["baseColorTexture"], "emissiveFactor": [GLOW] * 3}
        else:
            material["emissiveFactor"] = [round(GLOW * channel, 6) for channel in surface["baseColorFactor"][:3]]


def _texture_size(faces: int) -> int:
    """The largest power of two that keeps `faces` square pictures within TEXELS."""
    side = np.sqrt(TEXELS / max(faces, 1))
    return int(np.clip(2 ** np.floor(np.log2(max(side, 1.0))), SMALLEST, LARGEST))


def _look(document: dict[str, Any], points: Array) -> None:
    """Adds a camera (it looks along its -z, y up) that has all points (N, 3) in view."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2  # where the viewer turns the camera to
    back = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    x, y, z = ((points - middle) @ np.stack([right, np.cross(back, right), back]).T).T
    aspect, slope = SIZE[0] / SIZE[1], np.tan(FIELD_OF_VIEW / 2)
    distance = MARGIN * max(float(np.max(z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope)), 0.5)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(back, right), back, middle + distance * back
    lens = {"aspectRatio": aspect, "yfov": FIELD_OF_VIEW, "znear": distance / 200, "zfar": 20 * distance}
    document["cameras"] = [{"type": "perspective", "perspective": lens}]
    document["scenes"][0]["nodes"].append(len(document["nodes"]))
    document["nodes"].append({"name": "eye", "camera": 0, "matrix": pose.T.ravel().round(6).tolist()})
