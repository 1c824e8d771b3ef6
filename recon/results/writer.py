"""Writes the result folder (FORMAT.md, "Result folder")."""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cloud import CLOUD, ply_of
from recon.config_file import to_toml
from recon.errors import OutputError
from recon.layout_json import layout_to_json
from recon.model import Face, Model
from recon.occupancy import save_occupancy
from recon.results.accuracy import write_accuracy
from recon.results.metrics import metrics
from recon.results.pictures import write_overlays
from recon.results.record import load_record
from recon.results.sources import write_sources
from recon.sequence.extrinsics import write_extrinsics
from recon.sequence.tum import write_planar, write_tum

if TYPE_CHECKING:
    from recon.pipeline import Build

PNG_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1]


def save_result(build: Build, folder: Path, outputs: Sequence[Path] = ()) -> None:
    """Write everything beside `folder`, then put it in the place of what was there; the report links to `outputs`.

    Raises OutputError when `folder` is something else than a result folder or cannot be written.
    """
    if folder.exists() and not (folder.is_dir() and ((folder / "layout.json").is_file() or not any(folder.iterdir()))):
        raise OutputError(f"{folder}: is no result folder of recon, expected one or nothing there")
    from recon.report import report
    from recon.results.photos import write_photos

    fresh = folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:8]}")
    try:
        fresh.mkdir()
        _write(build, fresh, [os.path.relpath(path.absolute(), folder.absolute()) for path in outputs])
        write_photos(build, fresh)
        (fresh / "report.html").write_text(report(load_record(fresh, build.model)), encoding="utf-8")
        _replace(folder, fresh)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _replace(folder: Path, fresh: Path) -> None:
    """Put `fresh` in the place of `folder`; the old one is removed last and comes back when that fails."""
    if not folder.exists():
        fresh.rename(folder)
        return
    old = folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:8]}.old")
    folder.rename(old)
    try:
        fresh.rename(folder)
    except OSError:
        old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _write(build: Build, folder: Path, outputs: Sequence[str]) -> None:
    _write_json(folder / "layout.json", layout_to_json(build.model.layout))
    write_planar(folder / "trajectory.txt", build.estimate.trajectory, "platform frame in the map frame")
    write_accuracy(folder, build.estimate)
    if build.model.occupancy is not None:
        save_occupancy(build.model.occupancy, folder)
    if build.model.cloud is not None:
        (folder / CLOUD).write_bytes(ply_of(build.model.cloud))
    if build.calibration is not None:
        pose = build.calibration.platform_from_camera
        write_extrinsics(folder / "extrinsics.yaml", pose, f"{build.calibration.source} by recon")
    (folder / "config.toml").write_text(to_toml(build.config), encoding="utf-8")
    _write_model(folder, build.model)
    _write_cameras(build, folder)
    write_overlays(build, folder)
    _write_json(folder / "metrics.json", {**metrics(build), "outputs": [Path(name).as_posix() for name in outputs]})


def _write_cameras(build: Build, folder: Path) -> None:
    """camera_trajectory.txt: every image that has a pose."""
    images = build.sequence.images
    rows = [(i, pose) for i, pose in enumerate(build.map_from_camera) if pose is not None]
    if images is None or not rows:
        return
    stamps = images.timestamps[[i for i, _ in rows]]
    positions = np.array([pose.translation for _, pose in rows])
    quaternions = np.array([pose.quaternion_xyzw() for _, pose in rows])
    comment = "camera optical frame in the map frame"
    write_tum(folder / "camera_trajectory.txt", stamps, positions, quaternions, comment)


def _write_model(folder: Path, model: Model) -> None:
    """textures/ and model.json: faces as they are, so that exports need no image."""
    (folder / "textures").mkdir()
    with ThreadPoolExecutor() as pool:  # packing pictures needs no interpreter
        list(pool.map(lambda face: _write_pictures(folder, face), model.faces))
    faces = [_face_to_json(face) for face in model.faces]
    notes = {"notes": list(model.notes), "picture_notes": list(model.picture_notes)}
    _write_json(folder / "model.json", {"version": 1, "name": model.name, **notes, "faces": faces})


def _write_pictures(folder: Path, face: Face) -> None:
    """The texture, and the image that each of its texels is from."""
    if face.texture is not None:
        _write_image(folder / "textures" / f"{face.name}.png", face.texture[:, :, ::-1])
    if face.sources is not None:
        write_sources(folder, face.name, face.sources)


def _face_to_json(face: Face) -> dict[str, Any]:
    return {
        "name": face.name,
        "kind": face.kind,
        "ref": face.ref,
        "texture": None if face.texture is None else f"textures/{face.name}.png",
        "metres_per_texel": face.metres_per_texel,
        "seen_fraction": face.seen_fraction,
        "vertices": face.vertices.tolist(),
        "triangles": face.triangles.tolist(),
        "uv": face.uv.tolist(),
        **({} if face.opening is None else {"opening": face.opening}),
    }


def _write_image(path: Path, bgr: NDArray[Any]) -> None:
    ok, data = cv2.imencode(".png", bgr, PNG_FAST)
    if not ok:
        raise OutputError(f"{path}: the picture could not be encoded")
    path.write_bytes(data.tobytes())


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
