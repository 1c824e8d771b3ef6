"""What a user may ask of a drawing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from recon.errors import ConfigError

Units = Literal["m", "mm", "ft"]
LayerNames = Literal["aia", "iso"]
DxfProfile = Literal["cad", "plain"]

PAPERS: dict[str, tuple[float, float]] = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "tabloid": (279.4, 431.8),
    "ansi-c": (431.8, 558.8),
    "ansi-d": (558.8, 863.6),
    "ansi-e": (863.6, 1117.6),
}
"""Sheets by name: the short and the long side, mm."""


@dataclass(frozen=True)
class DrawingOptions:
    """scale: n of 1:n, None: what fits. paper: a name of PAPERS, None: the smallest that fits.

    units: of lengths in texts, and of coordinates in DXF (ft: feet and inches, coordinates in inches). layers: names
    after the US National CAD Standard (aia) or ISO 13567. sigmas: whether dimensions carry their standard deviation.
    north: degrees from the map's x axis to north, counter-clockwise, None where it is not known. Raises ConfigError.
    """

    scale: int | None = None
    paper: str | None = None
    units: Units = "m"
    layers: LayerNames = "aia"
    dxf_profile: DxfProfile = "cad"
    sigmas: bool = True
    north: float | None = None

    def __post_init__(self) -> None:
        if self.scale is not None and not 1 <= self.scale <= 100_000:
            raise ConfigError(f"scale is 1:{self.scale}, expected 1:1 to 1:100000")
        if self.north is not None and not math.isfinite(self.north):
            raise ConfigError(f"north is {self.north}, expected degrees")
        for name, value, known in (
            ("paper", self.paper, (None, *PAPERS)),
            ("units", self.units, get_args(Units)),
            ("layers", self.layers, get_args(LayerNames)),
            ("DXF profile", self.dxf_profile, get_args(DxfProfile)),
        ):
            if value not in known:
                raise ConfigError(f"{name} is {value!r}, expected one of {', '.join(k for k in known if k)}")


DEFAULT = DrawingOptions()
