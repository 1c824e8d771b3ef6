"""The report: what it says, and that a browser shows it."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_build import Small

from recon.report import write_report
from recon.report.frames import shrunk
from recon.sequence.camera import Camera

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def read(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def test_nothing_is_loaded_from_elsewhere(small: Small) -> None:
    page = read(small.folder)
    outside = re.sub(r'srcdoc="[^"]*"', "", page)
    targets = re.findall(r'(?:src|href)="([^"]*)"', outside)
    assert targets and all(t.startswith(("data:", "#")) or not re.match(r"[a-z]+:|/", t) for t in targets)
    inner = html.unescape(re.search(r'srcdoc="([^"]*)"', page)[1])  # type: ignore[index]
    assert inner.startswith("<!DOCTYPE html>") and not re.search(r'<[^>]+(src|href)="?https?:', inner)
    assert "url(http" not in page and "@import" not in page


def test_links_lead_to_the_files_beside_the_folder(small: Small) -> None:
    page = read(small.folder)
    assert 'href="../out/the%20model.usd"' in page and 'href="plan.dxf"' in page
    inside = [t for t in re.findall(r'<a href="([^"]*)"', page) if not t.startswith(("..", "plan.dxf", "data:"))]
    assert inside and all((small.folder / target).exists() for target in inside)


def test_warnings_and_assumptions_are_said_and_names_are_text(small: Small) -> None:
    page = read(small.folder)
    assert "wheels &lt;slip&gt;; give odometry.txt" in page
    assert "What was assumed" in page and "<two>" not in page
    for title in ("The model", "The plan", "Trajectory and accuracy", "Photos beside the model", "Rooms", "Time"):
        assert f"<h2>{title}</h2>" in page
    areas = [float(a) for a in re.findall(r"<tr><td>[^<]*</td><td>(\d+\.\d\d)</td>", page.split("<h2>Rooms</h2>")[1])]
    assert sum(areas[: len(small.build.model.layout.rooms)]) == pytest.approx(5 * 4 + 3.8 * 4, rel=0.03)


def test_a_build_without_images_has_a_report(small: Small, tmp_path: Path) -> None:
    bare = tuple(replace(face, texture=None, sources=None) for face in small.build.model.faces)
    model = replace(small.build.model, faces=bare)
    sequence = replace(small.build.sequence, images=None, camera=None)
    blind = replace(small.build, model=model, sequence=sequence, calibration=None, map_from_camera=())
    write_report(blind, tmp_path)
    page = read(tmp_path)
    assert "Photos beside the model" not in page and "The model" in page
    nothing = replace(blind.model, faces=(), layout=replace(blind.model.layout, walls=(), rooms=(), openings=()))
    write_report(replace(blind, model=nothing), tmp_path)
    assert "<h2>The model</h2>" not in read(tmp_path) and "<h2>Time</h2>" in read(tmp_path)


def test_a_shrunk_camera_sees_the_same() -> None:
    matrix = np.array([[300.0, 0, 310.2], [0, 305.0, 241.7], [0, 0, 1]])
    camera = Camera(640, 480, matrix, "plumb_bob", np.array([-0.2, 0.05, 0.001, 0.002, 0.0]))
    small = shrunk(camera, 160)
    points = np.array([[0.3, -0.2, 2.0], [-1.0, 0.5, 3.0]])
    assert (small.width, small.height) == (160, 120)
    assert small.project(points) == pytest.approx((camera.project(points) + 0.5) / 4 - 0.5)


@pytest.fixture
def browse(tmp_path: Path) -> Callable[..., str]:
    """`browse(page, picture, size, ...)`: the page as a browser has it, whose console must stay silent."""
    found = [path for name in BROWSERS if (path := shutil.which(name))]
    if not found:
        pytest.skip("no Chromium or Chrome is installed")
    quiet = ["--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
    drawn = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"]

    def run(page: Path, picture: Path, size: tuple[int, int], *more: str) -> str:
        window = f"--window-size={size[0]},{size[1]}"
        look = [
            "--dump-dom",
            f"--screenshot={picture}",
            "--virtual-time-budget=20000",
            "--enable-logging=stderr",
            *more,
        ]
        command = [
            found[0],
            "--headless",
            "--no-sandbox",
            *quiet,
            *drawn,
            f"--user-data-dir={tmp_path}/profile",
            window,
        ]
        seen = subprocess.run([*command, *look, *more, page.as_uri()], capture_output=True, text=True, timeout=240)
        assert seen.returncode == 0 and picture.is_file()
        said = [line for line in seen.stderr.splitlines() if "CONSOLE" in line]
        # A software renderer tells of its own slowness; that is no error of the page.
        assert [line for line in said if "GPU stall" not in line] == []
        return seen.stdout

    return run


MEASURE = "<script>document.title = document.documentElement.scrollWidth + ' of ' + window.innerWidth</script>"


@pytest.mark.parametrize(("width", "more"), [(1100, ""), (500, "--force-dark-mode")])
def test_a_browser_shows_it_on_wide_and_narrow_screens(
    small: Small, browse: Callable[..., str], tmp_path: Path, width: int, more: str
) -> None:
    page = tmp_path / "report.html"
    page.write_text(read(small.folder).replace("</body>", MEASURE + "</body>"), encoding="utf-8")
    seen = browse(page, tmp_path / "page.png", (width, 1600), *filter(None, [more]))
    needed, there = (int(n) for n in re.search(r"<title>(\d+) of (\d+)</title>", seen).groups())  # type: ignore[union-attr]
    assert there == width and needed <= there
    picture = cv2.imread(str(tmp_path / "page.png"), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    margin = float(np.median(picture[:, 2]))
    assert margin < 60 if more else margin > 240


def test_a_browser_turns_the_model_in_3d(small: Small, browse: Callable[..., str], tmp_path: Path) -> None:
    """The inner page alone: the model fills a good part of it, in more than the grey of its background."""
    inner = html.unescape(re.search(r'srcdoc="([^"]*)"', read(small.folder))[1])  # type: ignore[index]
    (tmp_path / "house.html").write_text(inner, encoding="utf-8")
    seen = browse(tmp_path / "house.html", tmp_path / "house.png", (960, 600))
    assert "<canvas" in seen
    picture = cv2.imread(str(tmp_path / "house.png"))
    assert picture is not None
    covered = np.abs(picture.astype(int) - 255).sum(axis=2) > 30
    assert 0.1 < covered.mean() < 0.8
    assert len(np.unique(picture[covered] // 16, axis=0)) > 30
    rim = np.concatenate([covered[0], covered[-1], covered[:, 0], covered[:, -1]])
    assert not rim.any()  # the whole building is in view
