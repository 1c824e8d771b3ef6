"""Scan matching: the platform's trajectory from its scans, with odometry or without."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2, compose2, rotation2, wrap_angle
from recon.lidar.clock import OdometryClock, odometry_clock
from recon.lidar.cloud import Cloud, make_cloud
from recon.lidar.correlative import PRIOR_WEIGHT, search
from recon.lidar.doubt import GOOD_OVERLAP, match_doubt, match_spread, slides, surprise
from recon.lidar.icp import Alignment, align
from recon.lidar.keyframes import Keyframes
from recon.lidar.localmap import LocalMap
from recon.lidar.motion import Motion, OdometryQuality, predict, scan_velocities
from recon.lidar.noise import with_noise
from recon.lidar.points import scan_points
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

KERNEL = 0.15
"""m, width of the kernel at the first iteration."""
KERNEL_SIGMAS = 3.0
LAST_KERNEL = 0.03
"""m, width of the kernel at the last iteration (`KERNEL_SIGMAS` times the range noise where that is more)."""
MIN_OVERLAP = 0.3
"""Share below which matching failed."""
MIN_MATCHED = 8
"""Points on the map below which matching failed."""
LAG_SCANS = 300
"""Scans from which the lag of the odometry is found."""
LAG_STEP = 0.5
"""s: scans farther apart are not matched without odometry to find its lag."""
STEADY_TURN = np.radians(3.0)
"""rad since the last scan up to which a scan makes a good keyframe: while turning fast, scans are distorted."""
LOST = 3
"""Failures in a row after which the map is begun anew where the platform is thought to be."""
MAX_SURPRISE = 16.0
"""Squared normalised distance from the prediction above which an alignment is in doubt."""
REACH = 3.0
"""Standard deviations of the prediction that the search covers."""
SMALLEST_WINDOW = (0.3, np.radians(10.0))
LARGEST_WINDOW = (2.0, np.pi)
"""m, rad: bounds of the search."""
PLACES = 4
"""Places that a scan in doubt is aligned from without odometry: grids are too coarse to choose between them."""
MARGIN = 0.03
"""Share of a scan's points by which one of these must be better than the place next to the prediction."""
FLOOR = (0.001, 0.0003)
"""m, rad: standard deviations of a relative motion that always stay."""
LEVEL = 400.0
"""1/m^2: information to which points are levelled to see whether the scan fits better so."""
RECOVERY = (1.0, np.radians(60.0))
"""m, rad: standard deviations that replace the prediction where nothing lies near it (clocks and wheels do slip)."""
RECOVERED_OVERLAP = 0.6
"""Share of a scan's points on the map from which a place far from the prediction is believed."""


@dataclass(frozen=True)
class ScanMatching:
    """What scan matching gives for N scans.

    trajectory: poses at every scan's timestamp in the map frame (the platform frame at the first scan).
    covariances: (N-1, 3, 3) of each relative motion [x, y, yaw] (m, m, rad) in the frame of the earlier pose, the
        odometry or constant velocity that was fused included.
    scan_covariances: (N-1, 3, 3) the same from the scans alone, for those who weigh odometry themselves: where scans
        say nothing (along a bare corridor, failed matches) the deviations are metres.
    failed: (N,) scans that fitted no map: their motion is the prediction.
    velocities: (N, 3) m/s, m/s, rad/s of the platform in its own frame after each scan's timestamp, with which
        `extract_segments` takes out motion distortion.
    odometry: the given odometry on the scanner's clock (its lag taken off the timestamps), None without odometry.
    clock: that lag.
    """

    trajectory: Trajectory
    covariances: Array
    scan_covariances: Array
    failed: NDArray[np.bool_]
    velocities: Array
    odometry: Trajectory | None = None
    clock: OdometryClock | None = None


def match_scans(scans: Scans, odometry: Trajectory | None, config: LidarConfig) -> ScanMatching:
    """Poses of all scans, each aligned with the map of the keyframes before it.

    Odometry, where it covers the scans, is the prediction and is fused with a weight that is learnt along the way;
    its lag is found first, from some scans, and at last from all. Scans with a `time_increment` are matched again
    without their motion distortion.
    """
    config = with_noise(scans, config)
    given = odometry
    if odometry is not None and len(scans) > 2:
        odometry = _on_scan_clock(scans, odometry, config)
    velocities = None
    if scans.time_increment > 0:
        # two passes find the velocities that the last one takes out; the first has a guess at most
        velocities = np.zeros((len(scans), 3)) if odometry is None else scan_velocities(scans, odometry)
        for _ in range(2 if odometry is None else 1):
            velocities = scan_velocities(scans, _Matcher(scans, odometry, config, velocities).run().trajectory)
    found = _Matcher(scans, odometry, config, velocities).run()
    if given is None:
        return found
    clock = odometry_clock(found.trajectory, given)
    return replace(found, odometry=clock.on_scan_clock(given), clock=clock)


def _on_scan_clock(scans: Scans, odometry: Trajectory, config: LidarConfig) -> Trajectory:
    """The odometry without its lag, which the first scans show; matched without it, if they are near one another."""
    first = replace(scans, timestamps=scans.timestamps[:LAG_SCANS], ranges=scans.ranges[:LAG_SCANS], intensities=None)
    # not yet free of distortion, these scans tell where the platform was halfway through each
    half = 0.5 * scans.time_increment * scans.ranges.shape[1]
    near = np.median(np.diff(scans.timestamps)) < LAG_STEP
    matched = _Matcher(first, None if near else odometry, config, None).run().trajectory
    return odometry_clock(Trajectory(matched.timestamps + half, matched.poses), odometry).on_scan_clock(odometry)


class _Matcher:
    """State of one pass over the scans."""

    def __init__(
        self, scans: Scans, odometry: Trajectory | None, config: LidarConfig, velocities: Array | None
    ) -> None:
        n = len(scans)
        self._scans, self._odometry, self._config, self._velocities = scans, odometry, config, velocities
        self._distortion = np.zeros((n, 3)) if velocities is None or n < 2 else _distortion(scans, velocities)
        self._noise = max(KERNEL_SIGMAS * config.range_sigma, LAST_KERNEL)
        self._quality = OdometryQuality()
        self._poses, self._failed = np.zeros((n, 3)), np.zeros(n, np.bool_)
        self._fused, self._alone = np.zeros((max(n - 1, 0), 3, 3)), np.zeros((max(n - 1, 0), 3, 3))
        self._pose_covariance = np.diag(np.array(FLOOR)[[0, 0, 1]] ** 2)
        self._velocity, self._lost = np.zeros(3), 0

    def run(self) -> ScanMatching:
        if len(self._scans):
            self._keyframes = Keyframes(self._config, self._cloud(0), self._poses[0])
        for k in range(1, len(self._scans)):
            self._step(k)
        trajectory = Trajectory(self._scans.timestamps, self._poses)
        return ScanMatching(
            trajectory, self._fused, self._alone, self._failed, scan_velocities(self._scans, trajectory), self._odometry
        )

    def _cloud(self, k: int) -> Cloud:
        velocity = None if self._velocities is None else self._velocities[k]
        return make_cloud(scan_points(self._scans, k, velocity), self._config)

    def _step(self, k: int) -> None:
        before = self._poses[k - 1]
        start, end = float(self._scans.timestamps[k - 1]), float(self._scans.timestamps[k])
        motion = predict(self._odometry, start, end, self._velocity)
        sigma = self._quality.sigma(motion)
        cloud, prior = self._cloud(k), compose2(before, motion.mean)
        turn = _turn(before[2])
        information, free = turn @ np.diag(sigma**-2) @ turn.T, not motion.from_odometry
        found = _locate(cloud, self._keyframes.map, prior, information, sigma, self._noise, free)
        if _is_lost(found):
            found = _recover(cloud, self._keyframes.map, prior, self._noise) or found
        failed = _is_lost(found)
        self._failed[k], self._poses[k] = failed, prior if failed else found.pose
        scan = np.zeros((3, 3)) if failed else found.information
        doubt = match_doubt(found, prior, information, sigma) if free and not failed else np.zeros((3, 3))
        self._note(k, motion, sigma, scan, doubt)
        self._velocity = between2(before, self._poses[k]) / (end - start)
        self._lost = self._lost + 1 if failed else 0
        steady = abs(self._velocity[2]) * (end - start) < STEADY_TURN
        due = self._keyframes.is_due(self._poses[k]) and (steady or found.overlap < GOOD_OVERLAP)
        if due or self._lost >= LOST or len(self._keyframes.map) == 0:
            self._keyframes.add(cloud, self._poses[k])

    def _note(self, k: int, motion: Motion, sigma: Array, information: Array, doubt: Array) -> None:
        """Covariances of the motion to scan k, whose match has `information` (3, 3) in the map frame.

        doubt: (3, 3) covariance, map frame, of not knowing whether the match is right.
        """
        turn = _turn(self._poses[k - 1, 2])
        covariance = match_spread(information)
        covariance += turn @ np.diag(self._distortion[k] ** 2) @ turn.T
        relative = between2(self._poses[k - 1], self._poses[k])
        # the later pose seen from the earlier one moves against the earlier one, and about it as it turns
        earlier = np.eye(3)
        earlier[:2, 2] = -relative[1], relative[0]
        alone = turn.T @ covariance @ turn + earlier @ (turn.T @ self._pose_covariance @ turn) @ earlier.T
        floor = np.diag(np.array(FLOOR)[[0, 0, 1]] ** 2) + turn.T @ doubt @ turn
        fused = np.linalg.inv(np.linalg.inv(alone) + np.diag(sigma**-2))
        self._alone[k - 1], self._fused[k - 1] = alone + floor, fused + floor
        self._pose_covariance = covariance
        if not self._failed[k]:
            difference = relative - motion.mean
            difference[2] = wrap_angle(difference[2])
            # undo the prior's pull: what the scans alone would have said
            pull = alone @ np.diag(sigma**-2)
            self._quality.learn(motion, difference + pull @ difference, alone)


def _locate(
    cloud: Cloud, local: LocalMap, prior: Array, information: Array, sigma: Array, noise: float, free: bool
) -> Alignment:
    """Alignment from the prediction; where that is in doubt, also from the best place in a whole window.

    free: nothing but constant velocity predicts, so that the scan may slide along a corridor.
    """
    found = _aligned(cloud, local, prior, prior, information, noise, free)
    if found.overlap >= GOOD_OVERLAP and surprise(found.pose, prior, information) < MAX_SURPRISE:
        return found
    window = np.clip(REACH * sigma[[0, 2]], SMALLEST_WINDOW, LARGEST_WINDOW)
    places, margin = (PLACES, MARGIN) if free else (1, 0.0)
    guesses = search(cloud, local, prior, information, window, places)
    others = [_aligned(cloud, local, guess, prior, information, noise, free) for guess in guesses]

    def gain(place: Alignment) -> float:
        return place.overlap - PRIOR_WEIGHT * surprise(place.pose, prior, information)

    best = max(others, key=gain)
    return best if gain(best) > gain(found) + margin else found


def _aligned(
    cloud: Cloud, local: LocalMap, guess: Array, prior: Array, information: Array, noise: float, free: bool
) -> Alignment:
    """`align`, and again with points levelled where a scan that nothing holds slides."""
    found = align(cloud, local, guess, prior, information, KERNEL, noise)
    if free and slides(found):
        level = replace(cloud, information=np.minimum(cloud.information, LEVEL))
        other = align(level, local, guess, prior, information, KERNEL, noise)
        return other if other.overlap >= found.overlap else found
    return found


def _is_lost(found: Alignment) -> bool:
    return found.overlap < MIN_OVERLAP or found.matched < MIN_MATCHED


def _recover(cloud: Cloud, local: LocalMap, prior: Array, noise: float) -> Alignment | None:
    """The best place far around a prediction that turned out wrong, None where the scan does not clearly lie on it."""
    information = np.diag(np.array(RECOVERY)[[0, 0, 1]] ** -2.0)
    window = np.array(RECOVERY)
    guess = search(cloud, local, prior, information, window)[0]
    found = align(cloud, local, guess, guess, information, KERNEL, noise)
    return found if found.overlap >= RECOVERED_OVERLAP and not _is_lost(found) else None


def _turn(yaw: float) -> Array:
    """(3, 3): turns [x, y, yaw] of the platform frame into the map frame."""
    turn = np.eye(3)
    turn[:2, :2] = rotation2(float(yaw))
    return turn


def _distortion(scans: Scans, velocities: Array) -> Array:
    """(N, 3) m, m, rad: what is left of motion distortion when velocities (N, 3) change during the scans."""
    sweep = scans.time_increment * scans.ranges.shape[1]
    return np.asarray(0.25 * sweep * np.abs(np.gradient(velocities, axis=0)))
