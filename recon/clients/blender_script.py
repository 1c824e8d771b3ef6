"""Run by Blender's Python: imports the file named on the command line and prints what Blender has then, as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bpy


def main(path: str) -> None:
    """Counts, and the bounding box, Z up, m."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    importers = {
        ".glb": bpy.ops.import_scene.gltf,
        ".gltf": bpy.ops.import_scene.gltf,
        ".obj": bpy.ops.wm.obj_import,
        ".ply": bpy.ops.wm.ply_import,
        ".stl": bpy.ops.wm.stl_import,
    }
    importers.get(Path(path).suffix.lower(), bpy.ops.wm.usd_import)(filepath=path)
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    points = [item.matrix_world @ vertex.co for item in meshes for vertex in item.data.vertices]
    used = {slot.material.name for item in meshes for slot in item.material_slots if slot.material}
    pictures = [image for image in bpy.data.images if image.size[0] > 0]
    found = {
        "meshes": len(meshes),
        "materials": len(used),
        "images": len(pictures),
        "low": [min(p[i] for p in points) for i in range(3)] if points else None,
        "high": [max(p[i] for p in points) for i in range(3)] if points else None,
    }
    print("RECON " + json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
