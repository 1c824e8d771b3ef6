"""The knobs a user may turn, one small frozen class a stage, defaults here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from recon.model import DEFAULT_CEILING_HEIGHT


@dataclass(frozen=True)
class LidarConfig:
    """Split-and-merge. range_sigma: the scanner's noise, m (0: from the scans). min_points: fewest of a segment."""

    range_sigma: float = 0.0
    min_points: int = 8
    min_length: float = 0.25


@dataclass(frozen=True)
class VisionConfig:
    """Image lines. detector: "canny" (edge linking) or "lsd"."""

    detector: Literal["canny", "lsd"] = "canny"
    min_length: float = 20.0


@dataclass(frozen=True)
class CalibrationConfig:
    """Recursive RANSAC. iterations: random minimal sets a seeding image."""

    iterations: int = 400


@dataclass(frozen=True)
class GraphConfig:
    """Poses and walls. backend: "graph", all at once, or "ekf", the paper's filter, to compare with.

    manhattan: use right angles between walls where the data support them (graph only).
    """

    backend: Literal["graph", "ekf"] = "graph"
    manhattan: bool = True


@dataclass(frozen=True)
class LayoutConfig:
    """Plan. default_ceiling_height: m, used where no image shows the ceiling."""

    default_ceiling_height: float = DEFAULT_CEILING_HEIGHT


@dataclass(frozen=True)
class TextureConfig:
    """Pictures of faces. metres_per_texel: finest resolution.

    max_texture_size: a picture has no more pixels than a square of this side, coarser if it must. Sides may be longer:
    files have a large picture in tiles (`recon.tiles`).
    """

    metres_per_texel: float = 0.005
    max_texture_size: int = 8192


@dataclass(frozen=True)
class Config:
    """Everything, resolved. seed: of all that is random. workers: processes or threads; never changes the result."""

    seed: int = 0
    workers: int = 2
    lidar: LidarConfig = field(default_factory=LidarConfig)
    vision: VisionConfig = field(default_factory=VisionConfig)
    calibration: CalibrationConfig = field(default_factory=CalibrationConfig)
    graph: GraphConfig = field(default_factory=GraphConfig)
    layout: LayoutConfig = field(default_factory=LayoutConfig)
    texture: TextureConfig = field(default_factory=TextureConfig)
