"""View synthesis: the measures themselves against independent computations, and a room whose pictures are known."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from box_room import WIDE, box_layout, camera_at, shoot
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from small_build import Small

from recon.config import Config, TextureConfig
from recon.evaluate.explained import explained, partner
from recon.evaluate.fidelity import fidelity, fit_exposure, ssim
from recon.evaluate.views import view_scores
from recon.faces import extrude
from recon.geometry import Pose3
from recon.pipeline import build
from recon.raycast import RayScene
from recon.results import save_result
from recon.sequence.open import open_sequence

Picture = NDArray[np.float32]


def scenery(seed: int, shape: tuple[int, int] = (60, 80)) -> Picture:
    rng = np.random.default_rng(seed)
    blobs = [gaussian_filter(rng.normal(size=shape), 2.5) for _ in range(3)]
    return np.stack([128 + 160 * b for b in blobs], axis=2).clip(0, 255).astype(np.float32)


@given(st.integers(0, 2**31), st.floats(0.5, 30))
@settings(max_examples=15)
def test_psnr_and_ssim_are_those_of_the_books(seed: int, noise: float) -> None:
    first = scenery(seed)
    second = (first + np.random.default_rng(seed).normal(0, noise, first.shape)).astype(np.float32)
    found = fidelity(first, second, np.ones(first.shape[:2], bool))
    assert found.psnr == pytest.approx(20 * np.log10(255 / np.sqrt(np.mean((first - second) ** 2))), abs=1e-3)
    grey = [cv2.cvtColor(p, cv2.COLOR_RGB2GRAY).astype(float) for p in (first, second)]

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(gaussian_filter(values, 1.5, truncate=5 / 1.5)[10:-10, 10:-10])

    (x, y), (a, b) = grey, map(mean, grey)
    v, w, c = mean(x * x) - a * a, mean(y * y) - b * b, mean(x * y) - a * b
    c1, c2 = 2.55**2, 7.65**2
    expected = float(np.mean((2 * a * b + c1) * (2 * c + c2) / ((a * a + b * b + c1) * (v + w + c2))))
    inner = np.zeros(first.shape[:2], bool)
    inner[10:-10, 10:-10] = True
    whole = ssim(grey[0].astype(np.float32), grey[1].astype(np.float32), np.ones_like(inner))
    assert whole == pytest.approx(expected, abs=0.03), "borders differ"
    assert found.ssim == pytest.approx(whole, abs=1e-3)


def test_what_is_not_scored_has_no_say() -> None:
    first, second = scenery(1), scenery(1)
    mask = np.ones(first.shape[:2], bool)
    mask[:, 50:] = False
    second[:, 50:] = 0
    found = fidelity(first, second, mask)
    assert found.psnr > 100 and found.ssim == pytest.approx(1) and found.sharpness == pytest.approx(1, abs=1e-5)
    blurred = cv2.GaussianBlur(first, (0, 0), 3)
    assert fidelity(first, blurred, mask).sharpness < 0.6
    assert fidelity(blurred, first, mask).sharpness > 1.6


@given(st.floats(0.6, 1.6), st.floats(-20, 20), st.floats(0, 0.35))
@settings(max_examples=20)
def test_exposure_is_fitted_whatever_stands_in_front(gain: float, bias: float, covered: float) -> None:
    render = 60 + 0.4 * scenery(3)
    photo = gain * render + bias
    photo[:, : int(covered * photo.shape[1])] = (250, 20, 20)
    fitted = fit_exposure(photo, render, np.ones(render.shape[:2], bool))
    free = np.s_[:, int(0.4 * photo.shape[1]) :]
    assert fitted[free] == pytest.approx(photo[free].clip(0, 255), abs=3)


def test_what_stands_before_the_walls_is_not_explained() -> None:
    """The same room, but for the model half a metre wider: walls and their pictures no longer fit."""
    poses = (camera_at(1.6, 1.8, 0.1), camera_at(2.1, 2.0, 0.0))
    taken = shoot(WIDE, poses)
    right = extrude(box_layout())
    photos = taken.images[0], taken.images[1]
    good = explained(RayScene(right), WIDE, poses, photos)
    assert good.mean() > 0.6
    outwards = [np.append(0.8 * np.sign(f.vertices[:, :2] - [2.5, 1.8]), np.zeros((4, 1)), axis=1) for f in right]
    wide = tuple(replace(f, vertices=f.vertices + step) for f, step in zip(right, outwards, strict=True))
    level = np.zeros(good.shape, bool)
    level[good.shape[0] // 2 - 15 : good.shape[0] // 2 + 15] = True
    assert explained(RayScene(wide), WIDE, poses, photos)[level].mean() < 0.5 * good[level].mean()


def test_partners_stand_apart_and_look_the_same_way() -> None:
    poses: list[Pose3 | None] = [camera_at(1.0, 1.0, a) for a in (0.0, 0.0, 0.1, 3.0)]
    poses += [camera_at(1.4, 1.0, 0.3), camera_at(1.4, 1.0, 0.1), None, camera_at(4.0, 1.0, 0.0)]
    assert partner(0, poses, [1, 2, 3, 4, 5, 6, 7], WIDE) == 5
    assert partner(0, poses, [1, 2, 3, 6, 7], WIDE) is None


def thinned(drive: Path, place: Path) -> Path:
    """The drive with every second image."""
    place.mkdir()
    for name in ("camera.yaml", "scans.npz", "odometry.txt", "images", "groundtruth"):
        (place / name).symlink_to(drive / name)
    lines = [line for line in (drive / "images.txt").read_text().splitlines() if not line.startswith("#")]
    (place / "images.txt").write_text("\n".join(lines[::2]) + "\n")
    return place


def test_corridor_views(shared_data: Callable[[str], Path], tmp_path: Path) -> None:
    """What a build finds without textures is enough; numbers, coverage and sharpness hold, pictures are written.

    Every second image and 1 cm a texel: quicker, and harder than docs/benchmarks.md.
    """
    drive = thinned(shared_data("corridor"), tmp_path / "drive")
    config = Config(workers=1, texture=TextureConfig(metres_per_texel=0.01))
    save_result(build(open_sequence(drive), config, plan_only=True), tmp_path / "m.recon")
    scores = view_scores(drive, tmp_path / "m.recon", tmp_path / "views")
    assert 26.5 < scores.mean("psnr") < 31
    assert 0.84 < scores.mean("ssim") < 0.92
    assert 0.95 < scores.mean("coverage") <= 1
    assert 0.68 < scores.mean("sharpness") < 1
    assert len(scores.views) == 4 and scores.too_little == 0
    pictures = sorted((tmp_path / "views").glob("*.jpg"))
    assert [p.stem for p in pictures] == [Path(v.image).stem for v in scores.views]
    shown = cv2.imread(str(pictures[0]))
    assert shown is not None and shown.shape == (480, 3 * 640, 3)
    written = json.loads((tmp_path / "views" / "scores.json").read_text())
    assert written["psnr"] == pytest.approx(scores.mean("psnr"), abs=1e-3)


def test_views_need_no_ground_truth(small: Small, tmp_path: Path, run_recon: Any) -> None:
    """Labels of the result stand in for true ones, and the table says so; poses that are not true are not needed."""
    blind = tmp_path / "drive"
    shutil.copytree(small.sequence, blind, ignore=shutil.ignore_patterns("groundtruth"))
    result = tmp_path / "m.recon"
    shutil.copytree(small.folder, result)
    ran = run_recon("eval", blind, result, "--views")
    assert ran.status == 0 and not ran.errors
    assert any("the result's own labels (there are no true ones)" in line for line in ran.output)
    assert any(str(result / "views") in line for line in ran.output), "where the pictures are"
    written = json.loads((result / "views" / "scores.json").read_text())
    assert len(list((result / "views").glob("*.jpg"))) == len(written["views"]) > 0
    judged = view_scores(small.sequence, small.folder)
    assert written["psnr"] == pytest.approx(judged.mean("psnr"), abs=4), "nearly the same pixels as by true labels"
    assert {view["image"] for view in written["views"]} <= {view.image for view in judged.views}
    refused = run_recon("eval", blind, result)
    assert refused.status == 2 and len(refused.errors) == 1 and "groundtruth" in refused.errors[0]


def test_views_without_cameras_are_refused(small: Small, tmp_path: Path, run_recon: Any) -> None:
    result = tmp_path / "m.recon"
    shutil.copytree(small.folder, result)
    (result / "camera_trajectory.txt").unlink()
    ran = run_recon("eval", small.sequence, result, "--views")
    assert ran.status == 2 and len(ran.errors) == 1 and "camera_trajectory.txt" in ran.errors[0]
