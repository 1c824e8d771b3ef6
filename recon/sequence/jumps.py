"""Odometry that starts anew or leaps in mid-drive: wheels do neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import between2, compose2, inverse2
from recon.sequence.sequence import Sequence
from recon.sequence.text import plural
from recon.sequence.trajectory import Trajectory

LEAP, SPEED = 0.5, 5.0
"""m and m/s: a step that is larger and faster than this was not driven."""
SPIN, RATE = 1.0, 15.0
"""rad and rad/s: nor was such a turn."""


def without_jumps(sequence: Sequence) -> Sequence:
    """The sequence with the steps of its odometry that nothing can drive taken out, and said.

    What was driven during such a step is lost; scan matching finds it.
    """
    if sequence.odometry is None:
        return sequence
    odometry, jumps = _mended(sequence.odometry)
    if not len(jumps):
        return sequence
    first = float(sequence.odometry.timestamps[jumps[0]])
    warning = f"the odometry jumps {plural(len(jumps), 'time')}, first at {first:.3f} s: those steps are left out"
    return replace(sequence, odometry=odometry, warnings=(*sequence.warnings, warning))


def _mended(odometry: Trajectory) -> tuple[Trajectory, NDArray[np.intp]]:
    """The odometry with its jumps taken out, and the numbers of the poses before them."""
    poses = odometry.poses.copy()
    steps, elapsed = between2(poses[:-1], poses[1:]), np.maximum(np.diff(odometry.timestamps), 1e-9)
    way, turn = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    leaps = (way > LEAP) & (way > SPEED * elapsed)
    jumps = np.flatnonzero(leaps | ((turn > SPIN) & (turn > RATE * elapsed)))
    for before in jumps:
        poses[before + 1 :] = compose2(poses[before], compose2(inverse2(poses[before + 1]), poses[before + 1 :]))
    return Trajectory(odometry.timestamps, poses), jumps
