"""One build at work: what it was given, and what accumulates while its stages run."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recon.config import Config
from recon.memory import give_back
from recon.progress import Progress, Stage
from recon.sequence.camera import Camera
from recon.sequence.images import load_image
from recon.sequence.sequence import ImageList, Sequence


@dataclass
class Run:
    """The sequence (its beams are put in order on the way), settings, and what was counted and warned of so far."""

    sequence: Sequence
    config: Config
    progress: Progress
    seconds: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.warnings.extend(self.sequence.warnings)

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """Shown to whoever watches, and timed."""
        start = time.perf_counter()
        with self.progress.stage(name, total, unit) as stage:
            yield stage
            give_back()
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 3)

    @property
    def sight(self) -> tuple[ImageList, Camera] | None:
        """Images and the camera that took them; None where the sequence lacks either."""
        images, camera = self.sequence.images, self.sequence.camera
        return None if images is None or camera is None else (images, camera)

    def load(self, index: int) -> NDArray[np.uint8] | None:
        """Image `index`, (H, W, 3) BGR; None, with a warning, when it is corrupt."""
        assert self.sequence.images is not None and self.sequence.camera is not None
        return load_image(self.sequence.images, index, self.sequence.camera, warnings=self.warnings)
