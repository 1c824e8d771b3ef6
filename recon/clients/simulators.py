"""Simulators of robots: whether what they run into is where one sees it."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.clients.finding import Broken, Missing
from recon.geometry import Array

if TYPE_CHECKING:
    import trimesh

PATIENCE = 300.0
"""s for one simulator, at most."""
_SCRIPT = Path(__file__).with_name("simulator_script.py")
_MODULES = {"MuJoCo": "mujoco", "Bullet": "pybullet"}
ABOVE, RADIUS = 0.5, 0.1
"""m above the floor from where rays go and a ball falls, and its radius."""
RAYS, CANDIDATES = 360, 20
FAR = 1000.0
"""m: more than any building."""
NEAR = 0.01
"""m: a ray's end may be off by so much, and the ball's height ..."""
THICK = 0.05
"""m behind faces that may be solid: rays that come from behind end on that side, or at its end."""
ROUNDED = 0.002
"""m that simulators may round a shape by."""


def _simulated(simulator: str, path: Path) -> str:
    """Level rays, compared with the mesh that is seen, and a ball dropped on its largest piece of floor."""
    if importlib.util.find_spec(_MODULES[simulator]) is None:
        raise Missing(f"the Python library {_MODULES[simulator]} is not installed")
    seen = _visual(path)
    angles = np.arange(RAYS) / RAYS * 2 * np.pi
    rays = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(RAYS)])
    point = _over_the_floor(seen, rays)
    found = _run(simulator, path, point, rays)
    reach = np.array([np.inf if r is None else r for r in found["reach"]])
    expected = _reach(seen, point, rays)
    off = np.where(reach == expected, 0.0, np.abs(reach - np.minimum(expected, 2 * FAR)))
    wrong = off > NEAR
    early = wrong & (reach < expected)
    wrong[early] = ~_on_the_back(seen, point + rays[early] * reach[early, None])
    if wrong.any():
        raise Broken(f"{wrong.sum()} of {RAYS} level rays end elsewhere than on the mesh that is seen or behind it")
    floor = point[2] - ABOVE
    rest = found["rest"]
    if rest is not None and abs(rest - floor - RADIUS) > NEAR:
        raise Broken(f"a ball of {RADIUS} m rests at {rest:.3f} m, expected {floor + RADIUS:.3f} m")
    ball = "" if rest is None else ", a ball rests on the floor"
    return f"{found['shapes']} collision shapes, rays agree to {1000 * float(np.median(off)):.2g} mm{ball}"


mujoco = partial(_simulated, "MuJoCo")
bullet = partial(_simulated, "Bullet")


def _run(simulator: str, path: Path, point: Array, rays: Array) -> dict[str, Any]:
    command = [sys.executable, str(_SCRIPT), simulator, str(path), *map(str, point.tolist()), str(RADIUS)]
    try:
        done = subprocess.run(
            command, input=json.dumps(rays.tolist()), capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        raise Broken(f"{simulator} did not end within {PATIENCE:.0f} s") from None
    line = next((x for x in done.stdout.splitlines() if "RECON " in x), None)
    if line is None:
        raise Broken(f"{simulator} cannot use it: {(done.stderr or done.stdout).strip()[-200:]}")
    found: dict[str, Any] = json.loads(line.split("RECON ", 1)[1])
    return found


def _visual(path: Path) -> trimesh.Trimesh:
    """The mesh that is seen, of all that the file names the OBJ."""
    import trimesh

    file = path.with_name(f"{path.stem}.meshes") / "visual.obj"
    if not file.is_file():
        raise Missing("it names no mesh to be seen")
    return trimesh.load_scene(file).to_mesh()


def _over_the_floor(mesh: trimesh.Trimesh, rays: Array) -> Array:
    """A point (3,) ABOVE m over the largest triangle that looks up and has room around its middle."""
    up = np.flatnonzero(mesh.face_normals[:, 2] > 0.99)
    for k in up[np.argsort(-mesh.area_faces[up], kind="stable")][:CANDIDATES]:
        point = np.asarray(mesh.triangles_center[k] + [0.0, 0.0, ABOVE])
        if _reach(mesh, point, rays, both_sides=True).min() > 2 * RADIUS:
            return point
    raise Missing("it has no floor with room above it")


def _on_the_back(mesh: trimesh.Trimesh, places: Array) -> NDArray[np.bool_]:
    """Whether places (n, 3) are within THICK behind what is seen, and not in front of it.

    Faces are seen from one side: a ray that comes from the other passes them, and ends in the wall.
    """
    from trimesh.proximity import closest_point

    if not len(places):
        return np.zeros(0, bool)
    _, distance, triangle = closest_point(mesh, places)
    away = places - mesh.triangles_center[triangle]
    height = np.einsum("ni,ni->n", away, mesh.face_normals[triangle])
    before = height > np.maximum(ROUNDED, 0.99 * distance)  # else it is beside an edge
    return np.asarray((distance <= THICK + ROUNDED) & ~before)


def _reach(mesh: trimesh.Trimesh, point: Array, rays: Array, both_sides: bool = False) -> Array:
    """m (n,) to the first face that looks towards the point, or to any."""
    from trimesh.ray.ray_triangle import RayMeshIntersector

    places, ray, triangle = RayMeshIntersector(mesh).intersects_location(
        np.broadcast_to(point, rays.shape), rays, multiple_hits=True
    )
    toward = both_sides | (np.einsum("ni,ni->n", mesh.face_normals[triangle], rays[ray]) < 0)
    out = np.full(len(rays), np.inf)
    np.minimum.at(out, ray[toward], np.linalg.norm(places[toward] - point, axis=1))
    return out
