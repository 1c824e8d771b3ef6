"""Time stamps of logs: which records to keep when some of the stamps are wrong."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.geometry import Array
from recon.sequence.text import plural

OTHER_CLOCK = 5.0
"""s: streams whose stamps differ more from the time of recording are on clocks of their own."""


class Stamp(NamedTuple):
    """Times of one message, ns: in its header (0: not filled in) and of its recording."""

    header: int
    recorded: int


def increasing(timestamps: ArrayLike) -> NDArray[np.bool_]:
    """(N,) the records to keep so that finite time stamps (N,) strictly increase, as many as possible.

    A longest increasing subsequence: one stamp that jumps ahead costs one record, not all that follow it.
    """
    t = np.asarray(timestamps, dtype=np.float64)
    finite = np.isfinite(t)
    if finite.all() and (np.diff(t) > 0).all():
        return np.ones(len(t), dtype=bool)
    tails: list[float] = []  # smallest last stamp of an increasing run of each length
    last: list[int] = []  # the record that it belongs to
    before = np.full(len(t), -1)
    for i in (int(i) for i in np.flatnonzero(finite)):
        length = bisect_left(tails, t[i])
        before[i] = last[length - 1] if length else -1
        if length == len(tails):
            tails.append(float(t[i]))
            last.append(i)
        else:
            tails[length], last[length] = float(t[i]), i
    keep = np.zeros(len(t), dtype=bool)
    record = last[-1] if last else -1
    while record >= 0:
        keep[record] = True
        record = int(before[record])
    return keep


def header_times(stamps: Sequence[Stamp], topic: str, warnings: list[str]) -> tuple[Array, float]:
    """Times (N,) s of a topic's messages by their headers, and how far these are ahead of the recording, s.

    Where a header has no time, the time of recording stands in, moved by what lies between the two for the others.
    """
    header = np.array([s.header for s in stamps], dtype=np.int64)
    recorded = np.array([s.recorded for s in stamps], dtype=np.int64)
    empty = header <= 0
    ahead = int(np.median((header - recorded)[~empty])) if not empty.all() else 0
    if empty.any():
        count = plural(int(empty.sum()), "header")
        warnings.append(f"{count} of {topic} without a time: that of recording is used")
    header[empty] = recorded[empty] + ahead
    return np.asarray(header * 1e-9, dtype=np.float64), ahead * 1e-9


def on_one_clock(stamps: Sequence[Stamp], topic: str, scans_ahead: float, warnings: list[str]) -> Array:
    """Times (N,) s of a topic's messages on the scans' clock, whose stamps are `scans_ahead` s of the recording's."""
    times, ahead = header_times(stamps, topic, warnings)
    shift = scans_ahead - ahead
    if abs(shift) < OTHER_CLOCK:
        return times
    warnings.append(f"{topic} is stamped by another clock than the scans: moved by {shift:.1f} s, by the recording")
    return np.asarray(times + shift)
