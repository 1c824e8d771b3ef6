"""The house, top to bottom: from a sequence to a model.

    sequence -> features -> calibration -> trajectory + walls -> layout -> texture -> Model

Every stage is a function of what the stages before it gave (`recon/stages` calls them); only readers read files, only
exporters write them.
"""

from __future__ import annotations

from dataclasses import dataclass

from recon.calibration.result import Calibration
from recon.config import Config
from recon.graph.estimate import MapEstimate
from recon.measured import NOTHING, Measured
from recon.model import Model
from recon.progress import SILENT, Progress
from recon.segmentation.pixels import NO_OBJECTS, ObjectPixels
from recon.sequence.sequence import Sequence
from recon.stages.building import bare_model, find_objects, finished_model, plan_rooms
from recon.stages.images import Poses, calibrate_camera, detect_image_lines, place_cameras, refine_cameras
from recon.stages.observed import Observed
from recon.stages.run import Run
from recon.stages.scans import fill_blind_steps, find_closures, match_scans
from recon.stages.solution import solve


@dataclass(frozen=True)
class Build:
    """All that a build found. `map_from_camera`: one pose an image, None where it has none; `objects`: their pixels."""

    sequence: Sequence
    config: Config
    model: Model
    estimate: MapEstimate
    calibration: Calibration | None
    map_from_camera: Poses
    seconds: dict[str, float]
    counts: dict[str, int]
    warnings: tuple[str, ...]
    measured: Measured = NOTHING
    objects: ObjectPixels = NO_OBJECTS


def build(
    sequence: Sequence,
    config: Config,
    progress: Progress = SILENT,
    measured: Measured = NOTHING,
    plan_only: bool = False,
) -> Build:
    """From one drive to a textured model with known accuracy.

    measured: by people; walls are named by their ids in the layout of a build without it. plan_only: the same layout,
    without textures, heights of objects, cloud and occupancy. Raises InputError for walls that are not there,
    ConfigError where the backend takes no measures.
    """
    measured.check_backend(config.graph)
    run = Run(sequence, config, progress)
    seen = observe(run)
    estimate = solve(run, seen)
    if measured:
        named = measured.on_layout(plan_rooms(run, seen, estimate), run.sequence.scans.timestamps)
        estimate = solve(run, seen, *named)
        run.warnings.extend(measured.surprises(estimate))
    layout = plan_rooms(run, seen, estimate)
    poses = place_cameras(run, seen.calibration, estimate)
    objects = NO_OBJECTS
    if plan_only:
        model = bare_model(run, layout)
    else:
        poses = refine_cameras(run, seen.calibration, estimate, layout, poses)
        layout, objects = find_objects(run, layout, poses)
        model = finished_model(run, estimate, layout, poses, objects)
    found = run.seconds, run.counts, tuple(dict.fromkeys(run.warnings))
    return Build(run.sequence, config, model, estimate, seen.calibration, poses, *found, measured, objects)


def observe(run: Run) -> Observed:
    """What scans and images show, before anything is solved for all of them at once."""
    matching, segments = match_scans(run)
    views = detect_image_lines(run)
    calibration = calibrate_camera(run, views, matching.trajectory, segments)
    matching = fill_blind_steps(run, calibration, matching, segments)
    return Observed(matching, segments, views, calibration, find_closures(run, matching))
