"""Search for the camera pose that the lines of all images support best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.calibration.refine import HEIGHT, Refinement, refine
from recon.calibration.support import CalibrationFrames, score, support
from recon.calibration.voting import CELL, MAX_YAW, blind_starts, vote, yaw_density
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

REFINEMENT = (1.0, 1.0, 0.7, 0.5, 0.5, 0.5)  # of the tolerance
MAX_ROUNDS = 3
MAX_STARTS = 3
NEXT_PLANE, LOWEST_PLANE = 0.02, 1.3  # m below the plane found (a baseboard's edge, a chair rail) to look for the floor
HIGHEST_MIRRORED = 0.5  # m above the plane found: what a shining floor may show once more
PLANE_PEAK, PLANE_EVIDENCE = 0.3, 0.4  # of the score and the evidence of the plane found
PLANE_FRACTION = 0.5  # of the share of projected feet that the plane found explains, in a band of distance
MAX_SILENT = 0.15  # of all projected feet, in bands with less
FAINT_PLANE = 0.35  # m below the plane found, at most, to a floor that few lines show: baseboards are no higher
FAINT_SHARE, FAINT_CONTRAST = 0.1, 2.0  # of the feet that lines explain there, above that around it, and over it
FAINT_AROUND = 0.12  # m of height
FAINT_BAND, FAINT_LEVEL = 0.08, 0.5  # bands with this share of the feet explain that part of what all explain
DOUBT = 0.5  # of the way down to such a floor, one standard deviation: it may as well be a reflection
FAINT_SHIFT = 0.02  # m that the camera may seem to stand elsewhere
SETTLED = 0.9  # share of the images whose feet the lines explain, from which nothing better is looked for around it
NEAR, NEAR_HEIGHT = 0.48, 0.09  # m to each side, and up and down, of the places looked at around a pose ...
NEAR_STEP, NEAR_HEIGHT_STEP = 0.04, 0.03  # ... and m between them
NEAR_IMAGES, NEAR_PLACES = 24, 10  # images by which they are ranked, and how many of the best are refined
RIVAL = 0.85  # of the best evidence, from which other places count as possible
BORDERS = 0.01 * np.arange(8, 80)  # m before a wall's foot, of borders of the floor
BANDS = (0.8, 1.1, 1.4, 2.0, 3.0, 5.0)  # m from the camera to the wall
MIN_FOOT = 80.0  # pixels of foot in an image before it counts
MIN_FRACTION = 0.4  # of the feet in an image that lines must explain: the paper's inlier threshold


@dataclass(frozen=True)
class Found:
    """A refined pose and its evidence, in standard deviations above chance.

    faint: the height is of few lines, all else of a plane above the floor that many show.
    """

    evidence: float
    refined: Refinement
    faint: bool = False


class PoseSearch:
    """Voting and refinement around starting poses, over all images.

    vertical: unit vector (3,) in the camera frame, pointing down, and its sigma (rad). tolerance: pixels, of a line
    from a projected foot.
    """

    def __init__(
        self, frames: CalibrationFrames, camera: Camera, vertical: tuple[Array, float], tolerance: float
    ) -> None:
        self._frames, self._camera, self._vertical, self._tolerance = frames, camera, vertical, tolerance
        self._density = yaw_density(frames, camera, vertical[0])

    def refine(self, pose: Pose3) -> Found | None:
        """The pose refined from here; None where too few lines match."""
        tolerances = tuple(self._tolerance * f for f in REFINEMENT)
        refined = refine(self._frames, self._camera, pose, self._vertical, tolerances)
        return None if refined is None else Found(self._evidence(refined), refined)

    def counts(self, refined: Refinement) -> Array:
        """(F, 2) explained and projected pixels an image."""
        pose, offset = refined.platform_from_camera, refined.foot_offset
        return support(self._frames, self._camera, pose, self._tolerance, None, offset)

    def share(self, refined: Refinement) -> float:
        """Share of the images with a foot in view whose feet the lines explain."""
        counts = self.counts(refined)
        seen = counts[:, 1] > MIN_FOOT
        return float(np.mean(counts[seen, 0] > MIN_FRACTION * counts[seen, 1])) if seen.any() else 0.0

    def around(self, start: Pose3, best: Found | None) -> Found | None:
        """The best found by voting around `start`, then around what that gave, as long as it betters `best`."""
        for _ in range(MAX_ROUNDS):
            voted = vote(self._frames, self._camera, start, self._vertical[0], self._density, self._tolerance)
            better = self._best([start, *voted], best)
            if better is best or better is None:
                break
            best, start = better, better.refined.platform_from_camera
        return best

    def blind(self, best: Found | None) -> Found | None:
        """As `around`, from every likely yaw and height."""
        posed = []
        for start in blind_starts(self._vertical[0], self._density):
            posed += vote(self._frames, self._camera, start, self._vertical[0], self._density, self._tolerance)[:2]
        values = [score(support(self._frames, self._camera, pose, 2 * self._tolerance)) for pose in posed]
        for i in np.argsort(values, kind="stable")[::-1][:MAX_STARTS]:
            best = self.around(posed[i], best)
        return best

    def settled(self, found: Found) -> Found:
        """The best of all places around the one found, where many images disagree with that.

        With few images, or of walls that are much alike, votes crowd beside the right place. What has nearly as much
        evidence as the best may be the place, too: the covariance holds how far those lie apart.
        """
        if self.share(found.refined) >= SETTLED:
            return found
        return with_rivals([found, *filter(None, map(self.refine, self._near(found.refined.platform_from_camera)))])

    def _near(self, pose: Pose3) -> list[Pose3]:
        """Places around a pose of the same rotation, the NEAR_PLACES of which lines support best, one a hill."""
        from scipy.ndimage import maximum_filter

        side = np.arange(-round(NEAR / NEAR_STEP), round(NEAR / NEAR_STEP) + 1) * NEAR_STEP
        height = np.arange(-round(NEAR_HEIGHT / NEAR_HEIGHT_STEP), round(NEAR_HEIGHT / NEAR_HEIGHT_STEP) + 1)
        steps = np.stack(np.meshgrid(side, side, height * NEAR_HEIGHT_STEP, indexing="ij"), axis=-1)
        poses = [Pose3(pose.rotation, pose.translation + step) for step in steps.reshape(-1, 3)]
        some = self._frames.thinned(NEAR_IMAGES)
        values = np.array([score(support(some, self._camera, p, 2 * self._tolerance)) for p in poses])
        grid = values.reshape(steps.shape[:3])
        hills = np.flatnonzero((grid == maximum_filter(grid, 3)).ravel())
        return [poses[i] for i in hills[np.argsort(-values[hills], kind="stable")[:NEAR_PLACES]]]

    def lowest_plane(self, found: Found) -> Found:
        """What was found, or a higher camera where lines support a plane below.

        A baseboard's upper edge or a chair rail runs parallel to the wall's foot all around the building and explains
        the LiDAR as well as the foot; the floor is the lowest plane that lines support. A border on the floor supports
        one only at some distances: the scale that suits near walls does not suit far ones. A shining floor shows the
        baseboard once more below it. On a carpet the foot itself shows in a few places only; there a plane no lower
        than baseboards are high is the floor if it stands out from the planes around it, near and far alike.
        """
        pose, offset = found.refined.platform_from_camera, found.refined.foot_offset
        lower = 0.01 * np.arange(-round(100 * HIGHEST_MIRRORED), round(100 * LOWEST_PLANE) + 2)
        poses = [Pose3(pose.rotation, pose.translation + np.array([0.0, 0.0, z])) for z in lower]
        counts = (support(self._frames, self._camera, p, self._tolerance, None, offset) for p in poses)
        totals = np.array([c.sum(axis=0) for c in counts])
        values = np.array([score(c[None]) for c in totals])
        every = _peaks(values)
        peak = every & (values > PLANE_PEAK * values[np.abs(lower) < 0.025].max())
        faint = every & (lower <= FAINT_PLANE) & _stands_out(totals[:, 0] / np.maximum(totals[:, 1], 1.0))
        for i in np.flatnonzero((peak | faint) & (lower > NEXT_PLANE))[::-1]:
            if is_reflection(i, np.flatnonzero(peak if peak[i] else every), values):
                continue
            candidate = self.refine(poses[i])
            if candidate is None:
                continue
            if peak[i] and self._is_floor(candidate, found):
                return candidate
            if faint[i] and self._is_faint_floor(candidate, found):
                return self._lowered(found, poses[i])
        return found

    def _lowered(self, found: Found, pose: Pose3) -> Found:
        """What was found with its height alone from the lines that the plane at `pose` has."""
        tolerances = tuple(self._tolerance * f for f in REFINEMENT)
        refined = refine(self._frames, self._camera, pose, self._vertical, tolerances, HEIGHT)
        if refined is None:
            return found
        covariance = found.refined.covariance + refined.covariance
        # which of the two planes is the floor is not beyond doubt
        lowered = refined.platform_from_camera.translation[2] - found.refined.platform_from_camera.translation[2]
        covariance[5, 5] += (DOUBT * lowered) ** 2
        refined = replace(refined, covariance=covariance, foot_offset=found.refined.foot_offset)
        return Found(found.evidence, refined, faint=True)

    def _is_floor(self, candidate: Found, found: Found) -> bool:
        """Whether a plane below has evidence, and its lines explain near walls and far ones alike."""
        if candidate.evidence < PLANE_EVIDENCE * found.evidence:
            return False
        mine, theirs = self._by_distance(candidate.refined), self._by_distance(found.refined)
        share, usual = (c[:, 0] / np.maximum(c[:, 1], 1.0) for c in (mine, theirs))
        silent = share < PLANE_FRACTION * usual
        return bool(mine[silent, 1].sum() < MAX_SILENT * mine[:, 1].sum())

    def _is_faint_floor(self, candidate: Found, found: Found) -> bool:
        """Whether a plane below that few lines show has the camera where it was, and shows near and far alike.

        And better than any border, so far before all walls, on the floor found would show.
        """
        moved = candidate.refined.platform_from_camera.translation - found.refined.platform_from_camera.translation
        if np.linalg.norm(moved[:2]) > FAINT_SHIFT:
            return False
        bands = self._by_distance(candidate.refined)
        seen = bands[bands[:, 1] > FAINT_BAND * bands[:, 1].sum()]
        explained, projected = bands.sum(axis=0)
        if len(seen) < 2 or (seen[:, 0] / seen[:, 1] <= FAINT_LEVEL * explained / projected).any():
            return False
        pose = found.refined.platform_from_camera
        borders = (support(self._frames, self._camera, pose, self._tolerance, None, b) for b in BORDERS)
        values = np.array([score(c) for c in borders])
        return score(self.counts(candidate.refined)) > max(values[_peaks(values)], default=-np.inf)

    def _by_distance(self, refined: Refinement) -> Array:
        """(BANDS, 2) explained and projected pixels of the feet of walls at growing distance from the camera."""
        walls, pose = self._frames.segments, refined.platform_from_camera
        along = walls[:, 1] - walls[:, 0]
        from_camera = pose.translation[:2] - walls[:, 0]
        across = along[:, 0] * from_camera[:, 1] - along[:, 1] * from_camera[:, 0]
        band = np.digitize(np.abs(across) / np.linalg.norm(along, axis=1), BANDS)
        return np.array(
            [
                support(
                    self._frames.with_segments(band == b),
                    self._camera,
                    pose,
                    self._tolerance,
                    None,
                    refined.foot_offset,
                ).sum(axis=0)
                for b in range(len(BANDS) + 1)
            ]
        )

    def _best(self, poses: list[Pose3], best: Found | None) -> Found | None:
        for pose in poses:
            found = self.refine(pose)
            if found is not None and (best is None or found.evidence > best.evidence):
                best = found
        return best

    def _evidence(self, refined: Refinement) -> float:
        """Scores at the tolerance and at half of it: the tight one tells parallel lines apart."""
        pose, offset = refined.platform_from_camera, refined.foot_offset
        tolerances = (self._tolerance, self._tolerance / 2)
        return sum(score(support(self._frames, self._camera, pose, t, None, offset)) for t in tolerances)


def with_rivals(places: list[Found]) -> Found:
    """The best of the places, its covariance widened by those that have nearly as much evidence."""
    best = max(places, key=lambda place: place.evidence)
    weights = np.array([max(p.evidence / best.evidence - RIVAL, 0.0) / (1 - RIVAL) for p in places])
    away = np.array([p.refined.platform_from_camera.translation for p in places])
    away = away - best.refined.platform_from_camera.translation
    # the same place found from several starts counts once
    _, first = np.unique(np.round(away / CELL).astype(np.int64), axis=0, return_index=True)
    weights, away = weights[first], away[first]
    covariance = best.refined.covariance.copy()
    covariance[3:, 3:] += np.einsum("p,pi,pj->ij", weights, away, away) / max(float(weights.sum()), 1.0)
    return replace(best, refined=replace(best.refined, covariance=covariance))


def _peaks(values: Array) -> NDArray[np.bool_]:
    """(N,) local maxima."""
    out = np.zeros(len(values), np.bool_)
    out[1:-1] = (values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])
    return out


def _stands_out(share: Array) -> NDArray[np.bool_]:
    """(N,) whether planes 1 cm apart, of which lines explain these shares (N,), do so better than those around."""
    from scipy.ndimage import median_filter

    around = median_filter(share, size=2 * round(100 * FAINT_AROUND) + 1, mode="nearest")
    return np.asarray((share - around > FAINT_SHARE) & (share > FAINT_CONTRAST * around))


def is_reflection(plane: int, peaks: NDArray[np.int64], values: Array) -> bool:
    """Whether plane number `plane` is as far below one of the `peaks` as another is above it, both better supported.

    values: (N,) support of planes at even steps, each lower than the one before.
    """
    better = peaks[(peaks < plane) & (values[peaks] > values[plane])]
    mirrored = 2 * better - plane
    return bool(np.any(np.abs(mirrored[:, None] - better) <= 1))


def distinct(poses: list[Pose3]) -> list[Pose3]:
    """The first MAX_STARTS poses that differ in rotation by more than the search around one covers."""
    kept: list[Pose3] = []
    for pose in poses:
        cosines = [(np.trace(pose.rotation @ k.rotation.T) - 1) / 2 for k in kept]
        if all(c < np.cos(MAX_YAW) for c in cosines):
            kept.append(pose)
    return kept[:MAX_STARTS]
