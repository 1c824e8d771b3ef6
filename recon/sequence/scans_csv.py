"""scans.csv: scans in long form, one return a row, `timestamp,angle,range`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array
from recon.sequence.scans import checked_scans
from recon.sequence.sequence import Scans
from recon.sequence.table import check_increasing, read_table

Indices = NDArray[np.int64]

MAX_BEAMS = 16384


def read_scans_csv(path: Path) -> Scans:
    """Scans of a scans.csv, laid on one grid of bearings.

    The step between beams is the median step inside scans, fitted to all bearings. Where they lie on that grid, a beam
    without a row had no return (inf). A scanner whose bearings wander (a spinning one with a free-running motor) gets a
    grid eight times finer, and cells between its beams are invalid (nan), not empty space. Range limits are those of
    the returns: the file does not say them. Raises InputError as `checked_scans`, for damaged rows and for rows of one
    scan that are not together.
    """
    rows = read_table(path, "timestamp angle range", separator=",", header=True)
    if len(rows) == 0:
        raise InputError(f"{path}: empty sequence: no row below the header")
    if not np.isfinite(rows[:, :2]).all():
        bad = int(np.flatnonzero(~np.isfinite(rows[:, :2]).all(axis=1))[0])
        raise InputError(f"{path}: row {bad} has a timestamp or angle that is not finite: {rows[bad].tolist()}")
    new_scan = np.concatenate([[True], np.diff(rows[:, 0]) != 0])
    timestamps = rows[new_scan, 0]
    check_increasing(path, timestamps, "scan")
    scan = np.cumsum(new_scan).astype(np.int64) - 1
    angle_min, step, on_grid = _fit_grid(path, scan, rows[:, 1])
    fill = np.inf if on_grid else np.nan
    if not on_grid:
        step /= 8
    beam = np.rint((rows[:, 1] - angle_min) / step).astype(np.int64)
    if beam.max() >= MAX_BEAMS:
        raise InputError(f"{path}: bearings need {beam.max() + 1} beams of {step:g} rad, expected at most {MAX_BEAMS}")
    return checked_scans(path, _gridded(timestamps, scan, beam, rows[:, 2], angle_min, step, fill))


def _fit_grid(path: Path, scan: Indices, angles: Array) -> tuple[float, float, bool]:
    """Smallest bearing, step (rad) and whether all bearings are within a quarter step of angle_min + k * step."""
    low, span = float(angles.min()), float(np.ptp(angles))
    steps = np.abs(np.diff(angles))[np.diff(scan) == 0]
    steps = steps[(steps > 1e-7) & (steps < np.pi)]
    if len(steps) == 0:
        raise InputError(f"{path}: no scan has two rows with different angles")
    step = float(np.median(steps))
    if span / step > 2 * np.pi / 1e-7:
        raise InputError(f"{path}: angles span {span:g} rad, expected at most 2 pi")
    low, step = _refined(angles, low, step)
    residual = angles - low - step * np.rint((angles - low) / step)
    on_grid = bool(np.quantile(np.abs(residual), 0.99) < 0.1 * step)
    first = int(np.rint((angles.min() - low) / step))
    return low + first * step, step, on_grid


def _refined(angles: Array, low: float, step: float) -> tuple[float, float]:
    """Least-squares start and step, rad.

    Printed angles are rounded. Beams are numbered over a stretch that doubles as the step gets surer: over the whole
    sweep at once the rounding would add up to a miscount.
    """
    reach = 8.0
    while True:
        near = angles[angles - low < reach * step]
        k = np.rint((near - low) / step)
        if np.ptp(k) > 0:
            (fitted_low, fitted), *_ = np.linalg.lstsq(np.stack([np.ones_like(k), k], axis=1), near, rcond=None)
            if abs(fitted - step) < 0.2 * step:
                low, step = float(fitted_low), float(fitted)
        if len(near) == len(angles):
            return low, step
        reach *= 2


def _gridded(
    timestamps: Array, scan: Indices, beam: Indices, ranges: Array, angle_min: float, step: float, fill: float
) -> Scans:
    grid = np.full((len(timestamps), int(beam.max()) + 1), fill, dtype=np.float32)
    order = np.argsort(-np.nan_to_num(ranges, nan=np.inf), kind="stable")  # the nearest return of a cell stays
    grid[scan[order], beam[order]] = ranges[order]
    returns = ranges[np.isfinite(ranges) & (ranges > 0)]
    low, high = (float(returns.min()), float(returns.max())) if len(returns) else (0.0, 1.0)
    return Scans(timestamps, grid, angle_min, step, np.nextafter(low, 0) * 0.999, np.nextafter(high, np.inf) * 1.001)
