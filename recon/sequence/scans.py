"""scans.npz: 2D LiDAR scans as arrays, and the checks that any source of scans goes through."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.sequence.sequence import Scans
from recon.sequence.table import check_increasing

REQUIRED = ("timestamps", "ranges", "angle_min", "angle_increment", "range_min", "range_max")
MAX_INTERVAL = 600.0
OPTIONAL = ("time_increment", "intensities")
DAMAGED = (ValueError, EOFError, OSError, KeyError, zipfile.BadZipFile, zlib.error, NotImplementedError)
"""What numpy and zipfile raise for archives that are cut off, overwritten or something else."""


def read_scans_npz(path: Path) -> Scans:
    """Scans of a scans.npz (FORMAT.md), read without pickle; beams turned counter-clockwise where they were not.

    Raises InputError for a missing, truncated or pickled file and for whatever `checked_scans` refuses.
    """
    arrays = _arrays(path)
    for name in REQUIRED:
        if name not in arrays:
            raise InputError(f"{path}: array {name} is missing")
    scalars = {name: _scalar(path, name, arrays[name]) for name in REQUIRED[2:]}
    time_increment = _scalar(path, "time_increment", arrays["time_increment"]) if "time_increment" in arrays else 0.0
    timestamps, ranges = arrays["timestamps"], arrays["ranges"]
    intensities = arrays.get("intensities")
    if timestamps.ndim != 1 or ranges.ndim != 2 or len(ranges) != len(timestamps):
        raise InputError(
            f"{path}: timestamps is {timestamps.shape} and ranges {ranges.shape}, expected (N,) and (N, beams)"
        )
    if intensities is not None and intensities.shape != ranges.shape:
        raise InputError(f"{path}: intensities is {intensities.shape}, expected the shape of ranges, {ranges.shape}")
    if intensities is not None:
        intensities = intensities.astype(np.float32)
    with np.errstate(over="ignore"):
        ranges = ranges.astype(np.float32)
    scans = Scans(
        timestamps.astype(np.float64), ranges, **scalars, time_increment=time_increment, intensities=intensities
    )
    return checked_scans(path, scans)


def checked_scans(path: Path, scans: Scans) -> Scans:
    """The scans, beams in counter-clockwise order, ranges of 0 m made nan (many scanners say 0 for "invalid").

    Raises InputError for no scans or beams, time stamps not finite, not increasing or not in seconds, negative ranges,
    no valid return at all, range limits that are none, and bearings that go round more than once.
    """
    ranges = scans.ranges
    if ranges.size == 0:
        raise InputError(f"{path}: empty sequence: {ranges.shape[0]} scans of {ranges.shape[1]} beams")
    check_increasing(path, scans.timestamps, "scan")
    interval = float(np.median(np.diff(scans.timestamps))) if len(scans) > 1 else 0.0
    if interval > MAX_INTERVAL:
        raise InputError(
            f"{path}: scans are {interval:g} s apart, expected under {MAX_INTERVAL:g} s (are they in seconds?)"
        )
    _check_bearings(path, scans)
    if not 0 <= scans.range_min < scans.range_max:
        raise InputError(
            f"{path}: range_min is {scans.range_min} and range_max {scans.range_max}, "
            "expected 0 <= range_min < range_max"
        )
    with np.errstate(invalid="ignore"):
        negative = np.argwhere(ranges < 0)
    if len(negative):
        scan, beam = negative[0]
        value = ranges[scan, beam]
        raise InputError(
            f"{path}: range of scan {scan}, beam {beam} is {value:g} m, expected >= 0, inf (no return) or nan (invalid)"
        )
    scans = _counter_clockwise(replace(scans, ranges=np.where(ranges == 0, np.float32(np.nan), ranges)))
    if not any(scans.valid(i).any() for i in range(len(scans))):
        raise InputError(f"{path}: no beam of any scan returned a range between range_min and range_max")
    return scans


def say_blind(scans: Scans, warnings: list[str]) -> None:
    """Says how many scans have no valid return."""
    blind = sum(not scans.valid(i).any() for i in range(len(scans)))
    if blind:
        warnings.append(f"{blind} of {len(scans)} scans have no valid return")


def _check_bearings(path: Path, scans: Scans) -> None:
    beams, step = scans.ranges.shape[1], scans.angle_increment
    if step == 0:
        raise InputError(f"{path}: angle_increment is 0, expected radians between beams")
    if abs(step) * (beams - 1) > 2 * np.pi * 1.02:
        raise InputError(
            f"{path}: {beams} beams of angle_increment {step:g} rad span "
            f"{np.degrees(abs(step) * (beams - 1)):.0f} deg, expected at most 360 (is the increment in radians?)"
        )
    if abs(scans.angle_min) > 4 * np.pi:
        raise InputError(f"{path}: angle_min is {scans.angle_min:g} rad, expected within +-2 pi (is it in radians?)")


def _counter_clockwise(scans: Scans) -> Scans:
    """Scanners mounted upside down count clockwise: beams are reversed, and with them the time between beams."""
    if scans.angle_increment > 0:
        return scans
    last = scans.ranges.shape[1] - 1
    return replace(
        scans,
        timestamps=scans.timestamps + last * scans.time_increment,
        ranges=np.ascontiguousarray(scans.ranges[:, ::-1]),
        angle_min=scans.angle_min + last * scans.angle_increment,
        angle_increment=-scans.angle_increment,
        time_increment=0.0 - scans.time_increment,
        intensities=None if scans.intensities is None else np.ascontiguousarray(scans.intensities[:, ::-1]),
    )


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The known arrays of an npz, numeric; anything else in it is not touched."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise InputError(f"{path}: is a single array, expected an npz archive")
            names = [name for name in (*REQUIRED, *OPTIONAL) if name in archive.files]
            arrays = {}
            for name in names:
                arrays[name] = _numeric(path, name, archive)
            return arrays
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (PermissionError, IsADirectoryError) as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except MemoryError:
        raise InputError(f"{path}: claims arrays larger than this machine's memory") from None
    except DAMAGED as error:
        if "allow_pickle" in str(error) or "pickle" in str(error):
            reason = "is no npz archive, or holds pickled objects, which are not read"
        else:
            reason = "is damaged or truncated, expected an npz archive"
        raise InputError(f"{path}: {reason}") from None


def _numeric(path: Path, name: str, archive: Any) -> NDArray[Any]:
    try:
        array = archive[name]
    except ValueError as error:
        if "pickle" in str(error):
            raise InputError(f"{path}: {name} holds pickled objects, which are not read; expected numbers") from None
        raise
    if array.dtype.kind not in "fiu":
        raise InputError(f"{path}: {name} has type {array.dtype}, expected numbers")
    return np.asarray(array)


def _scalar(path: Path, name: str, array: NDArray[Any]) -> float:
    if array.size != 1:
        raise InputError(f"{path}: {name} has shape {array.shape}, expected a scalar")
    value = float(array.reshape(()))
    if not np.isfinite(value):
        raise InputError(f"{path}: {name} is {value}, expected a finite number")
    return value
