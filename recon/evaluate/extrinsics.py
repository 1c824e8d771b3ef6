"""Estimated extrinsics against the true ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Pose3


@dataclass(frozen=True)
class ExtrinsicsErrors:
    """m and degrees: shift in the platform's x, y; height; whole rotation; tilt (of the vertical alone)."""

    x: float
    y: float
    height: float
    rotation: float
    tilt: float


def extrinsics_errors(estimate: Pose3, truth: Pose3) -> ExtrinsicsErrors:
    """Estimate minus truth; angles are unsigned."""
    x, y, z = estimate.translation - truth.translation
    turn = (np.trace(estimate.rotation @ truth.rotation.T) - 1) / 2
    tilt = estimate.rotation[2] @ truth.rotation[2]
    return ExtrinsicsErrors(float(x), float(y), float(z), _degrees(turn), _degrees(tilt))


def _degrees(cosine: float) -> float:
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
