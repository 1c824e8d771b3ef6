"""The LiDAR's points as PLY, coloured from the images; metres, Z up."""

from __future__ import annotations

import numpy as np

from recon.cloud import PointCloud, ply_of
from recon.exporters.output import Output
from recon.model import Model


def write_cloud(model: Model, stem: str) -> Output:
    """One vertex a point. A model that holds no points gives an empty file, and a line that says so."""
    if model.cloud is not None:
        return Output(ply_of(model.cloud))
    empty = PointCloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    note = "is empty: this result holds no points, build it again to have them"
    return Output(ply_of(empty), notes=(note,))
