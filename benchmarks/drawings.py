"""Seconds to draw large plans in every format: `python benchmarks/drawings.py --rooms 200 --walls 10000`."""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from pathlib import Path

import numpy as np

from recon.exporters import DRAWINGS, export
from recon.model import Dimension, Layout, Model, Room, Wall
from recon.simulate import office_plan
from recon.simulate.building import build_building
from recon.simulate.truth import true_layout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=200, help="rooms of an office building")
    parser.add_argument("--walls", type=int, default=10_000, help="walls of a grid of square rooms")
    arguments = parser.parse_args()
    plans = [office(arguments.rooms), grid(arguments.walls // 4)]
    suffixes = sorted(DRAWINGS)
    print(f"| plan | walls | {' | '.join(f'{s}, CPU s (MB)' for s in suffixes)} |\n|{' --- |' * (len(suffixes) + 2)}")
    for model in plans:
        cells = [timed(model, suffix) for suffix in suffixes]
        print(f"| {model.name} | {len(model.layout.walls)} | {' | '.join(cells)} |", flush=True)


def timed(model: Model, suffix: str) -> str:
    """One export."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"plan{suffix}"
        start = time.process_time()
        export(model, path)
        return f"{time.process_time() - start:.1f} ({path.stat().st_size / 1e6:.1f})"


def office(rooms: int) -> Model:
    """The truth of a simulated building, with sigmas, and with the width and depth of every room."""
    layout = true_layout(build_building(office_plan(0, rooms=rooms)), np.array([0.0, 0.0, 0.3]))
    walls = tuple(dataclasses.replace(w, sigma_offset=0.004, sigma_angle=0.0005) for w in layout.walls)
    return Model(f"office of {rooms} rooms", dataclasses.replace(layout, walls=walls, dimensions=sizes(layout)), ())


def sizes(layout: Layout) -> tuple[Dimension, ...]:
    """Of four-cornered rooms the distances of facing walls."""
    ids = {tuple(np.round(wall.start, 6)): wall for wall in layout.walls}
    found = []
    for room in layout.rooms:
        if len(room.polygon) == 4:
            own = [ids[tuple(np.round(corner, 6))] for corner in room.polygon]
            for a, b in ((own[0], own[2]), (own[1], own[3])):
                start = (a.start + a.end) / 2
                end = start + float((b.start - start) @ a.normal) * a.normal
                found.append(Dimension(room.id, (a.id, b.id), start, end, 0.006))
    return tuple(found)


def grid(rooms: int) -> Model:
    """Square rooms of 4 m in rows, walls of 0.15 m between them."""
    side, shapes, walls = int(np.ceil(np.sqrt(rooms))), [], []
    for k in range(rooms):
        corners = 4.15 * np.array(divmod(k, side)) + np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
        shapes.append(Room(k, f"room {k}", corners))
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), a, b, 0.004, 0.001, "lidar", 5, 0.15))
    layout = Layout(tuple(walls), tuple(shapes))
    return Model(f"grid of {rooms} rooms", dataclasses.replace(layout, dimensions=sizes(layout)), ())


if __name__ == "__main__":
    main()
