"""Poses and wall lines from all that was observed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.geometry import between2
from recon.graph.blind import guessed_steps
from recon.graph.boundary import boundary_observations
from recon.graph.control import Control
from recon.graph.ekf import solve_filter
from recon.graph.estimate import MapEstimate
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.graph.solve import solve_graph
from recon.graph.tape import Tape
from recon.lidar.segment import ScanSegments
from recon.stages.observed import Observed
from recon.stages.run import Run


def solve(run: Run, seen: Observed, tape: Tape | None = None, control: Control | None = None) -> MapEstimate:
    """Platform poses and wall lines from one factor graph, or from the paper's filter."""
    graph, matching, closed = run.config.graph, seen.matching, seen.closed
    with run.stage("factor graph" if graph.backend == "graph" else "filter"):
        poses = matching.trajectory.poses
        motion = Motion(between2(poses[:-1], poses[1:]), matching.scan_covariances, guessed_steps(matching))
        given = closed.trajectory, motion, _observations(run, seen), matching.odometry
        if graph.backend == "ekf":
            estimate = solve_filter(*given)
        else:
            estimate = solve_graph(*given, graph, closures=closed.seen_again, tape=tape, control=control)
            pairs = np.stack([closed.closures.first, closed.closures.second], axis=1)
            estimate = replace(estimate, closures=pairs)
    run.counts["wall lines"] = len(estimate.walls)
    return replace(estimate, odometry_clock=matching.clock)


def _observations(run: Run, seen: Observed) -> WallObservations:
    """Walls as scans and, where the scanner does not reach, as the images' ground-wall boundary shows them."""
    found = [_of_segments(seen.segments)]
    if seen.calibration is not None and run.sight is not None:
        images, camera = run.sight
        times = seen.calibration.on_scan_clock(images.timestamps)
        scans, trajectory = run.sequence.scans, seen.closed.trajectory
        found.append(boundary_observations(seen.views.lines, times, camera, seen.calibration, scans, trajectory))
    return WallObservations.concatenate(found)


def _of_segments(segments: ScanSegments) -> WallObservations:
    """The LiDAR segments of all scans."""
    table = segments.table
    return WallObservations(segments.scan, table.endpoints, table.covariance, np.full(len(table), -1, np.int64))
