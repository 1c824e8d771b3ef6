"""A drive through a room of 6 m x 4 m, written as ROS bags of all kinds by `rosbags`' writers."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from recon.geometry import Array, Pose3, apply2
from recon.sequence.open import open_sequence
from recon.sequence.sequence import Sequence
from recon.sequence.topics import Topics

Mounting = tuple[tuple[float, float, float], tuple[float, float, float, float]]
HALF = np.array([3.0, 2.0])
"""m: the room is twice as large, its middle is the origin of the odometry frame."""
START = 1_700_000_000_000_000_000
"""ns"""
SCAN_PERIOD, IMAGE_PERIOD = 100_000_000, 150_000_000
WIDTH, HEIGHT = 32, 24
OPTICAL = (0.5, -0.5, 0.5, -0.5)
"""Quaternion xyzw of a camera's optical frame on a body with x forward."""
TF_TYPES = "geometry_msgs/TransformStamped[] transforms\n"
CAMERA: Mounting = ((0.12, 0.03, 0.5), OPTICAL)
KINDS = ("bag", "bag.bz2", "bag.lz4", "db3", "mcap", "mcap.zstd", "db3.message", "mcap.file")


@dataclass
class Drive:
    """What is recorded: scans of `beams` from the laser, odometry of base_link, images, mountings.

    laser: base_link_from_laser; camera: base_link_from_camera (translation, quaternion xyzw). floor: height of
    base_link above base_footprint, None where there is no such frame. change: is given each message and its topic
    before it is written, and may change it or return False to leave it out.
    """

    scans: int = 20
    images: int = 0
    beams: int = 90
    laser: Mounting = ((0.0, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))
    camera: Mounting | None = None
    floor: float | None = None
    encoding: str = "bgr8"
    odometry: str = "topic"
    change: Callable[[str, Any], bool | None] = field(default=lambda _topic, _message: None)

    def base(self, time: int) -> Array:
        """odom_from_base [x, y, yaw] at `time`, ns."""
        s = (time - START) * 1e-9 / 10
        return np.array([1.5 * np.sin(3 * s), 0.8 * np.cos(2 * s) - 0.3, 0.4 + 2 * s])

    def times(self) -> NDArray[np.int64]:
        return START + SCAN_PERIOD * np.arange(self.scans)

    def ranges(self, time: int) -> NDArray[np.float32]:
        """What the laser sees at `time`: exact distances to the walls."""
        world = Pose3.from_planar(self.base(time)) @ pose(self.laser)
        angles = self.bearings()
        rays = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) @ world.rotation.T
        with np.errstate(divide="ignore"):
            hits = np.where(rays[:, :2] > 0, HALF - world.translation[:2], -HALF - world.translation[:2]) / rays[:, :2]
        return np.asarray(hits.min(axis=1), dtype=np.float32)

    def bearings(self) -> Array:
        """(beams,) rad, in the laser's own frame: three quarters of a turn."""
        return np.linspace(-0.75 * np.pi, 0.75 * np.pi, self.beams)

    def picture(self, index: int) -> NDArray[np.uint8]:
        """Image `index`: BGR, smooth, another one each time."""
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
        channels = [40 + 5 * x + 3 * index, 200 - 4 * y - index, 90 + 3 * x - 2 * y]
        return np.asarray(np.clip(np.stack(channels, axis=2), 0, 255), dtype=np.uint8)


def pose(mounting: Mounting) -> Pose3:
    return Pose3.from_quaternion(*mounting)


def upside_down(x: float, y: float, yaw: float) -> Mounting:
    """Rolled by half a turn."""
    q = (Rotation.from_euler("z", yaw) * Rotation.from_euler("x", np.pi)).as_quat()
    return (x, y, 0.2), tuple(float(v) for v in q)  # type: ignore[return-value]


def turned(x: float, y: float, yaw: float) -> Mounting:
    return (x, y, 0.2), (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))


class _Messages:
    """Messages of a drive in one ROS version."""

    def __init__(self, ros1: bool) -> None:
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.ros1 = ros1
        self.tf = "tf2_msgs/msg/TFMessage"
        if ros1:
            self.store.register(get_types_from_msg(TF_TYPES, self.tf))

    def make(self, name: str, **fields: Any) -> Any:
        return self.store.types[name](**fields)

    def header(self, time: int, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        extra = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **extra)

    def vector(self, name: str, values: Any) -> Any:
        fields = "xyzw"[: len(values)]
        return self.make(f"geometry_msgs/msg/{name}", **{k: float(v) for k, v in zip(fields, values, strict=True)})

    def transform(self, time: int, parent: str, child: str, mounting: Mounting) -> Any:
        translation, quaternion = self.vector("Vector3", mounting[0]), self.vector("Quaternion", mounting[1])
        transform = self.make("geometry_msgs/msg/Transform", translation=translation, rotation=quaternion)
        header = self.header(time, parent)
        return self.make("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=transform)

    def scan(self, drive: Drive, time: int) -> Any:
        angles = drive.bearings()
        return self.make(
            "sensor_msgs/msg/LaserScan",
            header=self.header(time, "laser"),
            angle_min=float(angles[0]),
            angle_max=float(angles[-1]),
            angle_increment=float(angles[1] - angles[0]),
            time_increment=0.0,
            scan_time=0.1,
            range_min=0.05,
            range_max=30.0,
            ranges=drive.ranges(time),
            intensities=np.zeros(0, np.float32),
        )

    def odometry(self, time: int, at: Array) -> Any:
        q = (0.0, 0.0, np.sin(at[2] / 2), np.cos(at[2] / 2))
        here = self.make(
            "geometry_msgs/msg/Pose",
            position=self.vector("Point", (*at[:2], 0.0)),
            orientation=self.vector("Quaternion", q),
        )
        zero = self.vector("Vector3", (0, 0, 0))
        twist = self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(time, "odom"),
            child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=here, covariance=np.zeros(36)),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )

    def camera_info(self, time: int) -> Any:
        names = ("D", "K", "R", "P") if self.ros1 else ("d", "k", "r", "p")
        k = np.array([30.0, 0, 15.5, 0, 30, 11.5, 0, 0, 1])
        p = np.array([28.0, 0, 15.5, 0, 0, 28, 11.5, 0, 0, 0, 1, 0])
        values = (np.array([-0.1, 0.02, 0.0005, -0.0004, 0]), k, np.eye(3).ravel(), p)
        roi = self.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(time, "camera"),
            height=HEIGHT,
            width=WIDTH,
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=roi,
            **dict(zip(names, values, strict=True)),
        )

    def image(self, drive: Drive, time: int, index: int) -> Any:
        picture, header = drive.picture(index), self.header(time, "camera")
        if drive.encoding in ("jpeg", "png"):
            data = cv2.imencode(f".{drive.encoding}", picture)[1].ravel()
            return self.make(
                "sensor_msgs/msg/CompressedImage", header=header, format=f"bgr8; {drive.encoding} compressed", data=data
            )
        pixels = encoded(picture, drive.encoding)
        step = pixels.nbytes // HEIGHT + 4  # padded rows, as cameras send them
        data = np.zeros((HEIGHT, step), np.uint8)
        data[:, :-4] = pixels.view(np.uint8).reshape(HEIGHT, -1)
        return self.make(
            "sensor_msgs/msg/Image",
            header=header,
            height=HEIGHT,
            width=WIDTH,
            encoding=drive.encoding,
            is_bigendian=0,
            step=step,
            data=data.ravel(),
        )


def encoded(bgr: NDArray[np.uint8], encoding: str) -> NDArray[Any]:
    """A picture (H, W, 3) as the samples of a ROS encoding."""
    if encoding.startswith("bayer_"):
        order = ["bgr".index(letter) for letter in encoding.removeprefix("bayer_")[:4]]
        out = np.zeros(bgr.shape[:2], np.uint8)
        for i, channel in enumerate(order):
            out[i // 2 :: 2, i % 2 :: 2] = bgr[i // 2 :: 2, i % 2 :: 2, channel]
        return out
    grey = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY))
    alpha = np.full((*grey.shape, 1), 255, np.uint8)
    return np.ascontiguousarray(
        {
            "mono8": grey,
            "mono16": grey.astype("<u2") * 16,  # a camera of 12 bits
            "bgr8": bgr,
            "rgb8": bgr[:, :, ::-1],
            "bgra8": np.concatenate([bgr, alpha], axis=2),
            "rgba8": np.concatenate([bgr[:, :, ::-1], alpha], axis=2),
        }[encoding]
    )


def messages(drive: Drive, make: _Messages) -> Iterator[tuple[int, str, str, Any]]:
    """(time of recording, topic, type, message), in order of time; recorded 3 ms after the header's time."""
    late = 3_000_000
    first = int(drive.times()[0])
    static = [make.transform(first, "base_link", "laser", drive.laser)]
    if drive.camera is not None:
        static.append(make.transform(first, "base_link", "camera", drive.camera))
    if drive.floor is not None:
        static.append(
            make.transform(first, "base_footprint", "base_link", ((0.0, 0.0, drive.floor), (0.0, 0.0, 0.0, 1.0)))
        )
    yield first, "/tf_static", make.tf, SimpleNamespace(transforms=static)
    out: list[tuple[int, str, str, Any]] = []
    for time in (int(t) for t in drive.times()):
        at = drive.base(time)
        if drive.odometry == "topic":
            out.append((time, "/odom", "nav_msgs/msg/Odometry", make.odometry(time, at)))
        elif drive.odometry == "tf":
            q = (0.0, 0.0, float(np.sin(at[2] / 2)), float(np.cos(at[2] / 2)))
            item = make.transform(time, "odom", "base_link", ((float(at[0]), float(at[1]), 0.0), q))
            out.append((time, "/tf", make.tf, SimpleNamespace(transforms=[item])))
        out.append((time, "/scan", "sensor_msgs/msg/LaserScan", make.scan(drive, time)))
    compressed = drive.encoding in ("jpeg", "png")
    for index in range(drive.images):
        time = START + IMAGE_PERIOD * index
        name = "CompressedImage" if compressed else "Image"
        topic = "/cam/image_raw/compressed" if compressed else "/cam/image_raw"
        out.append((time, "/cam/camera_info", "sensor_msgs/msg/CameraInfo", make.camera_info(time)))
        out.append((time, topic, f"sensor_msgs/msg/{name}", make.image(drive, time, index)))
    for time, topic, kind, message in sorted(out, key=lambda item: item[0]):
        yield time + late, topic, kind, message


def write_bag(drive: Drive, folder: Path, kind: str = "bag", cut: bool = False) -> Path:
    """The drive as a bag of one of KINDS in `folder`; with `cut` without the index that is written at the end."""
    make = _Messages(kind.startswith("bag"))
    writer, path = _writer(folder, kind)
    writer.open()
    connections: dict[str, Any] = {}
    for time, topic, message_type, message in messages(drive, make):
        if drive.change(topic, message) is False:
            continue
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, message_type, typestore=make.store)
        if message_type == make.tf:
            message = make.make(make.tf, transforms=message.transforms)
        serialize = make.store.serialize_ros1 if make.ros1 else make.store.serialize_cdr
        writer.write(connections[topic], time, serialize(message, message_type))
    writer.abort() if cut else writer.close()
    return path


def _writer(folder: Path, kind: str) -> tuple[Writer1 | Writer2, Path]:
    suffix, _, how = kind.partition(".")
    if suffix == "bag":
        path = folder / "drive.bag"
        writer = Writer1(path)
        if how:
            writer.set_compression(Writer1.CompressionFormat[how.upper()])
        return writer, path
    plugin = StoragePlugin.SQLITE3 if suffix == "db3" else StoragePlugin.MCAP
    writer2 = Writer2(folder / "drive", version=9, storage_plugin=plugin)
    modes = {"zstd": CompressionMode.STORAGE, "message": CompressionMode.MESSAGE, "file": CompressionMode.FILE}
    if how:
        writer2.set_compression(modes[how], CompressionFormat.ZSTD)
    return writer2, folder / "drive"


def read(drive: Drive, kind: str = "bag", topics: Topics | None = None) -> Sequence:
    """The drive by way of a bag that is gone when this returns."""
    with tempfile.TemporaryDirectory() as folder:
        return open_sequence(write_bag(drive, Path(folder), kind), topics)


def off_walls(sequence: Sequence) -> float:
    """m: how far the farthest return lies from the room's walls, scans laid out by the odometry."""
    assert sequence.odometry is not None
    poses = sequence.odometry.at(sequence.scans.timestamps)
    worst = 0.0
    for i in range(len(sequence.scans)):
        points = apply2(poses[i], sequence.scans.points(i))
        assert len(points) == sequence.scans.ranges.shape[1]
        beyond = np.abs(points) - HALF
        worst = max(worst, float(np.abs(beyond.max(axis=1)).max()))
    return worst
