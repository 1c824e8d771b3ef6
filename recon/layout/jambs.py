"""Where the jambs of openings are, and how well that is known: the beams that end, pass and hit the reveal there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recon.geometry import Array
from recon.layout.beams import Aimed, Beams
from recon.layout.recess import DEPTH
from recon.model import Opening, Wall
from recon.plan import opening_span
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

SEARCHED = 0.25
"""m to either side of where an opening was found to end."""
SEEN = 0.5
"""m to either side from where beams are asked."""
FACE = 0.05
"""m before and behind a wall where beams ended at its face."""
LEAF = 0.15
"""m from a jamb: nearer there, returns may be of the frame."""
MIN_BEAMS = 8
"""On the face, from the leaf, and on either side within `CLOSE` of a jamb before it is placed."""
CLOSE = 0.1
NARROWEST = 0.4
"""m, of an opening whose jambs are looked for; one alone is moved by so much of half of it, at most:"""
INWARD = 0.8
CASING, MIN_CASING = 0.06, 20
"""m beside a jamb, where a casing may stand before the wall's face, and beams on it that tell by how much."""
MIN_SCATTER = 0.004
"""m, one standard deviation of returns from a face, at least ..."""
MAX_SCATTER = 0.02
"""... and at most."""
MAD = 1.4826
"""Standard deviation over the median absolute deviation of what is normally distributed."""
BEYOND = 4.0
"""Cost of a beam that ends anywhere behind: -log of one return's density over metres, against that on a surface ..."""
WRONG = 7.0
"""... and of one that ends where none should, as mixed and stray returns do."""
REVEALS = (0.0, 0.03, 0.045, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.4)
"""m, how deep the reveal of a hole may be."""
COARSE, FINE = 0.01, 0.0005
"""m between the places that are tried."""
FINE_REACH = 0.02
COARSE_BEAMS, FINE_BEAMS = 1000, 5000
"""Beams are thinned evenly beyond."""
TEMPER = 3.0
"""Beams that count as one: those of one scan share the errors of its pose."""
BLOCKS = 8
"""Parts of the time in which a jamb was seen; each is left out once."""
SHARED = 0.1
"""Error that all blocks share, in scatters: of poses and bearings."""


@dataclass(frozen=True)
class _Model:
    """What lies behind a wall's face beyond a jamb: a leaf `depth` m deep, or a hole with a reveal so deep."""

    scatter: float
    depth: float
    closed: bool

    def costs(self, places: Array, beams: Aimed) -> Array:
        """(P, n) -log likelihood of every beam with the jamb at `places` (P,) m, where the opening begins.

        A beam ends at the face before the jamb; after it at the reveal, where it slants to it, else at the leaf or
        anywhere behind.
        """
        inside = beams.along - places[:, None]
        slants = beams.slope < -1e-6
        reveal = np.where(slants, inside / np.where(slants, -beams.slope, 1.0), np.inf)
        behind = -beams.across
        solid = self._at(behind)
        if self.closed:
            entered = self._at(behind - np.minimum(reveal, self.depth))
        else:
            passed = np.where(behind < max(self.depth, 6 * self.scatter) - 3 * self.scatter, WRONG, BEYOND)
            hits = reveal < self.depth
            entered = np.where(hits, self._at(behind - np.where(hits, reveal, 0.0)), passed)
        return np.where(inside < 0, solid, entered)

    def _at(self, distance: Array) -> Array:
        """Cost of returns at distances from their surface."""
        return np.asarray(np.minimum(0.5 * (distance / self.scatter) ** 2, WRONG))


def with_jambs(
    openings: Sequence[Opening], walls: Sequence[Wall], trajectory: Trajectory, scans: Scans
) -> list[Opening]:
    """The openings with their ends where the beams beside them place the jambs, and `sigma_jambs`, the larger of both.

    Maximum likelihood over the beams aimed there: where a beam crosses the wall's face is known by its bearing, so
    that the last one that ended on the face and the first that went in bound the jamb, whatever the range noise.
    Where too few were aimed an end stays as it was found, and the sigma is None.
    """
    beams, named = Beams(trajectory, scans), {wall.id: wall for wall in walls}
    spans: dict[int, list[tuple[float, float]]] = {}
    for opening in openings:
        spans.setdefault(opening.wall, []).append(opening_span(opening, named[opening.wall]))
    out = []
    for opening in openings:
        wall = named[opening.wall]
        low, high = opening_span(opening, wall)
        floor = max([(b + low) / 2 for _, b in spans[wall.id] if b <= low], default=0.0)
        ceiling = min([(a + high) / 2 for a, _ in spans[wall.id] if a >= high], default=wall.length)
        closed, half = opening.type == "door" and not opening.open, (high - low) / 2
        found = [
            _jamb(beams.aimed(wall, max(low - SEEN, floor), low + min(SEEN, half)), low, 1.0, half, closed),
            _jamb(beams.aimed(wall, high - min(SEEN, half), min(high + SEEN, ceiling)), high, -1.0, half, closed),
        ]
        places = [end if jamb is None else jamb[0] for jamb, end in zip(found, (low, high), strict=True)]
        start, end = (wall.start + place * wall.direction for place in places)
        sigmas = [jamb[1] for jamb in found if jamb is not None]
        swapped = float((opening.end - opening.start) @ wall.direction) < 0
        ends = (end, start) if swapped else (start, end)
        sigma = max(sigmas) if len(sigmas) == 2 else None
        out.append(replace(opening, start=ends[0], end=ends[1], sigma_jambs=sigma))
    return out


def _jamb(beams: Aimed, end: float, way: float, half: float, closed: bool) -> tuple[float, float] | None:
    """Place (m along the wall) and sigma of the jamb found at `end`; way: 1 where the opening follows, else -1."""
    beams = Aimed((beams.along - end) * way, beams.across, beams.slope * way, beams.scan)
    face = (np.abs(beams.across) < FACE) & (beams.along < 0)
    if half < NARROWEST / 2 or np.count_nonzero(face) < MIN_BEAMS:
        return None
    middle = float(np.median(beams.across[face]))
    scatter = MAD * float(np.median(np.abs(beams.across[face] - middle)))
    scatter = min(max(scatter, MIN_SCATTER), MAX_SCATTER)
    beams = _from(beams, middle)
    beams = beams.only(beams.across < 3 * scatter)  # what ended before the wall says nothing of it
    reach = min(SEARCHED, INWARD * half)
    places = np.arange(-reach, reach, COARSE)
    models = _models(beams, scatter, closed)
    best, model = _first(places, models, _thinned(beams, COARSE_BEAMS))
    casing = (np.abs(beams.across) < FACE) & (beams.along > best - CASING) & (beams.along < best)
    if np.count_nonzero(casing) >= MIN_CASING:
        proud = float(np.median(beams.across[casing]))
        beams, model = _from(beams, proud), replace(model, depth=model.depth + proud)
    beams = _thinned(beams.only(np.abs(beams.along - best) < SEARCHED), FINE_BEAMS)
    sides = [np.count_nonzero((beams.along > a) & (beams.along < a + CLOSE)) for a in (best - CLOSE, best)]
    if min(sides) < MIN_BEAMS or not places[0] < best < places[-1]:
        return None
    place, sigma = _refined(np.arange(best - FINE_REACH, best + FINE_REACH, FINE), model, beams)
    return end + way * place, sigma


def _from(beams: Aimed, across: float) -> Aimed:
    """The beams where they cross, and counted from, a plane `across` m before the wall's."""
    return Aimed(beams.along - across * beams.slope, beams.across - across, beams.slope, beams.scan)


def _models(beams: Aimed, scatter: float, closed: bool) -> list[_Model]:
    """What the opening may be."""
    leaf = (beams.along > LEAF) & (beams.across < -DEPTH[0]) & (beams.across > -DEPTH[1])
    if closed and np.count_nonzero(leaf) >= MIN_BEAMS:
        return [_Model(scatter, -float(np.median(beams.across[leaf])), True)]
    return [_Model(scatter, depth, False) for depth in REVEALS]


def _first(places: Array, models: list[_Model], beams: Aimed) -> tuple[float, _Model]:
    """The likeliest place and model."""
    sums = [model.costs(places, beams).sum(axis=1) for model in models]
    k = int(np.argmin([cost.min() for cost in sums]))
    return float(places[np.argmin(sums[k])]), models[k]


def _refined(places: Array, model: _Model, beams: Aimed) -> tuple[float, float]:
    """Mean place and its standard deviation: of the likelihood, the blocks of time (jackknife) and what they share."""
    costs = model.costs(places, beams)
    scans, scan = np.unique(beams.scan, return_inverse=True)
    block = scan * BLOCKS // len(scans)
    parts = np.stack([costs[:, block == k].sum(axis=1) for k in range(BLOCKS)])
    place, spread = _moments(places, parts.sum(axis=0))
    without = np.array([_moments(places, parts.sum(axis=0) - part)[0] for part in parts])
    jackknife = (BLOCKS - 1) / BLOCKS * float(((without - without.mean()) ** 2).sum())
    return place, float(np.sqrt(spread**2 + jackknife + (SHARED * model.scatter) ** 2))


def _moments(places: Array, costs: Array) -> tuple[float, float]:
    """Mean and standard deviation of the place."""
    weight = np.exp((costs.min() - costs) / TEMPER)
    mean = float(weight @ places / weight.sum())
    return mean, float(np.sqrt(weight @ (places - mean) ** 2 / weight.sum()))


def _thinned(beams: Aimed, most: int) -> Aimed:
    return beams.only(slice(None, None, max(1, int(np.ceil(len(beams) / most)))))
