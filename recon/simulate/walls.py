"""Painted walls: paint, baseboard, door frames, switches, posters and notice boards."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.simulate.building import Building, Surface
from recon.simulate.canvas import Canvas, Colour, mix
from recon.simulate.openings import Niche
from recon.simulate.style import RoomStyle

FRAME = 0.06
"""m; width of the frame round an opening."""


def paint_wall(surface: Surface, building: Building, style: RoomStyle, ppm: float, rng: np.random.Generator) -> Canvas:
    """A wall as seen from its room (u from its end to its start)."""
    width, height = surface.size
    first = min(s.ref for s in building.surfaces if s.kind == "wall" and s.room == surface.room)
    base = style.accent if surface.ref - first == style.accent_wall else style.wall
    canvas = Canvas(width, height, ppm, base)
    if style.band > 0.0:
        canvas.rectangle(0, 0, width, style.band, mix(base, (0.25, 0.3, 0.32), 0.45))
        canvas.rectangle(0, style.band, width, style.band + 0.05, style.trim)
    canvas.noise(rng, 0.012, 0.5)
    canvas.noise(rng, 0.005, 0.06)
    canvas.noise(rng, 0.015, 0.005)
    _scuffs(canvas, rng)
    holes = [(_span(surface, n), n) for n in building.niches if n.wall == surface.ref]
    look = building.plan.look
    _baseboard(canvas, look.baseboard, style.trim)
    for (u0, u1), niche in holes:
        _door_frame(canvas, u0, u1, niche, style.frame)
    taken = [(u0 - 0.15, u1 + 0.15) for (u0, u1), _ in holes]
    taken += _switches(canvas, holes, rng)
    _hang(canvas, taken, look.posters, rng)
    return canvas


def _span(surface: Surface, niche: Niche) -> tuple[float, float]:
    u = np.sort((niche.front - surface.origin[:2]) @ surface.axis_u[:2])
    return float(u[0]), float(u[1])


def _baseboard(canvas: Canvas, height: float, colour: Colour) -> None:
    if height > 0.0:
        canvas.rectangle(0, 0, canvas.width, height, colour)
        canvas.rectangle(0, height - 0.008, canvas.width, height, mix(colour, (1, 1, 1), 0.25))
        canvas.rectangle(0, height, canvas.width, height + 0.012, (0, 0, 0), 0.15)


def _door_frame(canvas: Canvas, u0: float, u1: float, niche: Niche, colour: Colour) -> None:
    low = niche.bottom - FRAME if niche.bottom > 0 else 0.0
    canvas.rectangle(u0 - FRAME - 0.01, low, u1 + FRAME + 0.01, niche.top + FRAME + 0.01, (0, 0, 0), 0.12)
    canvas.rectangle(u0 - FRAME, low, u1 + FRAME, niche.top + FRAME, colour)
    canvas.rectangle(u0 - 0.012, niche.bottom, u1 + 0.012, niche.top + 0.012, mix(colour, (1, 1, 1), 0.3))


def _scuffs(canvas: Canvas, rng: np.random.Generator) -> None:
    for _ in range(rng.poisson(canvas.width * 1.5)):
        u, v, length = rng.uniform(0, canvas.width), rng.uniform(0.1, 0.7), rng.uniform(0.03, 0.25)
        canvas.rectangle(u, v, u + length, v + rng.uniform(0.002, 0.006), (0.2, 0.2, 0.2), rng.uniform(0.05, 0.3))


def _switches(
    canvas: Canvas, holes: list[tuple[tuple[float, float], Niche]], rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Light switches beside doors and sockets near the floor; what they take of the wall."""
    taken = []
    for (_, u1), niche in holes:
        if niche.type != "window" and rng.random() < 0.7:
            u = u1 + 0.18
            canvas.rectangle(u - 0.045, 1.0, u + 0.045, 1.1, (0.95, 0.95, 0.93))
            canvas.rectangle(u - 0.025, 1.02, u + 0.025, 1.08, (0.85, 0.85, 0.83))
            taken.append((u - 0.05, u + 0.05))
    for _ in range(rng.poisson(canvas.width * 0.15)):
        u = rng.uniform(0, canvas.width)
        if all(not low < u < high for low, high in taken):
            canvas.rectangle(u - 0.04, 0.28, u + 0.04, 0.36, (0.93, 0.93, 0.91))
    return taken


def _hang(canvas: Canvas, taken: list[tuple[float, float]], rate: float, rng: np.random.Generator) -> None:
    """Posters and boards, `rate` a metre, where the wall is free."""
    for _ in range(rng.poisson(canvas.width * rate)):
        board = rng.random() < 0.35
        width, height = (rng.uniform(0.9, 1.5), rng.uniform(0.6, 0.9)) if board else _paper(rng)
        if width > canvas.width - 0.3 or canvas.height < 1.3 + height:
            continue
        u = rng.uniform(0.15, canvas.width - width - 0.15)
        if any(u < high and u + width > low for low, high in taken):
            continue
        taken.append((u - 0.1, u + width + 0.1))
        top = min(rng.uniform(1.6, 1.95), canvas.height - 0.15)
        canvas.rectangle(u - 0.01, top - height - 0.02, u + width + 0.01, top, (0, 0, 0), 0.12)
        if board:
            _board(canvas, u, top, width, height, rng)
        else:
            canvas.paste(u, top, _sheet(width, height, canvas.ppm, rng))
            if rng.random() < 0.4:
                canvas.frame(u - 0.015, top - height - 0.015, u + width + 0.015, top + 0.015, 0.02, (0.12, 0.11, 0.1))


def _paper(rng: np.random.Generator) -> tuple[float, float]:
    short = float(rng.choice([0.21, 0.297, 0.42, 0.594], p=[0.2, 0.3, 0.3, 0.2]))
    return (short, short * 1.414) if rng.random() < 0.7 else (short * 1.414, short)


def _board(canvas: Canvas, u: float, top: float, width: float, height: float, rng: np.random.Generator) -> None:
    cork = Canvas(width, height, canvas.ppm, (0.68, 0.50, 0.33))
    cork.noise(rng, 0.08, 0.006)
    for _ in range(rng.integers(3, 10)):
        w, h = _paper(rng)
        w, h = 0.7 * w, 0.7 * h
        if w < width - 0.1 and h < height - 0.1:
            at = rng.uniform(0.04, width - w - 0.04), rng.uniform(h + 0.04, height - 0.04)
            cork.paste(*at, _sheet(w, h, canvas.ppm, rng))
    cork.frame(0, 0, width, height, 0.025, (0.72, 0.70, 0.66))
    canvas.paste(u, top, np.clip(cork.image * 255, 0, 255).astype(np.uint8))


def _sheet(width: float, height: float, ppm: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A printed page: heading, pictures, lines of text."""
    rows, columns = max(4, round(height * ppm)), max(4, round(width * ppm))
    paper = rng.choice(
        np.array([[246, 245, 240], [250, 240, 170], [240, 190, 200], [40, 60, 90]]), p=[0.7, 0.1, 0.1, 0.1]
    )
    big = np.empty((4 * rows, 4 * columns, 3), np.uint8)
    big[:] = paper
    ink = tuple(int(c) for c in (rng.integers(0, 90, 3) if paper.sum() > 300 else rng.integers(180, 255, 3)))
    margin, y, line = int(0.08 * 4 * columns), int(0.06 * 4 * rows), 4.0 * ppm
    cv2.rectangle(big, (margin, y), (int(4 * columns * rng.uniform(0.5, 0.9)), y + int(0.03 * line)), ink, -1)
    y += int(0.06 * line)
    while y < 4 * rows - margin:
        if rng.random() < 0.25:
            y = _picture(big, margin, y, rng)
        else:
            for _ in range(int(rng.integers(2, 7))):
                end = int(4 * columns - margin - rng.uniform(0, 0.25) * 4 * columns)
                cv2.line(big, (margin, y), (end, y), ink, max(1, int(0.004 * line)), cv2.LINE_AA)
                y += int(0.013 * line) + 1
        y += int(0.02 * line) + 1
    big[4 * rows - margin :] = paper
    return np.asarray(cv2.resize(big, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)


def _picture(big: NDArray[np.uint8], margin: int, y: int, rng: np.random.Generator) -> int:
    bottom = min(y + int(big.shape[0] * rng.uniform(0.15, 0.4)), big.shape[0] - margin)
    right = big.shape[1] - margin
    if bottom - y < 8:
        return big.shape[0]
    colours = rng.integers(20, 255, (6, 3))
    big[y:bottom, margin:right] = colours[0]
    for colour in colours[1:]:
        corners = np.stack([rng.integers(margin, right, 3), rng.integers(y, bottom, 3)], axis=1)
        cv2.fillPoly(big, [corners.astype(np.int32)], tuple(int(c) for c in colour), cv2.LINE_AA)
    return bottom
