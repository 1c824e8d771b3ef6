"""Every client of a format, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from recon.clients import documents, libraries, maps, programs, simulators
from recon.clients.finding import Broken, Finding, Missing
from recon.exporters import suffix_of

Client = Callable[[Path], str]
"""Opens a file and says in a line what it found; raises Broken or Missing."""

_MESH: dict[str, Client] = {"trimesh": libraries.trimesh, "assimp": programs.assimp, "Blender": programs.blender}
_GLTF: dict[str, Client] = {"Khronos": programs.khronos, **_MESH, "Godot": programs.godot}
_USD: dict[str, Client] = {"OpenUSD": libraries.openusd, "NVIDIA": libraries.nvidia, "Blender": programs.blender}
_ROBOT: dict[str, Client] = {"its meshes": documents.robot_meshes, "Bullet": simulators.bullet}
CLIENTS: dict[str, dict[str, Client]] = {
    ".glb": _GLTF,
    ".gltf": _GLTF,
    ".obj": {"files": documents.obj_files, **_MESH},
    ".ply": _MESH,
    ".cloud.ply": _MESH,
    ".stl": {"length": documents.stl_length, **_MESH},
    ".usd": _USD,
    ".usda": _USD,
    ".usdc": _USD,
    ".usdz": _USD,
    ".sdf": _ROBOT,
    ".urdf": {**_ROBOT, "MuJoCo": simulators.mujoco},
    ".dxf": {"ezdxf": libraries.ezdxf},
    ".ifc": {"IfcOpenShell": libraries.ifcopenshell},
    ".svg": {"XML": documents.xml},
    ".pdf": {"PDFium": maps.pdf},
    ".png": {"Pillow": maps.png},
    ".yaml": {"map": maps.nav_map},
    ".geojson": {"Shapely": maps.geojson},
    ".rooms.json": {"graph": maps.room_graph},
    ".json": {"recon": documents.layout},
}
"""By suffix, the quick ones first."""


def check_file(path: Path) -> list[Finding]:
    """What each client of the format of `path` says: "not run" where there is none, "broken" where there is no file."""
    if not path.is_file():
        return [Finding("file", "broken", "is a folder, expected a file" if path.is_dir() else "no such file")]
    suffix = suffix_of(path)
    clients = CLIENTS.get(suffix)
    if clients is None:
        return [Finding("any", "not run", f"nothing here opens {suffix or 'such files'}")]
    return [_ask(name, client, path.resolve()) for name, client in clients.items()]


def _ask(name: str, client: Client, path: Path) -> Finding:
    try:
        return Finding(name, "ok", client(path))
    except Missing as reason:
        return Finding(name, "not run", str(reason))
    except Broken as reason:
        return Finding(name, "broken", " ".join(str(reason).split()))
