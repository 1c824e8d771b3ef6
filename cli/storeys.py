"""Several results as storeys of one building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from recon.errors import InputError

if TYPE_CHECKING:
    from recon.storeys import Building

Place = tuple[float, float, float]
"""x, y (m) and direction (degrees) of a result's map frame in the building's."""


def check_storeys(
    results: Sequence[Path], storeys: Sequence[str], elevations: Sequence[float], places: Sequence[Place]
) -> None:
    """Raise UsageError unless every result has its storey and elevation, and its place or none has."""
    count = len(results)
    if not storeys and not elevations and not places and count == 1:
        return
    for name, given in (("--storey", storeys), ("--elevation", elevations)):
        if len(given) != count:
            raise click.UsageError(f"{len(given)} times {name} for {count} results, expected one each, in their order.")
    if len(places) not in (0, count):
        raise click.UsageError(f"{len(places)} times --place for {count} results, expected one each, or none.")
    for storey in storeys:
        if not storey.strip():
            raise click.UsageError("--storey: an empty name, expected one such as Ground.")
    for number in (*elevations, *(value for place in places for value in place)):
        if not math.isfinite(number):
            raise click.UsageError(f"{number} is no length or angle, expected a number.")


def load_building(
    name: str, results: Sequence[Path], storeys: Sequence[str], elevations: Sequence[float], places: Sequence[Place]
) -> Building:
    """The building of some results, each brought to its place.

    Without places, results that were all tied to a survey (`recon build --control`) lie in its frame; else each stays
    in its own map frame. Raises InputError for damaged results, or when only some of several were tied to a survey.
    """
    from recon.merge import moved
    from recon.results import load_model
    from recon.results.reader import load_survey
    from recon.storeys import Storey, stack

    if places:
        poses = [(x, y, math.radians(degrees)) for x, y, degrees in places]
    else:
        surveys = [load_survey(result) for result in results]
        known = [pose for pose in surveys if pose is not None]
        if len(known) not in (0, len(results)):
            lost = next(result for result, pose in zip(results, surveys, strict=True) if pose is None)
            raise InputError(f"{lost}: is not tied to the survey that others are, expected --place for every result")
        poses = known or [(0.0, 0.0, 0.0)] * len(results)
    parts = []
    for result, storey, elevation, pose in zip(results, storeys, elevations, poses, strict=True):
        parts.append(Storey(storey.strip(), elevation, moved(load_model(result), pose)))
    return stack(name, parts)
