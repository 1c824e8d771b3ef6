"""The result: walls, rooms, openings, objects (the layout) and textured faces. Exporters see only this."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

if TYPE_CHECKING:
    from recon.cloud import PointCloud
    from recon.occupancy import Occupancy
    from recon.sequence.trajectory import Trajectory

Source = Literal["lidar", "image", "inferred"]
OpeningType = Literal["door", "passage", "window"]
FaceKind = Literal["wall", "floor", "ceiling", "reveal", "threshold", "door", "window"]

DEFAULT_CEILING_HEIGHT = 2.6
"""m; what exports extrude walls to when no image shows the ceiling (`LayoutConfig.default_ceiling_height`)."""


@dataclass(frozen=True)
class Wall:
    """A vertical face seen from inside: walking from `start` to `end` the free space is on the left.

    start, end: (2,), m, map frame. sigma_offset (m) and sigma_angle (rad): one standard deviation of the wall line's
    offset at the middle of the wall and of its direction. `observations` counts the scans and images behind it.
    thickness: m to the face on the other side, where that was seen too. unseen: (K, 2) m from `start`, stretches
    between what was seen of the wall, hidden by what stands before it.
    """

    id: int
    start: Array
    end: Array
    sigma_offset: float
    sigma_angle: float
    source: Source
    observations: int
    thickness: float | None = None
    unseen: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @cached_property
    def length(self) -> float:
        """Length in m."""
        return float(np.linalg.norm(self.end - self.start))

    @cached_property
    def direction(self) -> Array:
        """Unit vector (2,) from start to end."""
        return np.asarray((self.end - self.start) / max(self.length, 1e-12))

    @cached_property
    def normal(self) -> Array:
        """Unit vector (2,) into the free space, to the left of `direction`."""
        d = self.direction
        return np.array([-d[1], d[0]])


@dataclass(frozen=True)
class Room:
    """A closed, counter-clockwise, simple polygon (n, 2), m, map frame, first corner not repeated.

    ceiling_height, sigma_ceiling: m, where images show this room's ceiling, with its standard deviation.
    corner_covariances: (n, 2, 2) m^2, of every corner's place, nan where nobody saw one of its walls.
    """

    id: int
    name: str
    polygon: Array
    ceiling_height: float | None = None
    sigma_ceiling: float | None = None
    corner_covariances: Array | None = None

    @property
    def area(self) -> float:
        """m^2."""
        x, y = (self.polygon - self.polygon[0]).T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    @property
    def perimeter(self) -> float:
        """m."""
        return float(np.linalg.norm(np.roll(self.polygon, -1, axis=0) - self.polygon, axis=1).sum())


@dataclass(frozen=True)
class Opening:
    """A door (leaf), passage (no leaf) or window (glass) in wall `wall`; heights above the floor in m.

    `open`: a door whose leaf stands open. One looks through it, as through a passage (`is_hole`). sigma_top: one
    standard deviation of `top`, None where no image shows it and `top` is assumed. depth: m from the face of the wall
    back to the leaf or glass, None where nothing has measured it. sigma_jambs: m, one standard deviation of where
    `start` and `end` are along the wall, None where nothing says it.
    """

    id: int
    type: OpeningType
    wall: int
    start: Array
    end: Array
    bottom: float
    top: float
    open: bool = False
    sigma_top: float | None = None
    depth: float | None = None
    sigma_jambs: float | None = None

    @property
    def is_hole(self) -> bool:
        """Whether nothing fills it."""
        return self.type == "passage" or (self.type == "door" and self.open)


@dataclass(frozen=True)
class FloorObject:
    """Something that stands in a room and is no wall: footprint polygon (n, 2), m, map frame.

    bottom, top: m above the floor; `top` is None where no image shows how high it is. legs: footprints (n, 2) of the
    parts that the scanner saw where the thing is wider than they are (tables, chairs); `footprint` is then their hull.
    """

    id: int
    footprint: Array
    bottom: float = 0.0
    top: float | None = None
    legs: tuple[Array, ...] = ()


@dataclass(frozen=True)
class Dimension:
    """The distance between two facing walls (ids) of a room (id), from `start` on the first to `end` (2,), m.

    room -1: walls of several rooms (`Layout.spans`).

    sigma: m, one standard deviation of the distance, from the joint covariance of both walls.
    """

    room: int
    walls: tuple[int, int]
    start: Array
    end: Array
    sigma: float

    @property
    def distance(self) -> float:
        """m."""
        return float(np.linalg.norm(self.end - self.start))


@dataclass(frozen=True)
class Layout:
    """Walls, rooms, openings and objects in the map frame (layout.json of FORMAT.md).

    dimensions: of rooms. spans: of walls of several rooms, along the plan's dimension chains, from a corner of the
    first straight to beside one of the second.

    `ceiling_height` is None when no image shows the ceiling; `extrusion_height` is then the default.
    """

    walls: tuple[Wall, ...]
    rooms: tuple[Room, ...]
    openings: tuple[Opening, ...] = ()
    objects: tuple[FloorObject, ...] = ()
    ceiling_height: float | None = None
    sigma_ceiling: float | None = None
    default_ceiling_height: float = DEFAULT_CEILING_HEIGHT
    dimensions: tuple[Dimension, ...] = ()
    spans: tuple[Dimension, ...] = ()

    @property
    def extrusion_height(self) -> float:
        """Height of walls in 3D, m: the measured ceiling, else the default."""
        return self.default_ceiling_height if self.ceiling_height is None else self.ceiling_height

    def wall(self, wall_id: int) -> Wall:
        """The wall with this id; KeyError when there is none."""
        for wall in self.walls:
            if wall.id == wall_id:
                return wall
        raise KeyError(wall_id)


@dataclass(frozen=True)
class Face:
    """One flat, textured face of the model in the map frame.

    name: `wall_003`, `floor_000`, `ceiling_000`: unique, the number is the wall's or room's id (`ref`). Sides of
    openings (`reveal_005_left`, `threshold_005`), leaves (`door_005`) and glass (`window_005`) are numbered by the
    opening (`opening`); their `ref` is its wall.
    vertices: (V, 3), m. triangles: (T, 3) int indices, counter-clockwise seen from the free space.
    uv: (V, 2) in [0, 1], u to the right and v UP (OpenGL, glTF flips): (0, 0) is the lower left corner of the picture.
    texture: (H, W, 3) uint8 RGB, row 0 is the top, or None: a clean neutral material (`neutral_colour`).
    seen_fraction: share of texels that an image saw, the rest was filled.
    sources: (H, W) int32, index of the image that most of a texel is from, -1 where it was filled (`filled`).
    tile_of: name of the face that this one is a part of, its picture a part of the whole (`recon.tiles`).
    page: name of the picture, where several faces share one.
    """

    name: str
    kind: FaceKind
    ref: int
    vertices: Array
    triangles: NDArray[np.int64]
    uv: Array
    texture: NDArray[np.uint8] | None = None
    metres_per_texel: float = 0.0
    seen_fraction: float = 0.0
    sources: NDArray[np.int32] | None = field(default=None, kw_only=True)
    opening: int | None = None
    tile_of: str | None = field(default=None, kw_only=True)
    page: str | None = field(default=None, kw_only=True)

    @property
    def filled(self) -> NDArray[np.bool_] | None:
        """(H, W) texels that no image saw."""
        return None if self.sources is None else self.sources < 0

    @cached_property
    def normal(self) -> Array:
        """Unit normal (3,) into the free space."""
        a, b, c = self.vertices[self.triangles[0]]
        n = np.cross(b - a, c - a)
        return np.asarray(n / np.linalg.norm(n))


NEUTRAL_COLOURS: dict[FaceKind, tuple[int, int, int]] = {
    "wall": (222, 219, 212),
    "floor": (150, 146, 138),
    "ceiling": (240, 240, 238),
    "reveal": (214, 211, 204),
    "threshold": (150, 146, 138),
    "door": (176, 138, 98),
    "window": (196, 212, 220),
}
"""RGB of faces without a texture."""


@dataclass(frozen=True)
class Model:
    """What a build gives and every exporter writes. `notes`: what was assumed, one sentence each, for people.

    picture_notes: such of the faces' pictures, which drawings leave out.
    trajectory: of the platform; pose_sigmas: (N, 3) m, m, rad of its poses, or (0, 3); occupancy: where it can drive;
    cloud: what the scanner hit. Results of older versions hold neither of these two, models made by hand none of all.
    """

    name: str
    layout: Layout
    faces: tuple[Face, ...]
    notes: tuple[str, ...] = ()
    metadata: dict[str, str] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    pose_sigmas: Array = field(default_factory=lambda: np.zeros((0, 3)))
    occupancy: Occupancy | None = None
    cloud: PointCloud | None = None
    picture_notes: tuple[str, ...] = ()
