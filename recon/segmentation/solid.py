"""Heights of things that fill their footprint."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array
from recon.segmentation.crop import Crop

STEP = 0.02
"""m between heights."""
CORE = 0.4
"""m: below are pixels from which a thing's colours are first learned."""
HANGING = 0.5
"""m: things may begin this high above the floor (on a bracket, on thin legs)."""
GROUNDED = 0.1
"""m: what begins lower stands on the floor."""
DOUBT = 0.3
"""Evidence that a pixel must show on average to be a thing's."""
LEAST_EVIDENCE = 0.5
"""Average evidence of all pixels of a thing."""
FEW = 4
"""Pixels of one height in one crop."""
ROUNDS = 4


def solid_span(crops: list[Crop], top: float) -> tuple[float, float] | None:
    """Heights, m, between which the pixels of a prism over the core look unlike the background; None when none do.

    The colours of the thing are learned from what is inside, in turns with the span (as GrabCut: Rother et al. 2004).
    """
    weights: list[Array] = [(crop.lowest < CORE).astype(float) for crop in crops]
    span = None
    for _ in range(ROUNDS):
        if not any(weight.any() for weight in weights):
            return None
        evidence = learned(crops, weights)
        span = _best(crops, evidence, top)
        if span is None:
            return None
        weights = [(c.lowest < span[1]) / (1 + np.exp(-e - 0.5)) for c, e in zip(crops, evidence, strict=True)]
    return span


def learned(crops: list[Crop], weights: list[Array]) -> list[Array]:
    """Evidence (h, w) in every crop, from the colours of all crops and, as exposures differ, of each by itself."""
    own = [crop.colours(weight) for crop, weight in zip(crops, weights, strict=True)]
    shown = [colours for colours, weight in zip(own, weights, strict=True) if weight.any()]
    shared = np.asarray(np.mean(shown, axis=0))
    return [crop.evidence(0.5 * (colours + shared)) for crop, colours in zip(crops, own, strict=True)]


def _best(crops: list[Crop], evidence: list[Array], top: float) -> tuple[float, float] | None:
    """The span whose prism gathers most evidence; every crop counts the same at every height."""
    bins = int(np.ceil(top / STEP))
    total, seen = np.zeros(bins), np.zeros(bins)
    for crop, found in zip(crops, evidence, strict=True):
        inside = crop.lowest < top
        level = np.minimum(crop.lowest[inside] / STEP, bins - 1).astype(np.int64)
        count = np.bincount(level, minlength=bins)
        shown = count >= FEW
        total[shown] += (np.bincount(level, found[inside], minlength=bins)[:bins] / np.maximum(count, 1))[shown]
        seen += shown
    mean = total / np.maximum(seen, 1)
    gain = np.where(seen > 0, mean - DOUBT, 0.0)
    best, low, high = 0.0, 0, 0
    for first in range(int(HANGING / STEP)):
        sums = np.cumsum(gain[first:])
        last = int(sums.argmax())
        if sums[last] > best:
            best, low, high = float(sums[last]), first, first + last + 1
    shown = seen[low:high] > 0
    if not shown.any() or float(mean[low:high][shown].mean()) < LEAST_EVIDENCE:
        return None
    return (low * STEP if low > GROUNDED / STEP else 0.0), high * STEP
