"""The plan of a simulated building and of the drive through it (plan.json, documented in docs/plan.md).

A plan has its own frame ("plan frame", x and y in metres); the sequence made from it is in the map frame, which is the
platform's pose at the first scan.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from recon.errors import InputError
from recon.files import atomic_path, read_text
from recon.sequence.camera import DistortionModel
from recon.simulate.schema import from_dict, number, to_dict

Point = tuple[float, float]
FloorStyle = Literal["tiles", "checker", "planks", "carpet"]
ObjectStyle = Literal["carton", "cabinet", "metal", "wood", "fabric", "plastic", "leaf"]


@dataclass(frozen=True)
class PlanRoom:
    """A room: its free space as a simple, counter-clockwise polygon; edge i (corner i to i + 1) is its wall i."""

    polygon: tuple[Point, ...]
    name: str = "room"
    ceiling_height: float | None = number(None, 1.8, 12.0)  # type: ignore[arg-type]


@dataclass(frozen=True)
class PlanOpening:
    """A door, passage or window in edge `wall` of room `room`, from `offset` m after the edge's start.

    Where another room's wall lies within 0.6 m behind it, doors and passages pierce both walls; a door may be closed
    there or `open` (its leaf then stands in the room); a door with no room behind it is closed and recessed. Passages
    need a room behind them, windows must have none. A LiDAR sees nothing through a window's glass.
    """

    type: Literal["door", "passage", "window"]
    room: int
    wall: int
    offset: float = number(0.0, 0.0, 1e4)
    width: float = number(0.9, 0.2, 20.0)
    bottom: float = number(0.0, 0.0, 10.0)
    top: float = number(2.05, 0.1, 12.0)
    open: bool = False


@dataclass(frozen=True)
class PlanObject:
    """A box (size: length, depth) or an upright cylinder (size: both its diameter) from `bottom` to `top`, m."""

    center: Point
    size: Point
    shape: Literal["box", "cylinder"] = "box"
    yaw_deg: float = 0.0
    bottom: float = number(0.0, 0.0, 10.0)
    top: float = number(1.0, 0.01, 12.0)
    style: ObjectStyle = "carton"


@dataclass(frozen=True)
class PlanDrive:
    """How the way points are driven: speed m/s, turn_rate rad/s, corner_radius m (smaller where legs are short)."""

    speed: float = number(0.7, 0.05, 3.0)
    turn_rate: float = number(0.8, 0.1, 6.0)
    corner_radius: float = number(0.4, 0.0, 5.0)
    start_time: float = number(1000.0, 0.0, 1e10)


@dataclass(frozen=True)
class PlanCamera:
    """Intrinsics (pixels; cx and cy default to the centre), mounting on the platform and rate.

    x, y, height: m, in the platform frame; tilt_deg is downwards, roll_deg clockwise seen from behind, yaw_deg to the
    left. rate 0 makes no images. noise: standard deviation of a mid-grey pixel, grey values.
    """

    image_width: int = number(640, 64, 4096)
    image_height: int = number(480, 64, 4096)
    fx: float = number(500.0, 30.0, 10000.0)
    fy: float = number(500.0, 30.0, 10000.0)
    cx: float | None = None
    cy: float | None = None
    distortion_model: DistortionModel = "plumb_bob"
    distortion: tuple[float, ...] = (-0.08, 0.03, 0.0005, -0.0004, 0.0)
    x: float = number(0.10, -2.0, 2.0)
    y: float = number(0.03, -2.0, 2.0)
    height: float = number(0.95, 0.1, 3.0)
    tilt_deg: float = number(12.0, -60.0, 60.0)
    roll_deg: float = number(1.0, -30.0, 30.0)
    yaw_deg: float = number(1.5, -180.0, 180.0)
    rate: float = number(2.0, 0.0, 60.0)
    noise: float = number(2.0, 0.0, 50.0)
    exposure_sigma: float = number(0.12, 0.0, 1.0)


@dataclass(frozen=True)
class PlanLidar:
    """The scanner. fov_deg is centred ahead; scan_time: s from the first to the last beam (0: instantaneous).

    sigma: m. dropout: share of beams that return nothing; outlier: share that return too short. mixed: share of the
    beams at a range jump that return something in between.
    """

    beams: int = number(720, 8, 20000)
    fov_deg: float = number(270.0, 10.0, 360.0)
    range_min: float = number(0.1, 0.0, 5.0)
    range_max: float = number(12.0, 0.5, 200.0)
    sigma: float = number(0.01, 0.0, 0.5)
    dropout: float = number(0.01, 0.0, 0.9)
    outlier: float = number(0.002, 0.0, 0.5)
    mixed: float = number(0.3, 0.0, 1.0)
    height: float = number(0.4, 0.02, 3.0)
    rate: float = number(8.0, 0.1, 100.0)
    scan_time: float = number(0.0, 0.0, 1.0)
    intensities: bool = False


@dataclass(frozen=True)
class PlanOdometry:
    """Wheel odometry: scale multiplies every distance; drift_deg is a constant turn a metre; the sigmas are random.

    sigma_distance: m after one metre driven; sigma_heading_deg: degrees after one metre driven (both grow as its root).
    """

    rate: float = number(20.0, 0.5, 200.0)
    scale: float = number(1.01, 0.5, 2.0)
    drift_deg: float = number(0.05, -5.0, 5.0)
    sigma_distance: float = number(0.01, 0.0, 0.5)
    sigma_heading_deg: float = number(0.3, 0.0, 30.0)


@dataclass(frozen=True)
class PlanLook:
    """What cannot be measured but seen; `floor` None draws a kind for every room from the seed."""

    floor: FloorStyle | None = None
    gloss: float = number(0.35, 0.0, 1.0)
    posters: float = number(0.25, 0.0, 2.0)
    baseboard: float = number(0.09, 0.0, 0.4)


@dataclass(frozen=True)
class Plan:
    """A building and a drive; everything but `rooms` and `path` has a default. Check it with `check_plan`."""

    rooms: tuple[PlanRoom, ...]
    path: tuple[Point, ...]
    openings: tuple[PlanOpening, ...] = ()
    objects: tuple[PlanObject, ...] = ()
    name: str = "building"
    ceiling_height: float = number(2.6, 1.8, 12.0)
    drive: PlanDrive = field(default_factory=PlanDrive)
    camera: PlanCamera = field(default_factory=PlanCamera)
    lidar: PlanLidar = field(default_factory=PlanLidar)
    odometry: PlanOdometry = field(default_factory=PlanOdometry)
    look: PlanLook = field(default_factory=PlanLook)
    write_odometry: bool = True
    write_extrinsics: bool = False

    @staticmethod
    def from_dict(data: object) -> Plan:
        """From the object of a plan.json, checked; raises InputError."""
        from recon.simulate.check import check_plan

        plan = from_dict(Plan, data, "plan")
        check_plan(plan)
        return plan

    @staticmethod
    def from_json(path: Path) -> Plan:
        """Read and check a plan file; raises InputError, one line that names the file and the place in it."""
        text = read_text(Path(path))
        try:
            return Plan.from_dict(json.loads(text))
        except json.JSONDecodeError as error:
            raise InputError(f"{path}: is not JSON: {error}") from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def to_dict(self) -> dict[str, Any]:
        """The object of plan.json, every default written out."""
        return dict(to_dict(self))

    def to_json(self, path: Path) -> None:
        """Write the plan as JSON, atomically."""
        with atomic_path(Path(path)) as temporary:
            temporary.write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")
