"""Heights of things that fill their footprint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array
from recon.segmentation.crop import NOVEL, STRAY, Crop

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
FEW_CROPS = 2
"""Crops that show a height, before what they show is told."""
ROUNDS = 4


@dataclass(frozen=True)
class SolidFit:
    """span: m, between which heights a thing shows. shown: (n,) mean evidence for it at heights `STEP` apart, nan where
    fewer than `FEW_CROPS` crops see any without another thing in the way."""

    span: tuple[float, float]
    shown: Array


def solid_span(crops: list[Crop], top: float) -> tuple[float, float] | None:
    """Heights, m, between which the pixels of a prism over the core look unlike the background; None when none do."""
    fit = fit_solid(crops, top)
    return None if fit is None else fit.span


def fit_solid(crops: list[Crop], top: float) -> SolidFit | None:
    """The span of a thing and how sure pixels are of it at every height up to `top` m; None where none look like it.

    The colours of the thing are learned from what is inside, in turns with the span (as GrabCut: Rother et al. 2004).
    """
    weights: list[Array] = [(crop.lowest < CORE).astype(float) for crop in crops]
    span = None
    for _ in range(ROUNDS):
        if not any(weight.any() for weight in weights):
            return None
        evidence = learned(crops, weights)
        span = _best(*_by_height(crops, evidence, top))
        if span is None:
            return None
        used, weights = weights, [_belonging(c, e, span[1]) for c, e in zip(crops, evidence, strict=True)]
    return None if span is None else SolidFit(span, _shown(crops, used, top))


def _belonging(crop: Crop, evidence: Array, top: float) -> Array:
    """Weights (h, w) of pixels of a thing so high."""
    return np.asarray((crop.lowest < top) / (1 + np.exp(-evidence - 0.5)))


def _shown(crops: list[Crop], weights: list[Array], top: float) -> Array:
    """Mean evidence by height, to which colours that are neither the thing's nor the background's add nothing."""
    mean, seen = _by_height(crops, learned(crops, weights, STRAY), top, clear=True)
    return np.where(seen >= FEW_CROPS, mean, np.nan)


def learned(crops: list[Crop], weights: list[Array], novel: float = NOVEL) -> list[Array]:
    """Evidence (h, w) in every crop, from the colours of all crops and, as exposures differ, of each by itself."""
    own = [crop.colours(weight, novel) for crop, weight in zip(crops, weights, strict=True)]
    shown = [colours for colours, weight in zip(own, weights, strict=True) if weight.any()]
    shared = np.asarray(np.mean(shown, axis=0))
    return [crop.evidence(0.5 * (colours + shared)) for crop, colours in zip(crops, own, strict=True)]


def _by_height(crops: list[Crop], evidence: list[Array], top: float, clear: bool = False) -> tuple[Array, Array]:
    """Mean evidence (n,) at heights `STEP` apart, and how many crops (n,) show any; every crop counts the same.

    clear: only pixels that can show no other thing.
    """
    bins = int(np.ceil(top / STEP))
    total, seen = np.zeros(bins), np.zeros(bins)
    for crop, found in zip(crops, evidence, strict=True):
        inside = (crop.lowest < top) & (crop.clear | (not clear))
        level = np.minimum(crop.lowest[inside] / STEP, bins - 1).astype(np.int64)
        count = np.bincount(level, minlength=bins)
        shown = count >= FEW
        total[shown] += (np.bincount(level, found[inside], minlength=bins)[:bins] / np.maximum(count, 1))[shown]
        seen += shown
    return total / np.maximum(seen, 1), seen


def _best(mean: Array, seen: Array) -> tuple[float, float] | None:
    """The span whose prism gathers most evidence."""
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
