"""What a result folder tells of a build, read back: the model, and how it came about."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recon.errors import InputError
from recon.geometry import Array
from recon.model import Model
from recon.results.accuracy import read_closures, read_scan_residuals
from recon.results.reader import load_drive, load_model, read_json
from recon.sequence.extrinsics import read_extrinsics


@dataclass(frozen=True)
class Record:
    """A build as its result folder tells of it.

    seconds: of every stage. residuals, scan_residuals: as in `MapEstimate`. closures: (L, 2) s, time stamps of two
    scans of one place. calibration, tape, control: as in metrics.json. camera_height: m, None without a camera.
    outputs: files exported by the build, relative to the folder.
    """

    folder: Path
    model: Model
    seconds: dict[str, float]
    warnings: tuple[str, ...]
    residuals: dict[str, float]
    scan_residuals: dict[str, Array]
    closures: Array
    calibration: dict[str, Any] | None
    camera_height: float | None
    tape: list[dict[str, Any]]
    control: dict[str, Any] | None
    outputs: tuple[str, ...]


def load_record(folder: Path, model: Model | None = None) -> Record:
    """Of a result folder; `model`: what is in it, where it is at hand. Raises InputError where anything is damaged."""
    if model is None:
        model = load_model(folder)
    else:  # with the decimals of the files: a page written again is the same
        trajectory, sigmas = load_drive(folder)
        model = replace(model, trajectory=trajectory, pose_sigmas=sigmas)
    path, extrinsics = folder / "metrics.json", folder / "extrinsics.yaml"
    content = read_json(path)
    height = float(read_extrinsics(extrinsics).translation[2]) if extrinsics.is_file() else None
    try:
        return Record(
            folder,
            model,
            {str(name): float(value) for name, value in content["seconds"].items()},
            tuple(map(str, content["warnings"])),
            {str(name): float(value) for name, value in content["residuals"].items()},
            read_scan_residuals(folder),
            read_closures(folder),
            content["calibration"],
            height,
            list(content["tape"]),
            content["control"],
            tuple(map(str, content.get("outputs", ()))),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
