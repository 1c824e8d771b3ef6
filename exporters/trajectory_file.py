"""The drive: where the platform was, as TUM trajectory and as CSV."""

from __future__ import annotations

import numpy as np

from recon.exporters.output import Output
from recon.model import Model
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import planar_lines

SIGMA_DECIMALS = 6, 6, 7
"""Of x, y and yaw, as the result folder keeps them."""


def write_tum_file(model: Model, stem: str) -> Output:
    """`timestamp x y z qx qy qz qw`, one pose a line: the platform in the map frame, z = 0 on the floor."""
    drive = Trajectory(np.zeros(0), np.zeros((0, 3))) if model.trajectory is None else model.trajectory
    lines = planar_lines(drive, "platform frame in the map frame")
    return Output(("\n".join(lines) + "\n").encode())


def write_csv(model: Model, stem: str) -> Output:
    """Header, then one pose a row: s, m, m, rad, and one standard deviation of each, empty where not known."""
    rows = ["timestamp,x,y,yaw,sigma_x,sigma_y,sigma_yaw"]
    if model.trajectory is not None:
        sigmas = model.pose_sigmas if len(model.pose_sigmas) else np.full((len(model.trajectory), 3), np.nan)
        for stamp, pose, sigma in zip(model.trajectory.timestamps, model.trajectory.poses, sigmas, strict=True):
            x, y, yaw = (round(float(v), 9) + 0.0 for v in pose)
            known = [f"{v:.{n}f}" if np.isfinite(v) else "" for v, n in zip(sigma, SIGMA_DECIMALS, strict=True)]
            rows.append(f"{stamp:.6f},{x:.6f},{y:.6f},{yaw:.9f},{','.join(known)}")
    return Output(("\r\n".join(rows) + "\r\n").encode())
