"""Run for one simulator and one world: rays from over the floor, and a ball dropped there; prints what came of it.

Arguments: the simulator, the file, the point (x y z), the radius of the ball. Reads directions from standard input.
"""

from __future__ import annotations

import json
import sys
from typing import Any

STEPS, STEP = 600, 1 / 240  # s
FAR = 1000.0  # m


def main(simulator: str, path: str, point: list[float], radius: float, rays: list[list[float]]) -> None:
    """rays: unit vectors. Prints the number of shapes, the distances (m) and the height at which the ball rests."""
    found = {"MuJoCo": in_mujoco, "Bullet": in_bullet}[simulator](path, point, radius, rays)
    print("RECON " + json.dumps(found))


def in_mujoco(path: str, point: list[float], radius: float, rays: list[list[float]]) -> dict[str, Any]:
    """By MuJoCo."""
    import mujoco
    import numpy as np

    spec = mujoco.MjSpec.from_file(path)
    body = spec.worldbody.add_body(pos=point)
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0])
    world = spec.compile()
    world.opt.timestep = STEP
    state = mujoco.MjData(world)
    for _ in range(STEPS):
        mujoco.mj_step(world, state)
    rest = float(state.qpos[2])
    state.qpos[2] = -FAR
    mujoco.mj_forward(world, state)
    hit = np.zeros(1, np.int32)
    reach = [mujoco.mj_ray(world, state, np.array(point), np.array(ray), None, 1, -1, hit) for ray in rays]
    return {"shapes": world.ngeom - 1, "rest": rest, "reach": [r if r >= 0 else None for r in reach]}


def in_bullet(path: str, point: list[float], radius: float, rays: list[list[float]]) -> dict[str, Any]:
    """By Bullet; a ball only in URDF, whose base can be fixed: of SDF it lets static models fall."""
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    urdf = path.endswith(".urdf")
    body = pybullet.loadURDF(path, useFixedBase=True) if urdf else pybullet.loadSDF(path)[0]
    ends = [[p + FAR * r for p, r in zip(point, ray, strict=True)] for ray in rays]
    hits = pybullet.rayTestBatch([point] * len(rays), ends)
    reach = [FAR * hit[2] if hit[0] >= 0 else None for hit in hits]
    shapes = len(pybullet.getCollisionShapeData(body, -1))
    if not urdf:
        return {"shapes": shapes, "rest": None, "reach": reach}
    pybullet.setGravity(0, 0, -9.81)
    sphere = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius)
    ball = pybullet.createMultiBody(1.0, sphere, basePosition=point)
    for _ in range(STEPS):
        pybullet.stepSimulation()
    return {"shapes": shapes, "rest": pybullet.getBasePositionAndOrientation(ball)[0][2], "reach": reach}


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], [float(v) for v in sys.argv[3:6]], float(sys.argv[6]), json.load(sys.stdin))
