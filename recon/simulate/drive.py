"""The drive: way points to planar poses over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array
from recon.simulate.plan import Plan, PlanDrive


@dataclass(frozen=True)
class Drive:
    """Straight legs joined by arcs (or turns on the spot), driven forwards at constant speed.

    knots: (K,) s from the start; each piece i between knots starts at poses[i] (plan frame) and turns by turns[i] rad
    over lengths[i] m.
    """

    knots: Array
    poses: Array
    lengths: Array
    turns: Array

    @property
    def duration(self) -> float:
        """Seconds from start to end."""
        return float(self.knots[-1])

    def at(self, times: Array) -> Array:
        """Poses (N, 3), plan frame, at `times` (N,) s from the start; exact, held at the ends."""
        t = np.clip(np.asarray(times, dtype=np.float64), 0.0, self.duration)
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.lengths) - 1)
        share = (t - self.knots[piece]) / np.diff(self.knots)[piece]
        start, turn, length = self.poses[piece], self.turns[piece] * share, self.lengths[piece] * share
        # chord of an arc: its length is length * sinc(turn / 2), its direction half the turn
        chord = length * np.sinc(turn / 2 / np.pi)
        heading = start[:, 2] + turn / 2
        x, y = start[:, 0] + chord * np.cos(heading), start[:, 1] + chord * np.sin(heading)
        yaw = (start[:, 2] + turn + np.pi) % (2 * np.pi) - np.pi
        return np.stack([x, y, yaw], axis=1)


def drive_path(plan: Plan) -> Drive:
    """The drive through the plan's way points: corners are rounded, U-turns made on the spot."""
    points = np.array(plan.path)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate([[True], step > 1e-6])]
    legs = np.diff(points, axis=0)
    lengths, headings = np.linalg.norm(legs, axis=1), np.arctan2(legs[:, 1], legs[:, 0])
    turns = (np.diff(headings) + np.pi) % (2 * np.pi) - np.pi
    cut = _tangents(lengths, turns, plan.drive.corner_radius)
    before, after = np.concatenate([[0.0], cut]), np.concatenate([cut, [0.0]])
    pieces: list[tuple[float, float]] = []
    for i, length in enumerate(lengths):
        pieces.append((float(length - before[i] - after[i]), 0.0))
        if i < len(turns) and turns[i] != 0.0:
            radius = cut[i] / np.tan(abs(turns[i]) / 2) if cut[i] > 0 else 0.0
            pieces.append((float(radius * abs(turns[i])), float(turns[i])))
    return _timed(points[0], float(headings[0]), [p for p in pieces if p[0] > 1e-9 or p[1] != 0.0], plan.drive)


def _tangents(lengths: Array, turns: Array, radius: float) -> Array:
    """How far before and after each corner its arc begins, m; 0 where the platform turns on the spot."""
    room = np.minimum(lengths[:-1], lengths[1:]) / 2
    sharp = np.abs(turns) > np.radians(150)
    wanted = radius * np.tan(np.minimum(np.abs(turns), np.radians(150)) / 2)
    return np.asarray(np.where(sharp, 0.0, np.minimum(wanted, room)))


def _timed(start: Array, heading: float, pieces: list[tuple[float, float]], settings: PlanDrive) -> Drive:
    lengths, turns = np.array([p[0] for p in pieces]), np.array([p[1] for p in pieces])
    seconds = np.maximum(lengths / settings.speed, np.abs(turns) / settings.turn_rate)
    poses = np.empty((len(pieces), 3))
    pose = np.array([start[0], start[1], heading])
    for i in range(len(pieces)):
        poses[i] = pose
        middle = pose[2] + turns[i] / 2
        chord = lengths[i] * np.sinc(turns[i] / 2 / np.pi)
        pose = pose + np.array([chord * np.cos(middle), chord * np.sin(middle), turns[i]])
    return Drive(np.concatenate([[0.0], np.cumsum(seconds)]), poses, lengths, turns)
