"""One drive: scans, and where given images, intrinsics, odometry and extrinsics."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera
from recon.sequence.trajectory import Trajectory


@dataclass(frozen=True)
class Scans:
    """2D LiDAR scans (FORMAT.md, scans.npz).

    timestamps (N,) s, increasing; ranges (N, B) float32 m, inf = no return, nan = invalid; bearing of beam b is
    angle_min + b * angle_increment, rad, counter-clockwise from x; time_increment s between beams (0 = instantaneous).
    """

    timestamps: Array
    ranges: NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    time_increment: float = 0.0
    intensities: NDArray[np.float32] | None = None

    def __len__(self) -> int:
        return len(self.timestamps)

    @property
    def bearings(self) -> Array:
        """(B,) rad."""
        return np.asarray(self.angle_min + self.angle_increment * np.arange(self.ranges.shape[1]), dtype=np.float64)

    def valid(self, index: int) -> NDArray[np.bool_]:
        """(B,) beams of scan `index` that returned a range within the scanner's limits."""
        r = self.ranges[index]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.isfinite(r) & (r >= self.range_min) & (r <= self.range_max))

    def points(self, index: int) -> Array:
        """(n, 2) m: the valid returns of scan `index` in the platform frame, in order of bearing."""
        ok = self.valid(index)
        r, a = self.ranges[index][ok].astype(np.float64), self.bearings[ok]
        return np.stack([r * np.cos(a), r * np.sin(a)], axis=1)


class ImageSource(Protocol):
    """Images that are no files of their own, as in a log; may be asked from several threads."""

    def read(self, index: int) -> bytes | NDArray[np.uint8]:
        """What a JPEG or PNG file of image `index` holds, or its pixels: BGR (H, W, 3) or grey (H, W)."""
        ...

    def size(self, index: int) -> int:
        """Bytes that image `index` takes in the log."""
        ...


@dataclass(frozen=True)
class ImageList:
    """Images of one camera, read when asked for.

    timestamps (N,) s, increasing; paths: absolute, one an image, none where they come from a `source`; names: as in
    images.txt, of a source those that its images would have there.
    """

    timestamps: Array
    paths: tuple[Path, ...]
    names: tuple[str, ...]
    source: ImageSource | None = None

    def __len__(self) -> int:
        return len(self.names)

    def read(self, index: int) -> bytes | NDArray[np.uint8]:
        """What the file of image `index` holds, or its pixels: BGR (H, W, 3) or grey (H, W). Raises OSError."""
        return self.paths[index].read_bytes() if self.source is None else self.source.read(index)

    def size(self, index: int) -> int:
        """Bytes that image `index` takes."""
        return self.paths[index].stat().st_size if self.source is None else self.source.size(index)

    def place(self, index: int) -> Path:
        """Where image `index` is, for messages."""
        return self.paths[index] if self.source is None else Path(self.names[index])


@dataclass(frozen=True)
class Sequence:
    """One drive. `images` and `camera` are both given or both None. `warnings`: what the reader assumed or skipped."""

    name: str
    scans: Scans
    camera: Camera | None = None
    images: ImageList | None = None
    odometry: Trajectory | None = None
    platform_from_camera: Pose3 | None = None
    warnings: tuple[str, ...] = field(default=())
