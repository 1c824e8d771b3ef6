"""Which topics of a log to read, where the user says."""

from __future__ import annotations

from dataclasses import dataclass

NONE = "none"
"""Named instead of a topic: none of that kind."""


@dataclass(frozen=True)
class Topics:
    """Names of topics; None: found by type. `image` and `odometry` may be `none`."""

    scan: str | None = None
    image: str | None = None
    camera_info: str | None = None
    odometry: str | None = None

    @property
    def named(self) -> bool:
        """Whether any is named."""
        return any(name is not None for name in (self.scan, self.image, self.camera_info, self.odometry))
