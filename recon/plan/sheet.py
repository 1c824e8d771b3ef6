"""Scale and paper: what fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.errors import ConfigError
from recon.geometry import Array
from recon.plan.options import PAPERS, DrawingOptions

FRAME = 10.0
"""mm; margin of the sheet."""
STRIP, TWO_STRIPS = 34.0, 58.0
"""mm; height of the title block, on one row, or on two where the sheet is narrower than WIDE."""
WIDE = 270.0
METRIC = ("A4", "A3", "A2", "A1", "A0")
IMPERIAL = ("letter", "tabloid", "ansi-c", "ansi-d", "ansi-e")
SCALES = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
FOOT_SCALES = (48, 96, 192, 384, 768, 1200, 2400, 4800, 12_000, 24_000, 60_000, 96_000)
_LARGEST = (1, 2, 4)  # steps of paper up to which the first scales are taken: 1:50 up to A3, 1:100 up to A2


@dataclass(frozen=True)
class Sheet:
    """scale: n of 1:n. size: (width, height), mm. space: low and high corner of what is free for the plan, mm."""

    scale: int
    paper: str
    size: tuple[float, float]

    @property
    def strip(self) -> float:
        """Height of the title block, mm."""
        return STRIP if self.size[0] >= WIDE else TWO_STRIPS

    @property
    def space(self) -> Array:
        """Low and high corner (2, 2) of what is free for the plan, mm."""
        return np.array([[FRAME, FRAME + self.strip], [self.size[0] - FRAME, self.size[1] - FRAME]])


def choose_sheet(extent: Array, margins: Array, options: DrawingOptions) -> Sheet:
    """The sheet for a plan of `extent` (2,), m, with `margins` (2,), mm, in all around it.

    What the options leave open is chosen: as large a scale as makes sense on as small a paper as it fits. Raises
    ConfigError where it cannot fit.
    """
    papers = IMPERIAL if options.units == "ft" else METRIC
    scales = FOOT_SCALES if options.units == "ft" else SCALES
    if options.scale is not None or options.paper is not None:
        tried = [
            (scale, paper)
            for scale in ([options.scale] if options.scale is not None else scales)
            for paper in ([options.paper] if options.paper is not None else papers)
        ]
    else:
        tried = [(scale, paper) for n, scale in enumerate(scales) for paper in papers[: _most(n)]]
    for scale, paper in tried:
        sheet = _fitting(extent, margins, scale, paper)
        if sheet is not None:
            return sheet
    need = extent * 1000 / (options.scale or scales[-1]) + margins
    where = options.paper or f"any paper up to {papers[-1]}"
    at = f"1:{options.scale or scales[-1]}"
    raise ConfigError(
        f"the plan takes {need[0]:.0f} x {need[1]:.0f} mm at {at} and does not fit on {where}, "
        "expected a smaller scale (a larger number) or a larger paper"
    )


def scale_text(scale: int) -> str:
    """`1:50`, and what architects call the imperial scales."""
    named = {48: '1/4"', 96: '1/8"', 192: '1/16"', 384: '1/32"'}
    return f"{named[scale]} = 1'-0\"" if scale in named else f"1:{scale}"


def _most(n: int) -> int:
    return _LARGEST[n] + 1 if n < len(_LARGEST) else len(METRIC)


def _fitting(extent: Array, margins: Array, scale: int, paper: str) -> Sheet | None:
    """The paper, landscape rather than portrait for what is wide, if the plan fits on it."""
    short, long = PAPERS[paper]
    ways = [(long, short), (short, long)]
    for size in ways if extent[0] >= extent[1] else ways[::-1]:
        sheet = Sheet(scale, paper, size)
        if np.all(extent * 1000 / scale + margins <= np.ptp(sheet.space, axis=0)):
            return sheet
    return None
