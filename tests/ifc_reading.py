"""What tests read out of IFC files with IfcOpenShell: outlines, surfaces, and random plans to write."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import ifcopenshell.util.placement
import numpy as np
import shapely

from recon.geometry import Array
from recon.layout.thickness import with_thickness
from recon.model import Layout
from recon.simulate.building import build_building
from recon.simulate.office import office_plan
from recon.simulate.truth import true_layout


@cache
def random_plan(seed: int, rooms: int = 12) -> Layout:
    """The true layout of a simulated office, turned and moved."""
    layout = true_layout(build_building(office_plan(seed, rooms=rooms)), np.array([-30.0, 12.0, 0.3]))
    return replace(layout, walls=tuple(with_thickness(layout.walls)))


def placed(thing: Any, points: Array) -> Array:
    """Points (n, 2) of a product's own plane in the coordinates of the file, (n, 2)."""
    flat = np.column_stack([points, np.zeros(len(points)), np.ones(len(points))])
    return np.asarray((flat @ ifcopenshell.util.placement.get_local_placement(thing.ObjectPlacement).T)[:, :2])


def polyline(curve: Any) -> Array:
    """Points (n, d) of an IfcPolyline, the first again at the end where it is closed."""
    return np.array([point.Coordinates for point in curve.Points])


def body(thing: Any) -> Any:
    """The swept solid of a product's body."""
    return next(r for r in thing.Representation.Representations if r.RepresentationIdentifier == "Body").Items[0]


def ground(thing: Any) -> shapely.Polygon:
    """The ground under a product's body, without voids, in the coordinates of the file."""
    area = body(thing).SweptArea
    rings = [area.OuterCurve, *(area.InnerCurves if area.is_a("IfcArbitraryProfileDefWithVoids") else ())]
    outer, *inner = (placed(thing, polyline(ring)) for ring in rings)
    return shapely.Polygon(outer, inner)


def rectangle(boundary: Any) -> tuple[Array, float, float]:
    """The foot (2, 2) of an upright space boundary, its lower edge and its height, m, in its space's coordinates."""
    surface = boundary.ConnectionGeometry.SurfaceOnRelatingElement
    return polyline(surface.SweptCurve.Curve), surface.Position.Location.Coordinates[2], surface.Depth
