"""The building: plan, faces with pictures, and what robots want of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from recon.cloud import coloured
from recon.faces import extrude
from recon.furniture import Furniture, suspects
from recon.graph.estimate import MapEstimate
from recon.layout.build import build_layout
from recon.layout.evidence import scan_rays
from recon.layout.heights import measure_heights
from recon.layout.occupancy import build_occupancy
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import Face, Layout, Model
from recon.reveals import with_side_colours
from recon.segmentation.furniture import standing_furniture
from recon.segmentation.heights import measure_objects
from recon.segmentation.pixels import NO_OBJECTS, ObjectPixels
from recon.sequence.tum import as_written
from recon.stages.images import Poses, place_cameras
from recon.stages.observed import Observed
from recon.stages.run import Run
from recon.texture.notes import texture_notes
from recon.texture.texture import texture_faces


def plan_rooms(run: Run, seen: Observed, estimate: MapEstimate) -> Layout:
    """The plan with heights, without the furniture that images tell from walls.

    Its numbers have the decimals of layout.json, so that exports made later are equal.
    """
    with run.stage("layout"):
        layout = _plan(run, seen, estimate)
    return layout_from_json(layout_to_json(layout), "layout.json")


def _plan(run: Run, seen: Observed, estimate: MapEstimate) -> Layout:
    scans, config = run.sequence.scans, run.config.layout
    if run.sight is None or seen.calibration is None:
        return build_layout(estimate, scans, config)
    poses, camera = place_cameras(run, seen.calibration, estimate), run.sight[1]

    def plan(furniture: Iterable[Furniture] = ()) -> Layout:
        layout = build_layout(estimate, scans, config, tuple(furniture))
        return measure_heights(layout, seen.views.lines, poses, camera)

    layout = plan()
    doubtful = suspects(layout)
    found = standing_furniture(doubtful, plan(doubtful), camera, poses, run.load) if doubtful else []
    return plan(found) if found else layout


def find_objects(run: Run, layout: Layout, poses: Poses) -> tuple[Layout, ObjectPixels]:
    """The layout with the heights of its objects, and the pixels that show them; poses: map_from_camera."""
    if run.sight is None or not any(pose is not None for pose in poses):
        return layout, NO_OBJECTS
    camera, faces = run.sight[1], extrude(layout)
    with run.stage("objects"):
        layout = replace(layout, objects=measure_objects(layout, faces, camera, poses, run.load))
        return layout, ObjectPixels.find(layout, faces, camera, poses, run.load, run.config.workers)


def bare_model(run: Run, layout: Layout) -> Model:
    """Walls, floors, ceilings and openings, without pictures."""
    return _model(run, layout, extrude(layout))


def finished_model(run: Run, estimate: MapEstimate, layout: Layout, poses: Poses, objects: ObjectPixels) -> Model:
    """The model with all that images and scans tell of it; poses: map_from_camera."""
    faces = extrude(layout)
    if run.sight is not None and any(pose is not None for pose in poses):
        camera, config = run.sight[1], run.config
        with run.stage("texture"):
            faces = texture_faces(faces, camera, poses, run.load, config.texture, config.workers, objects=objects.of)
            faces = with_side_colours(faces)
    model = _model(run, layout, faces)
    with run.stage("occupancy"):
        occupancy = build_occupancy(estimate.trajectory, run.sequence.scans)
    with run.stage("cloud"):
        _, ends = scan_rays(estimate.trajectory, run.sequence.scans)
        cloud = coloured(ends, model.faces, run.sequence.camera, poses, run.load)
    run.counts["points"] = len(cloud.points)
    drive = as_written(estimate.trajectory)
    return replace(model, trajectory=drive, pose_sigmas=estimate.pose_sigmas, occupancy=occupancy, cloud=cloud)


def _model(run: Run, layout: Layout, faces: tuple[Face, ...]) -> Model:
    notes = []
    if layout.ceiling_height is None:
        notes.append(f"No image shows the ceiling; walls are {layout.default_ceiling_height:.2f} m high by default.")
    if any(wall.source == "inferred" for wall in layout.walls):
        notes.append("Walls of source 'inferred' close the outline where no sensor saw a wall.")
    run.counts |= {"walls": len(layout.walls), "rooms": len(layout.rooms), "openings": len(layout.openings)}
    pictures = texture_notes(faces, run.config.texture)
    return Model(run.sequence.name, layout, faces, tuple(notes), picture_notes=pictures)
