"""Layers of a drawing: what lies on them, how it is drawn, and what CAD standards call them."""

from __future__ import annotations

from dataclasses import dataclass

from recon.plan.options import LayerNames

INK, GREY = (31, 35, 40), (110, 117, 126)


@dataclass(frozen=True)
class Layer:
    """aia: name after the US National CAD Standard 6. iso: ISO 13567-2: agent, element of CI/SfB table 1, presentation.

    colour: AutoCAD colour number. rgb: on paper. pen: line width, mm. dashed: lines are. plotted: they come onto paper.
    """

    aia: str
    iso: str
    colour: int
    rgb: tuple[int, int, int]
    pen: float
    dashed: bool = False
    plotted: bool = True

    def named(self, names: LayerNames) -> str:
        """The layer's name in the convention `names`."""
        return self.iso if names == "iso" else self.aia


FILL = Layer("A-WALL-PATT", "A-22----H-", 8, INK, 0.13)
"""What is inside walls."""
AREA = Layer("A-AREA", "A-90----E-", 9, GREY, 0.09, plotted=False)
"""Closed outlines of rooms."""
FURNITURE = Layer("A-FURN", "A-70----E-", 8, (150, 156, 163), 0.18)
"""Things that stand in rooms."""
BACK = Layer("A-WALL-BACK", "A-22BACKE-", 8, GREY, 0.18)
"""Backs of walls that were seen from one side only: their place is assumed."""
INFERRED = Layer("A-WALL-INFR", "A-22INFRE-", 1, INK, 0.25, dashed=True)
"""Faces of walls that no sensor saw."""
WALL = Layer("A-WALL", "A-22----E-", 7, INK, 0.35)
"""Faces of walls that a sensor saw, and the jambs between two of them."""
DOOR = Layer("A-DOOR", "A-32----E-", 30, (150, 86, 46), 0.18)
"""Doors, without a swing."""
PASSAGE = Layer("A-WALL-OPNG", "A-32OPENE-", 8, GREY, 0.18, dashed=True)
"""Openings without a leaf: the edges of the wall above."""
GLAZING = Layer("A-GLAZ", "A-31----E-", 4, (40, 118, 168), 0.18)
"""Windows."""
AREA_NAME = Layer("A-AREA-IDEN", "A-90----T-", 3, INK, 0.18)
"""Names and areas of rooms."""
DIMENSIONS = Layer("A-ANNO-DIMS", "A-00----D-", 5, (70, 78, 88), 0.13)
TEXT = Layer("A-ANNO-TEXT", "A-00----T-", 7, (70, 78, 88), 0.18)
"""Notes and what the legend says."""
TITLE = Layer("A-ANNO-TTLB", "A-------B-", 7, INK, 0.25)
"""Frame of the sheet, name, symbols of the legend, scale bar."""
VIEWPORT = Layer("A-ANNO-NPLT", "A-------B0", 9, GREY, 0.09, plotted=False)
"""Frames of viewports, not plotted."""

LAYERS = (
    FILL,
    AREA,
    FURNITURE,
    BACK,
    INFERRED,
    WALL,
    DOOR,
    PASSAGE,
    GLAZING,
    AREA_NAME,
    DIMENSIONS,
    TEXT,
    TITLE,
    VIEWPORT,
)
"""From the bottom up."""
