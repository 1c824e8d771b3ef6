"""Which topics of a log to read, where the user says."""

from __future__ import annotations

from dataclasses import dataclass

NONE = "none"
"""Named instead of a topic: none of that kind."""


@dataclass(frozen=True)
class Topics:
    """Names of topics, with or without the first slash; None: found by type. `image` and `odometry` may be `none`."""

    scan: str | None = None
    image: str | None = None
    camera_info: str | None = None
    odometry: str | None = None

    def __post_init__(self) -> None:
        for field in ("scan", "image", "camera_info", "odometry"):
            name = getattr(self, field)
            if name is not None and name != NONE and not name.startswith("/"):
                object.__setattr__(self, field, f"/{name}")

    @property
    def named(self) -> bool:
        """Whether any is named."""
        return any(name is not None for name in (self.scan, self.image, self.camera_info, self.odometry))
