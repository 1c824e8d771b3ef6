"""The point cloud: thinned, coloured by what images show, kept in the result, written as PLY."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from box_room import SIZE, WIDE, box_layout, camera_at
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from two_rooms import two_rooms

from recon.cloud import ASSUMED_HEIGHT, CELL, GREY, coloured, load_cloud, ply_of, thinned
from recon.errors import InputError
from recon.exporters import export
from recon.faces import extrude

COLOURS = np.array([[250, 20, 20], [20, 250, 20], [20, 20, 250], [250, 250, 20]], np.uint8)
"""RGB of the walls of the box, by wall."""


def wall_points() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points on the walls, away from the corners, and the wall of each."""
    points, owner = [], []
    for wall in box_layout().walls:
        steps = np.linspace(0.2, 0.8, 40)[:, None]
        points.append(wall.start + steps * (wall.end - wall.start))
        owner += [wall.id] * len(steps)
    return np.concatenate(points), np.array(owner)


def photographs(poses: tuple[object, ...]) -> list[NDArray[np.uint8]]:
    """What the camera sees of a box whose walls are plain colours; BGR."""
    from recon.labels import FIRST_WALL, LabelRenderer

    renderer = LabelRenderer(extrude(box_layout()), WIDE)
    images = []
    for pose in poses:
        labels = renderer.render(pose)  # type: ignore[arg-type]
        image = np.zeros((*labels.shape, 3), np.uint8)
        for k, colour in enumerate(COLOURS):
            image[labels == FIRST_WALL + k] = colour[::-1]
        images.append(image)
    return images


def test_points_have_the_colour_of_the_wall_that_they_are_on() -> None:
    poses = tuple(camera_at(0.5 * SIZE[0], 0.5 * SIZE[1], yaw, 0.25) for yaw in np.arange(8) * np.pi / 4)
    images = photographs(poses)
    points, owner = wall_points()
    cloud = coloured(points, extrude(box_layout()), WIDE, poses, lambda i: images[i])
    assert cloud.points.shape == (len(points), 3) and np.all(cloud.points[:, 2] == np.float32(ASSUMED_HEIGHT))
    seen = np.any(cloud.colours != GREY, axis=1)
    assert seen.mean() > 0.5
    right = np.all(np.abs(cloud.colours.astype(int) - COLOURS[owner]) < 8, axis=1)
    assert right[seen].mean() > 0.98


def test_points_behind_walls_and_without_images_are_grey() -> None:
    poses = (camera_at(0.5 * SIZE[0], 0.5 * SIZE[1], 0.0, 0.25),)
    images = photographs(poses)
    beyond = np.array([[SIZE[0] + 0.5, 0.5 * SIZE[1]], [SIZE[0] + 1.0, 0.5 * SIZE[1]]])
    faces = extrude(box_layout())
    assert np.all(coloured(beyond, faces, WIDE, poses, lambda i: images[i]).colours == GREY)
    points, _ = wall_points()
    for camera, taken in ((None, ()), (WIDE, (None,)), (WIDE, poses)):
        cloud = coloured(points, faces, camera, taken, lambda i: None)
        assert np.all(cloud.colours == GREY) and len(cloud.points) == len(points)
    assert len(coloured(np.zeros((0, 2)), faces, WIDE, poses, lambda i: images[i]).points) == 0


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=200))
def test_thinning_keeps_a_point_near_every_point(points: list[tuple[float, float]]) -> None:
    ends = np.array(points)
    kept = thinned(ends)
    assert {tuple(p) for p in kept} <= {tuple(p) for p in ends}
    distance = np.linalg.norm(ends[:, None] - kept[None], axis=2).min(axis=1)
    assert distance.max() <= CELL * np.sqrt(2) + 1e-9


def test_the_file_is_kept_and_read_by_others(tmp_path: Path) -> None:
    points, owner = wall_points()
    cloud = replace(coloured(points, (), None, (), lambda i: None), colours=np.ascontiguousarray(COLOURS[owner]))
    model = replace(two_rooms(), cloud=cloud)
    assert export(model, tmp_path / "house.cloud.ply") == ()
    read = trimesh.load(tmp_path / "house.cloud.ply")
    np.testing.assert_allclose(read.vertices[:, :2], points, atol=1e-6)
    np.testing.assert_array_equal(read.visual.vertex_colors[:, :3], cloud.colours)
    again = load_cloud(tmp_path / "house.cloud.ply")
    assert again is not None and ply_of(again) == ply_of(cloud)
    assert load_cloud(tmp_path / "nothing.ply") is None
    (tmp_path / "cut.ply").write_bytes(ply_of(cloud)[:-1])
    with pytest.raises(InputError, match="damaged"):
        load_cloud(tmp_path / "cut.ply")


def test_a_model_without_points_gives_an_empty_file_and_says_so(tmp_path: Path) -> None:
    (note,) = export(two_rooms(), tmp_path / "house.cloud.ply")
    assert "house.cloud.ply" in note and "no points" in note
    assert b"element vertex 0\n" in (tmp_path / "house.cloud.ply").read_bytes()
