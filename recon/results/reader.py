"""Reads a result folder back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cloud import CLOUD, load_cloud
from recon.errors import InputError
from recon.files import read_text
from recon.geometry import Array
from recon.layout_json import layout_from_json
from recon.model import Face, Layout, Model
from recon.occupancy import load_occupancy
from recon.results.accuracy import read_sigmas
from recon.results.sources import read_sources
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar


def load_model(folder: Path) -> Model:
    """The model of a result folder, as it was built.

    Raises InputError when the folder, layout.json, model.json or a texture is missing or damaged.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, expected a result folder of recon build")
    layout = load_layout(folder)
    path = folder / "model.json"
    content = read_json(path)
    try:
        faces = tuple(_face(folder, item) for item in content["faces"])
        notes, pictures = (tuple(map(str, found)) for found in (content["notes"], content.get("picture_notes", ())))
        model = Model(str(content["name"]), layout, faces, notes, picture_notes=pictures)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
    trajectory, sigmas = load_drive(folder)
    occupancy, cloud = load_occupancy(folder), load_cloud(folder / CLOUD)
    return replace(model, trajectory=trajectory, pose_sigmas=sigmas, occupancy=occupancy, cloud=cloud)


def load_drive(folder: Path) -> tuple[Trajectory | None, Array]:
    """The platform's trajectory and the standard deviations (N, 3) or (0, 3) of its poses.

    Raises InputError where a file is damaged."""
    path = folder / "trajectory.txt"
    trajectory = read_planar(path) if path.exists() else None
    sigmas = read_sigmas(folder)[:, 1:]
    if trajectory is not None and len(sigmas) not in (0, len(trajectory)):
        count = len(trajectory)
        raise InputError(f"{folder}: {len(sigmas)} rows in pose_sigmas.txt, expected {count} as in {path.name}")
    return trajectory, sigmas


def load_layout(folder: Path) -> Layout:
    """layout.json of a result folder; InputError as `load_model`."""
    path = folder / "layout.json"
    return layout_from_json(read_json(path), str(path))


def load_survey(folder: Path) -> tuple[float, float, float] | None:
    """survey_from_map (x, y in m, yaw in rad) of a result that was tied to surveyed points, None of any other.

    Raises InputError where metrics.json is damaged.
    """
    path = folder / "metrics.json"
    content = read_json(path) if path.exists() else {}
    try:
        control = content.get("control")
        if control is None:
            return None
        x, y, yaw = (float(v) for v in control["survey_from_map"])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
    return x, y, yaw


def load_residuals(folder: Path) -> dict[str, float]:
    """Residuals by kind of factor from a result's metrics.json, empty without one; InputError where it is damaged."""
    path = folder / "metrics.json"
    content = read_json(path) if path.exists() else {}
    try:
        return {str(name): float(value) for name, value in content.get("residuals", {}).items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None


def read_json(path: Path) -> Any:
    """Content of a JSON file; InputError where it is missing or damaged."""
    try:
        return json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: is no JSON: {error.msg}") from None


def _face(folder: Path, item: dict[str, Any]) -> Face:
    texture = None if item["texture"] is None else _texture(folder / item["texture"])
    return Face(
        item["name"],
        item["kind"],
        int(item["ref"]),
        np.array(item["vertices"], dtype=np.float64).reshape(-1, 3),
        np.array(item["triangles"], dtype=np.int64).reshape(-1, 3),
        np.array(item["uv"], dtype=np.float64).reshape(-1, 2),
        texture,
        float(item["metres_per_texel"]),
        float(item["seen_fraction"]),
        sources=read_sources(folder, item["name"]),
        opening=None if item.get("opening") is None else int(item["opening"]),
    )


def _texture(path: Path) -> NDArray[np.uint8]:
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if image is None:
        raise InputError(f"{path}: is no picture, expected a PNG of recon build")
    return np.asarray(image[:, :, ::-1], dtype=np.uint8)
