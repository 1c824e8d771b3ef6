"""The picture plane of a face: where every texel, and every block of texels, lies in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face

BLOCK = 8
"""Texels a side of a block: views are chosen a block at a time."""
SHIFT = 4
"""Bits of fraction of the corners when triangles are filled."""
LONGEST = 32000
"""Texels a side of a picture: OpenCV's maps and polygons end at 32767."""


@dataclass(frozen=True)
class Plane:
    """The plane of a face. origin: (3,) the point at uv (0, 0), m; right, up: (3,), m, the whole picture's sides."""

    origin: Array
    right: Array
    up: Array

    @staticmethod
    def of(face: Face) -> Plane:
        """The affine map from uv to space that fits the face's vertices."""
        homogeneous = np.column_stack([face.uv, np.ones(len(face.uv))])
        rows = np.linalg.lstsq(homogeneous, face.vertices, rcond=None)[0]
        return Plane(rows[2], rows[0], rows[1])

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, m."""
        return float(np.linalg.norm(self.right)), float(np.linalg.norm(self.up))

    @property
    def normal(self) -> Array:
        """Unit normal (3,) out of the picture, into the free space."""
        n = np.cross(self.right, self.up)
        return np.asarray(n / np.linalg.norm(n))


def limit(plane: Plane, max_size: int) -> float:
    """Metres per texel at which a picture has as many as a square of `max_size` a side, none side over LONGEST."""
    width, height = plane.size
    return max(float(np.sqrt(width * height)) / max_size, max(width, height) / LONGEST)


@dataclass(frozen=True)
class Canvas:
    """A picture of width x height texels on a face. Texel (row, column) has its centre at integer coordinates."""

    face: Face
    plane: Plane
    width: int
    height: int

    @staticmethod
    def of(face: Face, metres_per_texel: float, max_size: int) -> Canvas:
        """At this resolution, or coarser where there would be more texels than `limit` allows."""
        plane = Plane.of(face)
        coarsest = max(metres_per_texel, limit(plane, max_size))
        width, height = (min(max(int(np.ceil(side / coarsest - 1e-9)), 1), LONGEST) for side in plane.size)
        return Canvas(face, plane, width, height)

    @property
    def texel(self) -> float:
        """Metres per texel: the geometric mean of both sides."""
        return float(np.sqrt(self.plane.size[0] / self.width * self.plane.size[1] / self.height))

    @property
    def floor(self) -> bool:
        """Whether it is a floor."""
        return bool(self.plane.normal[2] > 0.5)

    @property
    def blocks(self) -> tuple[int, int]:
        """Rows and columns of blocks; the last ones may reach beyond the picture."""
        return -(-self.height // BLOCK), -(-self.width // BLOCK)

    @cached_property
    def axes(self) -> Array:
        """(2, 3) unit vectors to the right and down."""
        return np.stack([self.plane.right / self.plane.size[0], -self.plane.up / self.plane.size[1]])

    def points(self, x: Array, y: Array) -> Array:
        """Points (..., 3) in the map at texel coordinates x to the right, y down (broadcast against each other)."""
        u, v = (np.asarray(x) + 0.5) / self.width, 1 - (np.asarray(y) + 0.5) / self.height
        return np.asarray(self.plane.origin + u[..., None] * self.plane.right + v[..., None] * self.plane.up)

    def inside(self) -> NDArray[np.bool_]:
        """(height, width): texels on the face (not beyond its outline, nor in its holes)."""
        corners = self.face.uv * [self.width, -self.height] + [-0.5, self.height - 0.5]
        polygons = np.round(corners[self.face.triangles] * (1 << SHIFT)).astype(np.int32)
        mask = np.zeros((self.height, self.width), np.uint8)
        for polygon in polygons:
            cv2.fillConvexPoly(mask, polygon, 1, cv2.LINE_8, SHIFT)
        return mask.astype(bool)

    @cached_property
    def block_points(self) -> tuple[Array, NDArray[np.bool_]]:
        """Middles (rows, columns, 3) of what each block has on the face, and which (rows, columns) have anything."""
        rows, columns = self.blocks
        mask = np.zeros((rows * BLOCK, columns * BLOCK), np.float32)
        mask[: self.height, : self.width] = self.inside()
        tiles = mask.reshape(rows, BLOCK, columns, BLOCK)
        offsets = np.arange(BLOCK, dtype=np.float32)
        count = tiles.sum(axis=(1, 3))
        some = count > 0
        share = np.maximum(count, 1)
        x = (np.einsum("ribj,j->rb", tiles, offsets) / share) + BLOCK * np.arange(columns)
        y = (np.einsum("ribj,i->rb", tiles, offsets) / share) + BLOCK * np.arange(rows)[:, None]
        return self.points(np.asarray(x, np.float64), np.asarray(y, np.float64)), some

    def nodes(self, rows: tuple[int, int], columns: tuple[int, int]) -> Array:
        """Middles (r + 2, c + 2, 3) of the blocks from rows[0] to before rows[1] ..., with one ring around them."""
        x = (np.arange(columns[0] - 1, columns[1] + 1, dtype=np.float64) + 0.5) * BLOCK - 0.5
        y = (np.arange(rows[0] - 1, rows[1] + 1, dtype=np.float64) + 0.5) * BLOCK - 0.5
        return self.points(x[None, :], y[:, None])


def enlarge(grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (r + 2, c + 2, ...) at `Canvas.nodes`, linear in between, at the texels of the inner r x c blocks."""
    rows, columns = grid.shape[:2]
    full = cv2.resize(grid, (columns * BLOCK, rows * BLOCK), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full[BLOCK:-BLOCK, BLOCK:-BLOCK])
