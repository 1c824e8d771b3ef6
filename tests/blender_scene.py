"""Run by Blender's Python (module bpy): imports the files named on the command line and prints what Blender has then.

One JSON object by file: {object name: {"low": [x, y, z], "high": ..., "parent": name, "corners": [[point, uv, RGB]]}};
the colour is that of the object's texture near the uv.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy


def read(path: str) -> dict[str, Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    suffix = Path(path).suffix
    if suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=path)
    elif suffix == ".obj":
        bpy.ops.wm.obj_import(filepath=path)
    elif suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=path)
    elif suffix == ".stl":
        bpy.ops.wm.stl_import(filepath=path)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    return {o.name: describe(o) for o in bpy.data.objects if o.type == "MESH"}


def describe(item: Any) -> dict[str, Any]:
    points = [item.matrix_world @ vertex.co for vertex in item.data.vertices]
    return {
        "low": [min(p[i] for p in points) for i in range(3)],
        "high": [max(p[i] for p in points) for i in range(3)],
        "parent": item.parent.name if item.parent else None,
        "corners": corners(item, points),
    }


def corners(item: Any, points: list[Any]) -> list[Any]:
    picture = texture_of(item)
    if picture is None or not item.data.uv_layers:
        return []
    width, height = picture.size
    pixels = picture.pixels[:]  # from the lower left, as uv
    found = []
    for loop, uv in zip(item.data.loops, item.data.uv_layers.active.data, strict=True):
        column = min(max(int(uv.uv[0] * width), 2), width - 3)
        row = min(max(int(uv.uv[1] * height), 2), height - 3)
        start = (row * width + column) * picture.channels
        colour = [round(255 * c) for c in pixels[start : start + 3]]
        found.append([list(points[loop.vertex_index]), list(uv.uv), colour])
    return found


def texture_of(item: Any) -> Any:
    for slot in item.material_slots:
        for node in slot.material.node_tree.nodes:
            if node.type == "TEX_IMAGE" and node.image:
                return node.image
    return None


if __name__ == "__main__":
    print("SCENES " + json.dumps({path: read(path) for path in sys.argv[1:]}))
