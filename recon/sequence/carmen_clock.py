"""Time in CARMEN logs, whose stamps may be cut, wrapped or missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

Mask = NDArray[np.bool_]

WRAPS = (2**32 * 1e-6, 2**32 * 1e-3, 1e9, 2.0**31, 2.0**32)
"""s: where counters of seconds, milliseconds and microseconds start again."""
LONGEST_STEP = 600.0
"""s between two records, over a wrap."""
DEAD = 0.2
"""Share of records whose stamp is not after the last one's: more, and the stamps need repair."""
DECREASING, DISTINCT = 0.05, 0.05
"""Stamps that were only rounded decrease in fewer steps, and have more different values a record."""
USUAL_INTERVAL = 0.2
"""s between records whose stamps tell nothing at all: the laser scanners of such logs give five scans a second."""


def repaired_times(
    stamps: Sequence[tuple[float, float]], is_scan: Mask, with_odometry: Mask, warnings: list[str]
) -> tuple[Array, bool]:
    """Times (N,) s of scans and odometry in the order of a log, and whether they had to be made up.

    stamps: of the message and of the logger; the latter stand in where they are better. with_odometry (N,): scans of
    the instant of the record before. Stamps that wrapped are unwrapped, rounded ones spread between the rounded values,
    senseless ones replaced by regular time. A few wrong ones stay, for the caller to leave out.
    """
    columns = np.array(stamps, dtype=np.float64).reshape(-1, 2)
    both = [_unwrapped(columns[:, i]) for i in (0, 1)]
    dead = [_share(np.diff(times[is_scan]) <= 0) for times, _ in both]
    best = 1 if dead[1] <= DEAD < dead[0] else 0
    times, wraps = both[best]
    if best == 1:
        warnings.append("the messages' time stamps do not increase: those of the logger are used")
    if wraps:
        warnings.append(f"the time stamps start again {wraps} time{'s' if wraps > 1 else ''}: time was made continuous")
    repaired = _spread(times, is_scan)
    made_up = repaired is None or bool((repaired != times).any())
    if repaired is None:
        times = _regular(times, is_scan, with_odometry, warnings)
    elif made_up:
        warnings.append("the time stamps are rounded: records are spread evenly between them")
        times = repaired
    following = np.flatnonzero(with_odometry[1:]) + 1
    times[following] = times[following - 1]
    return times, made_up


def _share(bad: Mask) -> float:
    return float(np.mean(bad)) if len(bad) else 0.0


def _unwrapped(times: Array) -> tuple[Array, int]:
    """Stamps with a counter's period added at each place where it started again, and how often it did."""
    steps = np.diff(times)
    periods = np.zeros(len(steps))
    for period in WRAPS:
        after = steps + period
        periods = np.where((steps < -period / 2) & (after >= 0) & (after < LONGEST_STEP), period, periods)
    return times + np.concatenate([[0.0], np.cumsum(periods)]), int((periods > 0).sum())


def _spread(times: Array, is_scan: Mask) -> Array | None:
    """Times with records of one rounded stamp spread up to the next; as they are where stamps are fine.

    None where the stamps of scans or odometry make no sense.
    """
    out = times.copy()
    for stream in (is_scan, ~is_scan):
        own = times[stream]
        steps = np.diff(own)
        if _share(steps <= 0) <= DEAD:
            continue
        first = np.flatnonzero(np.concatenate([[True], steps > 0]))
        if _share(steps < 0) > DECREASING or len(first) < max(3.0, DISTINCT * len(own)):
            return None
        last = own[first[-1]] + np.median(np.diff(own[first]))  # where the last stamp's records end
        out[stream] = np.interp(np.arange(len(own)), [*first, len(own)], [*np.maximum.accumulate(own[first]), last])
    return out


def _regular(times: Array, is_scan: Mask, with_odometry: Mask, warnings: list[str]) -> Array:
    """Equal steps between records of the more frequent kind, those of the other kind in between.

    The span is that of the stamps where it makes sense for as many records.
    """
    index = np.arange(len(times))
    ticking = is_scan if 2 * is_scan.sum() >= len(is_scan) else ~is_scan
    tick = np.maximum(np.cumsum(ticking) - 1, 0)
    since = index - np.maximum.accumulate(np.where(ticking, index, 0))
    slots = tick + np.where(with_odometry, 0.0, since / np.bincount(tick)[tick])
    known = times[np.isfinite(times) & (times > 0)]
    span = float(np.quantile(known, 0.99) - np.quantile(known, 0.01)) / 0.98 if len(known) else 0.0
    interval = span / max(int(ticking.sum()) - 1, 1)
    if 0.005 <= interval <= 10:
        warnings.append(f"the time stamps do not increase: records are taken as {interval:.3g} s apart")
    else:
        interval = USUAL_INTERVAL
        warnings.append(f"the time stamps tell nothing: records are taken as {interval:g} s apart")
    return np.asarray(slots * interval)
