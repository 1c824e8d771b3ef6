"""Which of the walls that may be furniture are: images show where it ends, and the wall behind above it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from recon.faces import extrude
from recon.furniture import Furniture
from recon.geometry import Array, Pose3
from recon.model import Layout
from recon.raycast import RayScene
from recon.segmentation.column import Column
from recon.segmentation.crop import Eye
from recon.segmentation.heights import FEWEST, Load, near, views
from recon.segmentation.solid import STEP, SolidFit, fit_solid
from recon.segmentation.thing import Thing
from recon.sequence.camera import Camera

HIGHEST, SEARCHED = 2.15, 2.6
"""m: what ends higher may end at the ceiling; images are looked at up to here."""
OWN, BEHIND = 2.0, 1.0
"""Evidence, natural logarithm of a likelihood ratio, of the pixels below the top for the thing, and of those above it
for what is behind. Walls that jut out look like the walls around them: they reach 1.2 below, furniture 3.6."""
SAME = 0.2
"""Share of the smaller footprint that two faces of one thing have in common."""
EDGE, ABOVE, LEAST_ABOVE = 0.06, 0.5, 0.25
"""m above the top where the thing may show yet; above that as much is looked at, and at least so much must be seen."""


def standing_furniture(
    doubtful: Sequence[Furniture],
    layout: Layout,
    camera: Camera,
    map_from_camera: Sequence[Pose3 | None],
    load: Load,
) -> list[Furniture]:
    """Those of the doubtful things that images show to end below the ceiling, with the room going on above them.

    layout: the plan without any of them, so that its faces are what is behind. A thing that looks like the wall behind
    it, or whose top no image shows, is left to what the scanner says: a wall.
    """
    footprints = shapely.union_all([thing.polygon for thing in doubtful])
    things = [Thing((Column(thing.clear_footprint),), Column(thing.footprint), True) for thing in doubtful]
    others = [
        Thing.of(item, layout.walls)
        for item in layout.objects
        if not footprints.intersects(shapely.Polygon(item.footprint))
    ]
    eye, top = Eye(camera, RayScene(extrude(layout))), min(SEARCHED, layout.extrusion_height)
    found = []
    for thing, suspect in zip(things, doubtful, strict=True):
        around = near(thing, [*others, *(t for t, s in zip(things, doubtful, strict=True) if not _same(s, suspect))])
        seen = views(thing, around, eye, map_from_camera, load, top)
        fit = fit_solid([crop for crop, _ in seen], top) if len(seen) >= FEWEST else None
        if fit is not None and ends_below_the_ceiling(fit):
            found.append(suspect)
    return found


def _same(one: Furniture, other: Furniture) -> bool:
    """Whether two suspects are faces of one thing."""
    smaller = min(one.polygon.area, other.polygon.area)
    return bool(one.polygon.intersection(other.polygon).area > SAME * smaller)


def ends_below_the_ceiling(fit: SolidFit) -> bool:
    """Whether pixels tell a thing that stands on the floor from what is behind it, and what is behind from it above."""
    low, high = fit.span
    if low > 0 or high > HIGHEST:
        return False
    below = fit.shown[: round(high / STEP)]
    first = round((high + EDGE) / STEP)
    above = fit.shown[first : first + round(ABOVE / STEP)]
    return _mean(below) >= OWN and _mean(above) <= -BEHIND and np.isfinite(above).sum() * STEP >= LEAST_ABOVE


def _mean(values: Array) -> float:
    """Of those that are not nan; nan for none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
