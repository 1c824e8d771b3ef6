"""Steps that need the scans: the platform's motion, line segments, places visited again."""

from __future__ import annotations

from dataclasses import replace

from recon.calibration.result import Calibration
from recon.graph.blind import Eye, blind_steps, see_along, unplaced_scans
from recon.lidar.matching import ScanMatching
from recon.lidar.noise import with_noise
from recon.lidar.segment import ScanSegments
from recon.lidar.split_and_merge import extract_segments
from recon.lidar.sweep import match_in_order
from recon.loops.close import ClosedLoops, close_loops
from recon.stages.run import Run


def match_scans(run: Run) -> tuple[ScanMatching, ScanSegments]:
    """Odometry from scan matching, and line segments of every scan (paper 2.1); puts the sequence's beams in order."""
    scans = run.sequence.scans
    lidar = with_noise(scans, run.config.lidar)
    with run.stage("scan matching", len(scans), "scans") as stage:
        scans, matching = match_in_order(scans, run.sequence.odometry, lidar, run.warnings)
        stage.advance(len(scans))
    with run.stage("scan lines", len(scans), "scans") as stage:
        parts = []
        for i in range(len(scans)):
            parts.append(extract_segments(scans, i, lidar, matching.velocities[i]))
            stage.advance()
        segments = ScanSegments.pack(parts)
        del parts
    run.counts |= {"scans": len(scans), "scan segments": len(segments.table)}
    if matching.failed.any():
        mend = "drive slower" if run.sequence.odometry is not None else "drive slower, or give odometry.txt"
        run.warnings.append(
            f"{int(matching.failed.sum())} of {len(scans)} scans fitted no map; their motion is predicted ({mend}, "
            "where there are many)"
        )
    run.sequence = replace(run.sequence, scans=scans)
    return matching, segments


def fill_blind_steps(
    run: Run, calibration: Calibration | None, matching: ScanMatching, segments: ScanSegments
) -> ScanMatching:
    """The scan matches, filled in where they say nothing along a corridor: from images, else from what platforms do."""
    eye = None if calibration is None else Eye.of(run.sequence, calibration)
    if not blind_steps(matching).any() or (eye is None and matching.odometry is not None):
        return matching
    with run.stage("image motion"):
        matching, seen = see_along(matching, segments, eye)
    if seen == 0:
        run.warnings.append("neither scans nor images tell the way along some corridor; constant velocity is assumed")
    run.counts["image motions"] = seen
    return matching


def find_closures(run: Run, matching: ScanMatching) -> ClosedLoops:
    """Places visited again, and the poses that agree with them; the paper's filter knows none."""
    if run.config.graph.backend == "ekf":
        return ClosedLoops.none(matching.trajectory)
    with run.stage("loop closure"):
        placed = replace(matching, failed=matching.failed | unplaced_scans(matching))
        closed = close_loops(run.sequence.scans, placed, run.config.lidar, run.config.workers)
    run.counts["loop closures"] = len(closed.closures)
    return closed
