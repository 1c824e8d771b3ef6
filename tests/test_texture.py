"""Textures reproduce a room of known colours: right place, right way round, sharp, even, honest about what was seen."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import shapely
from box_room import FISHEYE, RATIONAL, SIZE, WIDE, Shoot, box_layout, camera_at, face_colours, round_tour, shoot, solid
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.config import TextureConfig
from recon.faces import extrude
from recon.geometry import Array, Pose3
from recon.model import Face, Layout, Room, Wall
from recon.raycast import RayScene
from recon.sampling import uv_from_points
from recon.sequence.camera import Camera
from recon.texture import gains, refine_poses, texture_faces
from recon.texture.blur import blur_cost
from recon.texture.fill import fill_smoothly
from recon.texture.gains import Exposure, solve_log_gains
from recon.texture.grain import grain, repeated
from recon.texture.labelling import choose_views
from recon.texture.notes import texture_notes

COARSE = TextureConfig(metres_per_texel=0.01)


def textured(taken: Shoot, poses: tuple[Pose3 | None, ...] | None = None, workers: int = 1) -> tuple[Face, ...]:
    faces = extrude(box_layout())
    return texture_faces(faces, taken.camera, poses or taken.poses, taken.load, COARSE, workers)


@cache
def wide_tour() -> Shoot:
    return shoot(WIDE, round_tour())


@cache
def wide_tour_textured() -> tuple[Face, ...]:
    return textured(wide_tour())


def points_on(face: Face, seed: int = 0, count: int = 4000) -> Array:
    """Random points spread over a rectangular face (found from its corners, not from uv)."""
    low, high = face.vertices.min(axis=0), face.vertices.max(axis=0)
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def seen_by(points: Array, taken: Shoot, margin: float) -> NDArray[np.bool_]:
    """Whether any image shows the points, `margin` pixels inside its border: the box room hides nothing."""
    seen = np.zeros(len(points), dtype=bool)
    camera = taken.camera
    for pose in taken.poses:
        local = pose.inverse().apply(points)
        pixels = camera.project(local)
        # Distortion may fold points far off the axis back into the image: a seen point is found again from its pixel.
        inside = (pixels >= margin).all(axis=1) & (
            pixels <= [camera.width - 1 - margin, camera.height - 1 - margin]
        ).all(axis=1)
        back = np.full((len(points), 2), np.nan)
        back[inside] = camera.undistort(pixels[inside])
        seen |= inside & (np.abs(back - local[:, :2] / local[:, 2:]).max(axis=1) < 1e-3)
    return seen


def psnr(faces: tuple[Face, ...], taken: Shoot, scale: bool = False) -> float:
    """Of seen points against the truth, dB; with `scale` after one factor a channel for all faces together."""
    points = [points_on(face) for face in faces]
    use = [seen_by(p, taken, 12.0) for p in points]
    found = np.concatenate([face_colours(f, p[u]) for f, p, u in zip(faces, points, use, strict=True)])
    truth = np.concatenate([solid(p[u])[:, ::-1] for p, u in zip(points, use, strict=True)])
    if scale:
        found = found * np.median(truth / np.maximum(found, 1), axis=0)
    return float(10 * np.log10(255**2 / np.mean((found - truth) ** 2)))


@pytest.mark.parametrize("camera", [WIDE, FISHEYE, RATIONAL], ids=["plumb_bob", "equidistant", "rational_polynomial"])
def test_textures_show_the_room(camera: Camera) -> None:
    taken = wide_tour() if camera is WIDE else shoot(camera, round_tour())
    faces = wide_tour_textured() if camera is WIDE else textured(taken)
    assert all(face.texture is not None for face in faces)
    assert 30 < psnr(faces, taken) < 60
    turned = tuple(replace(f, texture=f.texture[:, ::-1]) for f in faces if f.texture is not None)
    assert psnr(turned, taken) < 20, "the measure notices a mirrored picture"


def test_textures_are_sharp() -> None:
    """Differences over 2 cm are as large as they are in truth: 1 would be perfect, a blur of 3 cm gives 0.85."""
    for face in wide_tour_textured()[:4]:
        points = points_on(face)
        step = np.array([0.0, 0.0, 0.02])
        points = points[seen_by(points, wide_tour(), 20.0)]
        found = face_colours(face, points + step) - face_colours(face, points)
        truth = (solid(points + step) - solid(points))[:, ::-1]
        assert 0.9 < float(np.sqrt(np.mean(found**2) / np.mean(truth**2))) < 1.1, face.name


def test_seen_fraction_is_what_images_see() -> None:
    for face in wide_tour_textured():
        truth = float(seen_by(points_on(face), wide_tour(), 0.0).mean())
        assert face.seen_fraction == pytest.approx(truth, abs=0.04), face.name
    assert 0.2 < min(f.seen_fraction for f in wide_tour_textured()) < 0.95, "the test has something to tell apart"


def test_resolution_follows_configuration_images_and_limit() -> None:
    taken = wide_tour()
    faces = extrude(box_layout())
    fine = texture_faces(faces, taken.camera, taken.poses, taken.load, TextureConfig(metres_per_texel=0.0005))
    small = texture_faces(faces, taken.camera, taken.poses, taken.load, TextureConfig(max_texture_size=100))
    for a, b, c in zip(wide_tour_textured(), fine, small, strict=True):
        assert a.texture is not None and b.texture is not None and c.texture is not None
        assert a.metres_per_texel == pytest.approx(0.01, rel=0.02)
        width = np.linalg.norm(np.ptp(a.vertices[:, :2], axis=0)) if a.kind == "wall" else SIZE[0]
        assert a.texture.shape[1] * a.metres_per_texel == pytest.approx(width, rel=0.02)
        # A pixel covers 5 to 20 mm here: texels of half a millimetre would show nothing more.
        assert 0.003 < b.metres_per_texel < 0.015
        assert 0.95 * 100**2 < c.texture.shape[0] * c.texture.shape[1] <= 1.03 * 100**2


def test_exposure_is_evened_out() -> None:
    gains = np.exp(np.random.default_rng(3).normal(0, 0.2, (12, 1))) * np.ones(3)
    taken = shoot(WIDE, round_tour(), gains)
    assert psnr(textured(taken), taken, scale=True) > 29
    plain = wide_tour()
    assert psnr(textured(replace(plain, images=taken.images)), plain, scale=True) > 29


def shaded(taken: Shoot, fall: float) -> Shoot:
    """The same images through a lens whose corners are `fall` times as bright as its middle."""
    h, w = taken.images[0].shape[:2]
    x, y = np.meshgrid(np.arange(w) - (w - 1) / 2, np.arange(h) - (h - 1) / 2)
    light = np.exp(np.log(fall) * (x**2 + y**2) / (((w - 1) / 2) ** 2 + ((h - 1) / 2) ** 2))[..., None]
    return replace(taken, images=tuple(np.rint(image * light).astype(np.uint8) for image in taken.images))


def test_the_lens_shades_its_corners() -> None:
    """A lens that loses half of the light in its corners gives pictures as even as one that loses none."""
    even = psnr(wide_tour_textured(), wide_tour(), scale=True)
    assert psnr(textured(shaded(wide_tour(), 0.5)), wide_tour(), scale=True) > min(even, 32) - 3


def test_blurred_images_are_used_last() -> None:
    taken = shoot(WIDE, round_tour(24))
    kernel = np.zeros((9, 9), np.float32)
    kernel[4] = 1 / 9
    images = [cv2.filter2D(image, -1, kernel) if i % 3 == 0 else image for i, image in enumerate(taken.images)]
    for image, blurred in zip(taken.images, images, strict=True):
        assert blur_cost(np.asarray(blurred, np.uint8)) >= blur_cost(image)

    def share(faces: tuple[Face, ...]) -> float:
        owners = np.concatenate([f.sources[f.sources >= 0] for f in faces if f.sources is not None])
        return float((owners % 3 == 0).mean())

    mixed = replace(taken, images=tuple(np.asarray(image, np.uint8) for image in images))
    assert share(textured(mixed)) < 0.25 * share(textured(taken))


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.floats(0, 0.15), st.floats(0.5, 1.0))
def test_gains_are_recovered(seed: int, outliers: float, fall: float) -> None:
    rng = np.random.default_rng(seed)
    views, count = 15, 400
    truth = rng.normal(0, 0.15, (views, 1)) + rng.normal(0, 0.01, (views, 3))
    first = rng.integers(0, views - 4, count)
    points = np.repeat(np.arange(count), 5)
    owner = (first[:, None] + np.arange(5)).ravel()
    logs = rng.uniform(3, 5, (count, 3))[points] - truth[owner] + rng.normal(0, 0.02, (5 * count, 3))
    logs[rng.random(len(logs)) < outliers] += rng.normal(0, 0.7, 3)
    radii = rng.uniform(0, 1, len(points))
    logs += np.log(fall) * radii[:, None] ** 2
    found, shading = solve_log_gains(points, owner, logs, radii, views + 1)
    for r in (0.4, 0.7, 1.0):
        light = Exposure(np.exp(found), shading).light(np.array(r))
        assert light == pytest.approx(np.log(fall) * r**2, abs=0.04), "the lens's shading"
    error = found[:views] - truth
    assert np.abs(np.diff(error, axis=0)).max() < 0.05, "neighbours agree"
    assert np.abs(error - error.mean(axis=0)).max() < 0.08, "slow changes are held back a little"
    assert np.abs(error.mean(axis=0)).max() < 0.25, "on the whole neither brighter nor darker"
    assert found[views] == pytest.approx(0), "an image that shares nothing is left as it is"


def test_samples_of_exposure_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 60 images that see 3000 points each a few thousand samples are held, spread over all of them."""
    monkeypatch.setattr(gains, "MOST_SAMPLES", 10_000)
    rng = np.random.default_rng(4)
    truth, colours = rng.normal(0, 0.2, 60), rng.uniform(3.2, 4.8, (4000, 3))
    samples = gains.ExposureSamples()
    for view, gain in enumerate(truth):
        points = np.sort(rng.choice(4000, 3000, replace=False)).astype(np.int64)
        seen = np.exp(colours[points] - gain).astype(np.uint8)
        samples.add(points, view, seen, np.full(3000, 0.5), np.zeros(3000, np.int64))
        assert 2_000 < len(np.concatenate(samples._points)) <= 10_000
    found = np.log(samples.solve(60).gains)
    assert np.ptp(found - truth[:, None]) < 0.06
    assert np.abs(found).max() > 0.2, "gains that there is something to find of"


def test_what_stands_in_front_is_outvoted() -> None:
    taken = shoot(WIDE, round_tour(24))
    covered = list(taken.images)
    for i in (3, 11, 18):
        covered[i] = covered[i].copy()
        covered[i][72:152, 88:160] = (20, 20, 230)
    clean, disturbed = textured(taken), textured(replace(taken, images=tuple(covered)))
    assert psnr(clean, taken) > 30
    assert psnr(disturbed, taken) > psnr(clean, taken) - 3
    red = [np.mean((f.texture[..., 0] > 190) & (f.texture[..., 2] < 70)) for f in disturbed if f.texture is not None]
    assert max(red) < 0.002


def test_pixels_that_show_objects_are_not_used() -> None:
    """Red stands before the faces in two of three images."""
    taken = shoot(WIDE, round_tour(24))
    masks = [np.zeros(image.shape[:2], bool) if i % 3 else None for i, image in enumerate(taken.images)]
    covered = [image.copy() for image in taken.images]
    for image, mask in zip(covered, masks, strict=True):
        if mask is not None:
            mask[72:152, 88:160] = True
            image[mask] = (20, 20, 230)
    disturbed = replace(taken, images=tuple(covered))

    plain = extrude(box_layout())
    told = texture_faces(plain, WIDE, taken.poses, disturbed.load, COARSE, objects=lambda i: masks[i])
    assert psnr(textured(disturbed), taken) < 35, "too much to be outvoted"
    assert psnr(told, taken) > 40
    assert not any(((f.texture[..., 0] > 190) & (f.texture[..., 2] < 70)).any() for f in told if f.texture is not None)


def test_poses_off_by_a_centimetre_still_give_one_picture() -> None:
    rng = np.random.default_rng(8)
    taken = shoot(WIDE, round_tour(20))
    moved = []
    for pose in taken.poses:
        turn = rng.normal(0, np.deg2rad(0.3), 3)
        x, y, z = turn
        small = np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
        u, _, v = np.linalg.svd(small)
        moved.append(pose @ Pose3(u @ v, rng.normal(0, 0.01, 3)))
    faces = extrude(box_layout())
    refined = refine_poses(faces, taken.camera, moved, taken.load, (0.01, np.deg2rad(0.3)))
    assert psnr(textured(taken, refined), taken) > 38
    three = refine_poses(faces, taken.camera, moved, taken.load, (0.01, np.deg2rad(0.3)), workers=3)
    assert [p and p.matrix().tobytes() for p in refined] == [p and p.matrix().tobytes() for p in three]
    apart = replace(taken, poses=tuple(moved))
    raw = [seen_error(faces, apart, i) for i in range(len(moved))]
    assert float(np.median(raw)) > 6, "levels: each image alone is this far off, 33 dB at best"


def test_poses_that_are_known_well_hardly_move() -> None:
    """Walls that are 15 cm off pull images as far as their poses are not known."""
    taken, layout = wide_tour(), box_layout()
    walls = (replace(w, start=w.start + 0.15 * w.normal, end=w.end + 0.15 * w.normal) for w in layout.walls)
    near = extrude(replace(layout, walls=tuple(walls)))
    steps = []
    for sigmas in ((0.001, np.deg2rad(0.02)), (0.05, np.deg2rad(1.0))):
        refined = refine_poses(near, taken.camera, taken.poses, taken.load, sigmas)
        both = zip(refined, taken.poses, strict=True)
        steps.append(max(float(np.linalg.norm(a.translation - b.translation)) for a, b in both if a is not None))
    assert steps[0] < 0.02
    assert steps[1] > 3 * steps[0], "the test has something to tell apart"


def test_images_between_those_aligned_move_along() -> None:
    taken = wide_tour()
    twice = [pose for pose in taken.poses for _ in (0, 1)]
    higher = Pose3(np.eye(3), np.array([0.0, 0.0, 0.01]))
    wrong = [pose if k % 4 < 2 else higher @ pose for k, pose in enumerate(twice)]
    refined = refine_poses(extrude(box_layout()), taken.camera, wrong, lambda i: taken.load(i // 2), (0.01, 0.002))
    moved = [
        np.linalg.norm(a.translation - b.translation) for a, b in zip(refined, wrong, strict=True) if a is not None
    ]
    assert min(max(moved[2:4]), max(moved[6:8])) > 0.002
    for first, second in zip(refined[::2], refined[1::2], strict=True):
        assert first is not None and second is not None
        assert first.matrix() == pytest.approx(second.matrix(), abs=1e-9)


def seen_error(faces: tuple[Face, ...], taken: Shoot, index: int) -> float:
    """Root mean square difference (levels) between an image and the truth where its pose says it looks."""
    camera, pose = taken.camera, taken.poses[index]
    points = np.concatenate([points_on(face, seed=1) for face in faces])
    pixels = camera.project(pose.inverse().apply(points))
    inside = (pixels >= 5).all(axis=1) & (pixels <= [camera.width - 6, camera.height - 6]).all(axis=1)
    x, y = np.round(pixels[inside]).astype(int).T
    return float(np.sqrt(np.mean((taken.images[index][y, x] - solid(points[inside])) ** 2)))


def test_workers_do_not_change_the_result() -> None:
    for one, three in zip(wide_tour_textured(), textured(wide_tour(), workers=3), strict=True):
        assert one.texture is not None and three.texture is not None
        assert one.texture.tobytes() == three.texture.tobytes()
        assert one.seen_fraction == three.seen_fraction
        assert one.sources is not None and three.sources is not None
        assert np.array_equal(one.sources, three.sources)


def test_sources_name_the_image_of_every_texel() -> None:
    """Where the picture is from image i, image i sees that place; what is filled, nobody sees or hardly anybody."""
    taken = wide_tour()
    for face in wide_tour_textured():
        assert face.texture is not None and face.sources is not None and face.filled is not None
        assert face.sources.shape == face.texture.shape[:2]
        assert face.filled.mean() == pytest.approx(1 - face.seen_fraction, abs=0.01)
        points = points_on(face)
        height, width = face.sources.shape
        uv = points @ uv_from_points(face)[:3] + uv_from_points(face)[3]
        row, column = ((1 - uv[:, 1]) * height).astype(int), (uv[:, 0] * width).astype(int)
        owner = face.sources[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        for i in np.unique(owner[owner >= 0]):
            alone = replace(taken, poses=(taken.poses[i],))
            assert seen_by(points[owner == i], alone, -6.0).all(), (face.name, i)


def test_images_that_are_corrupt_or_without_pose_are_left_out() -> None:
    taken = wide_tour()
    poses: tuple[Pose3 | None, ...] = (None, *taken.poses[1:])

    def load(index: int) -> NDArray[np.uint8] | None:
        assert index != 0, "nobody asks for an image without a pose"
        return None if index == 5 else taken.load(index)

    faces = texture_faces(extrude(box_layout()), taken.camera, poses, load, COARSE)
    assert psnr(faces, replace(taken, poses=tuple(p for i, p in enumerate(taken.poses) if i not in (0, 5)))) > 30


def test_faces_that_no_image_sees_stay_plain() -> None:
    taken = shoot(WIDE, (camera_at(2.5, 1.8, 0.0),))
    faces = {f.name: f for f in textured(taken)}
    assert faces["wall_003"].texture is None and faces["wall_003"].seen_fraction == 0, "behind the camera"
    assert faces["wall_001"].texture is not None and faces["wall_001"].seen_fraction > 0.7, "in front of it"
    nobody = texture_faces(extrude(box_layout()), WIDE, (None, None), lambda _: None, COARSE)
    assert [f.texture for f in nobody] == [None] * 6
    assert texture_faces((), WIDE, taken.poses, taken.load) == ()


def test_walls_hide_what_is_behind_them() -> None:
    """An L-shaped room, every face of one colour: no face gets another's colour from beyond the inner corner."""
    polygon = np.array([[0, 0], [5, 0], [5, 2], [2, 2], [2, 5], [0, 5]], dtype=np.float64)
    ends = np.roll(polygon, -1, axis=0)
    walls = tuple(Wall(i, a, b, 0.01, 0.001, "lidar", 9) for i, (a, b) in enumerate(zip(polygon, ends, strict=True)))
    faces = extrude(Layout(walls, (Room(0, "L", polygon),), ceiling_height=2.4))
    colours = np.array([[200, 40, 40], [40, 200, 40], [40, 40, 200], [200, 200, 40], [40, 200, 200], [200, 40, 200],
                        [120, 120, 120], [230, 230, 230]], dtype=np.uint8)  # fmt: skip
    spots = [(4.4, 1.0, np.pi), (3.0, 1.2, np.pi), (1.0, 1.0, 0.8), (1.0, 3.8, -1.3), (1.2, 1.2, 1.4), (0.8, 0.7, -0.6)]
    poses = tuple(camera_at(x, y, yaw) for x, y, yaw in spots)
    scene = RayScene(faces)
    checked, images = 0, []
    for pose in poses:
        _, hit = scene.cast(pose.translation, WIDE.rays() @ pose.rotation.T)
        images.append(np.ascontiguousarray(colours[hit][..., ::-1]))
    for face, colour in zip(texture_faces(faces, WIDE, poses, lambda i: images[i], COARSE), colours, strict=True):
        if face.texture is not None:
            points = points_on(face)
            if face.kind != "wall":
                points = points[shapely.contains_xy(shapely.Polygon(polygon).buffer(-0.08), points[:, :2])]
            else:
                ends_away = np.linalg.norm((points - face.vertices[:, None])[..., :2], axis=2)
                points = points[(points[:, 2] > 0.08) & (points[:, 2] < 2.32) & (ends_away.min(axis=0) > 0.08)]
            away = np.abs(face_colours(face, points) - colour).max(axis=1)
            assert float((away > 40).mean()) < 0.003, face.name
            checked += 1
    assert checked == 8


@given(st.integers(0, 2**31), st.integers(1, 40), st.integers(1, 40))
def test_fill_continues_what_is_known(seed: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    weight = (rng.random((rows, columns)) < 0.3).astype(np.float32)
    weight[rng.integers(rows), rng.integers(columns)] = 1
    plain = np.full((rows, columns, 3), (30, 120, 220), np.float32)
    holed = np.where(weight[..., None] > 0, plain, 0).astype(np.float32)
    assert fill_smoothly(holed, weight) == pytest.approx(plain, abs=0.5)
    noisy = plain + rng.uniform(-20, 20, plain.shape).astype(np.float32)
    filled = fill_smoothly(noisy, weight)
    assert np.all(filled >= plain - 20.5) and np.all(filled <= plain + 20.5), "no colour beyond those around it"


def test_seams_run_where_views_agree() -> None:
    """Two views, the left one better on the left: the seam moves from the middle to where nothing shows it."""
    rows, columns, agree = 6, 30, 19
    cost = np.full((rows, columns, 8), np.inf, np.float32)
    view = np.full((rows, columns, 8), -1, np.int32)
    ramp = 0.02 * np.arange(columns)
    cost[..., 0], cost[..., 1] = ramp, ramp[::-1]
    view[..., 0], view[..., 1] = 4, 9
    deviation = np.full((rows, columns, 8), 25.0, np.float32)
    deviation[:, agree : agree + 2] = 0
    blocks = (rows * columns, 8)
    choice = choose_views(cost.reshape(blocks), view.reshape(blocks), deviation.reshape(blocks), (rows, columns))
    assert np.array_equal(choice, np.where(np.arange(columns) <= agree, 4, 9) * np.ones((rows, 1), int))


def test_notes_say_what_pictures_lack() -> None:
    """No image at all, one that sees a wall at a grazing angle, pictures above the limit: a valid result and a line."""
    taken = wide_tour()
    faces = extrude(box_layout())
    bare = texture_notes(faces, COARSE)
    assert len(bare) == 1 and "plain colours" in bare[0]
    assert texture_notes(wide_tour_textured(), COARSE) == tuple(
        note for note in texture_notes(wide_tour_textured(), COARSE) if "less than 50%" in note
    ), "nothing else is wrong with a whole tour"
    grazing = shoot(WIDE, (camera_at(0.4, 0.12, 0.0),))
    found = texture_faces(faces, grazing.camera, grazing.poses, grazing.load, COARSE)
    notes = " ".join(texture_notes(found, COARSE))
    assert "One image only shows" in notes and "grazing angle" in notes and "No image shows" in notes
    few = TextureConfig(metres_per_texel=0.01, max_texture_size=100)
    small = texture_faces(faces, taken.camera, taken.poses, taken.load, few)
    assert all(f.texture is not None and f.texture[..., 0].size <= 1.03 * 100**2 for f in small)
    assert any("at most 100 x 100 pixels" in note for note in texture_notes(small, few))
    assert texture_notes((), COARSE) == ()


@given(st.integers(0, 2**31), st.floats(1, 8))
@settings(max_examples=10)
def test_what_is_filled_is_as_grainy_as_what_was_seen(seed: int, noise: float) -> None:
    """A plain wall with a gaudy poster: the grain is as strong as in the plain part, and repeats without an edge."""
    rng = np.random.default_rng(seed)
    picture = (140 + rng.normal(0, noise, (300, 400, 1)) + np.zeros(3)).clip(0, 255).astype(np.uint8)
    picture[:150, :150] = rng.integers(0, 256, (150, 150, 3))
    alpha = np.full((300, 400), 255, np.uint8)
    alpha[:, 250:] = 0
    found = grain(picture, alpha)
    assert found is not None
    assert found.std() == pytest.approx(min(noise, 3.0), rel=0.35)
    assert abs(found.mean()) < 0.05
    inner, edge = np.abs(np.diff(found, axis=0)).mean(), np.abs(found[0] - found[-1]).mean()
    assert edge == pytest.approx(inner, rel=0.35)
    whole = repeated(found, slice(10, 400), slice(500, 800))
    assert whole.shape == (390, 300)
    assert whole[0, 0] == found[10, 500 % found.shape[1]]
    assert grain(picture, np.zeros_like(alpha)) is None
