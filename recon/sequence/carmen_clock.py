"""Time in CARMEN logs, whose stamps may be cut, wrapped or missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

WRAPS = (2**32 * 1e-6, 2**32 * 1e-3, 1e9, 2.0**31, 2.0**32)
"""s: where counters of seconds, milliseconds and microseconds start again."""
LONGEST_STEP = 600.0
"""s between two records, over a wrap."""
DEAD = 0.2
"""Share of scans whose stamp is not after the last one's: more, and the stamps are worth nothing."""
USUAL_INTERVAL = 0.2
"""s between records whose stamps tell nothing at all: the laser scanners of such logs give five scans a second."""


def repaired_times(
    stamps: Sequence[tuple[float, float]], is_scan: NDArray[np.bool_], warnings: list[str], together: NDArray[np.bool_]
) -> Array:
    """Times (N,) s of scans and odometry in the order of a log.

    stamps: of the message and of the logger; the latter stand in where they are better. is_scan (N,). together (N,):
    records of the instant of the one before. Stamps that wrapped are unwrapped; where too many do not increase, time is
    made regular. A few wrong ones stay, for the caller to leave out.
    """
    columns = np.array(stamps, dtype=np.float64).reshape(-1, 2)
    both = [_unwrapped(columns[:, i]) for i in (0, 1)]
    dead = [_share_dead(times[is_scan]) for times, _ in both]
    best = 1 if dead[1] < min(dead[0], DEAD) and dead[0] > DEAD else 0
    times, wraps = both[best]
    if dead[best] > DEAD:
        return _regular(times, is_scan, warnings, together)
    if best == 1:
        warnings.append("the messages' time stamps do not increase: those of the logger are used")
    if wraps:
        warnings.append(f"the time stamps start again {wraps} time{'s' if wraps > 1 else ''}: time was made continuous")
    return times


def _share_dead(times: Array) -> float:
    return float(np.mean(np.diff(times) <= 0)) if len(times) > 1 else 0.0


def _unwrapped(times: Array) -> tuple[Array, int]:
    """Stamps with a counter's period added at each place where it started again, and how often it did."""
    steps = np.diff(times)
    periods = np.zeros(len(steps))
    for period in WRAPS:
        after = steps + period
        periods = np.where((steps < -period / 2) & (after >= 0) & (after < LONGEST_STEP), period, periods)
    return times + np.concatenate([[0.0], np.cumsum(periods)]), int((periods > 0).sum())


def _regular(times: Array, is_scan: NDArray[np.bool_], warnings: list[str], together: NDArray[np.bool_]) -> Array:
    """Equal steps between records of the more frequent kind, those of the other kind in between.

    The span is that of the stamps where it makes sense for as many records.
    """
    ticking = is_scan if 2 * is_scan.sum() >= len(is_scan) else ~is_scan
    tick = np.cumsum(ticking) - 1
    since = np.arange(len(tick)) - np.maximum.accumulate(np.where(ticking, np.arange(len(tick)), 0))
    in_tick = np.bincount(np.maximum(tick, 0), minlength=1)[np.maximum(tick, 0)]
    slots = tick + np.where(together, 0.0, since / in_tick)
    known = times[np.isfinite(times) & (times > 0)]
    span = float(np.quantile(known, 0.99) - np.quantile(known, 0.01)) / 0.98 if len(known) else 0.0
    interval = span / max(int(ticking.sum()) - 1, 1)
    if not 0.005 <= interval <= 10:
        interval = USUAL_INTERVAL
        warnings.append(f"the time stamps tell nothing: records are taken as {interval:g} s apart")
    else:
        warnings.append(f"the time stamps do not increase: records are taken as {interval:.3g} s apart")
    return np.asarray(slots * interval)
