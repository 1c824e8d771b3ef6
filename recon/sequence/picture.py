"""A picture of a sequence: its scans from above and its first images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import OutputError
from recon.files import atomic_path
from recon.geometry import Array, apply2
from recon.sequence.images import load_image
from recon.sequence.sequence import Sequence

SIDE = 900
"""Pixels a side of the plan."""
TILE = 300
"""Pixels high, a column of three images."""
PAPER, INK, PATH_COLOUR = (250, 250, 250), (60, 60, 60), (40, 40, 210)
FIRST_SCANS = ((180, 90, 20), (60, 150, 40), (40, 40, 210))
"""BGR of the first, middle and last scan where no odometry says how they lie."""

Picture = NDArray[np.uint8]


def write_picture(sequence: Sequence, path: Path) -> None:
    """Writes a PNG: scans laid out by the odometry (without: three of them, each seen from the scanner), six images."""
    picture = _plan(sequence)
    tiles = _tiles(sequence)
    if tiles is not None:
        picture = np.hstack([picture, tiles])
    _, png = cv2.imencode(".png", picture)
    try:
        with atomic_path(path) as temporary:
            temporary.write_bytes(png.tobytes())
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from None


def _plan(sequence: Sequence) -> Picture:
    scans, odometry = sequence.scans, sequence.odometry
    if odometry is None:
        chosen = np.unique(np.linspace(0, len(scans) - 1, len(FIRST_SCANS)).astype(int))
        layers = [(scans.points(i), colour) for i, colour in zip(chosen, FIRST_SCANS, strict=False)]
        path, title = np.zeros((1, 2)), "scans " + ", ".join(str(i) for i in chosen) + ", each seen from the scanner"
    else:
        poses = odometry.at(scans.timestamps)
        step = max(1, len(scans) // 500)
        clouds = [apply2(poses[i], scans.points(i)) for i in range(0, len(scans), step)]
        layers, path = [(np.concatenate(clouds), INK)], poses[:, :2]
        title = "scans by the given odometry (drift and all), path in red"
    return _draw(layers, path, title)


def _draw(layers: list[tuple[Array, tuple[int, int, int]]], path: Array, title: str) -> Picture:
    everything = np.concatenate([path, *(points for points, _ in layers)])
    low, high = np.quantile(everything, [0.002, 0.998], axis=0)
    low, high = np.minimum(low, path.min(axis=0)), np.maximum(high, path.max(axis=0))
    scale = (SIDE - 100) / max(float((high - low).max()), 1.0)

    def to_pixels(points: Array) -> NDArray[np.int32]:
        centred = (points - (low + high) / 2) * scale
        return np.rint(centred * [1, -1] + SIDE / 2).astype(np.int32)

    picture = np.full((SIDE, SIDE, 3), PAPER, dtype=np.uint8)
    for points, colour in layers:
        pixels = to_pixels(points)
        pixels = pixels[((pixels >= 0) & (pixels < SIDE)).all(axis=1)]
        picture[pixels[:, 1], pixels[:, 0]] = colour
    trail = to_pixels(path)
    cv2.polylines(picture, [trail.reshape(-1, 1, 2)], False, PATH_COLOUR, 2, cv2.LINE_AA)
    cv2.circle(picture, tuple(int(v) for v in trail[0]), 6, PATH_COLOUR, -1, cv2.LINE_AA)
    _scale_bar(picture, scale)
    _write(picture, title, (15, 25))
    return picture


def _scale_bar(picture: Picture, scale: float) -> None:
    lengths = [m * 10**e for e in range(4) for m in (1, 2, 5)]
    metres = max((length for length in lengths if length * scale < SIDE / 4), default=1)
    end = 15 + int(metres * scale)
    cv2.line(picture, (15, SIDE - 20), (end, SIDE - 20), INK, 3)
    _write(picture, f"{metres} m", (15, SIDE - 30))


def _tiles(sequence: Sequence) -> Picture | None:
    """The first six images that can be read, two columns of three, each with its name and time."""
    if sequence.images is None or sequence.camera is None:
        return None
    tiles: list[Picture] = []
    width = min(round(TILE * sequence.camera.width / sequence.camera.height), 2 * TILE)
    for index in range(len(sequence.images)):
        image = load_image(sequence.images, index, sequence.camera, warnings=[])
        if image is None:
            continue
        tile = np.asarray(cv2.resize(image, (width, TILE), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        seconds = sequence.images.timestamps[index] - sequence.scans.timestamps[0]
        _write(tile, f"{sequence.images.names[index]}  {seconds:+.2f} s", (8, 20))
        tiles.append(tile)
        if len(tiles) == 6:
            break
    blank = np.full((TILE, width, 3), PAPER, dtype=np.uint8)
    tiles += [blank] * (6 - len(tiles))
    return np.vstack([np.hstack(tiles[row : row + 2]) for row in (0, 2, 4)])


def _write(picture: Picture, text: str, corner: tuple[int, int]) -> None:
    """Ink on a patch of paper: an outline in another weight would have other widths."""
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, 0.5
    (width, height), below = cv2.getTextSize(text, font, scale, 1)
    x, y = corner
    cv2.rectangle(picture, (x - 3, y - height - 3), (x + width + 3, y + below + 1), PAPER, cv2.FILLED)
    cv2.putText(picture, text, corner, font, scale, INK, 1, cv2.LINE_AA)
