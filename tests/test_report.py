"""The report: what it says, and that a browser shows it."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from small_build import Small

from recon.errors import InputError, OutputError
from recon.geometry import rotation2
from recon.report import write_report
from recon.report.charts import thinned
from recon.report.house import LARGEST, _scene
from recon.report.svg import Frame
from recon.results import load_model, save_result
from recon.results.photos import shrunk
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
    save_result(blind, tmp_path / "blind.recon")
    page = read(tmp_path / "blind.recon")
    assert "Photos beside the model" not in page and "The model" in page
    nothing = replace(blind.model, faces=(), layout=replace(blind.model.layout, walls=(), rooms=(), openings=()))
    save_result(replace(blind, model=nothing), tmp_path / "nothing.recon")
    page = read(tmp_path / "nothing.recon")
    assert "<h2>The model</h2>" not in page and "<h2>Time</h2>" in page


def test_the_3d_view_holds_every_face_but_ceilings_in_pictures_of_bounded_size(small: Small) -> None:
    import trimesh

    large = tuple(
        face if face.texture is None else replace(face, texture=np.repeat(np.repeat(face.texture, 6, 0), 6, 1))
        for face in small.build.model.faces
    )
    scene = trimesh.load_scene(io.BytesIO(_scene(replace(small.build.model, faces=large))), file_type="glb")
    faces = [face for face in large if face.kind != "ceiling"]
    assert sorted(scene.geometry) == sorted(face.name for face in faces)
    assert scene.area == pytest.approx(sum(face_area(face.vertices, face.triangles) for face in faces), rel=1e-3)
    sides = [max(m.size) for g in scene.geometry.values() if (m := g.visual.material.baseColorTexture) is not None]
    assert sides and max(sides) <= LARGEST


def face_area(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> float:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def outside_links(page: str) -> str:
    """The page without the paragraph of files."""
    return re.sub(r"<p>Files: .*?</p>", "", page)


def test_written_again_it_is_the_same_but_for_files_that_are_not_there(
    small: Small, tmp_path: Path, run_recon: Callable[..., Any]
) -> None:
    there = tmp_path / "far" / "away"
    there.mkdir(parents=True)
    done = run_recon("report", small.folder, "-o", there / "r.html")
    assert done.status == 0, done.errors
    page = (there / "r.html").read_text(encoding="utf-8")
    assert outside_links(page) == outside_links(read(small.folder))
    targets = re.findall(r'<a href="([^"]*)"', page)
    assert targets and all((there / unquote(target)).exists() for target in targets)
    assert not any("usd" in target for target in targets)  # was named, and never exported here


def test_images_left_out_are_shown_once_they_were_compared(small: Small, tmp_path: Path) -> None:
    folder = tmp_path / "m.recon"
    shutil.copytree(small.folder, folder)
    (folder / "views").mkdir()
    picture = np.full((30, 3000, 3), 90, np.uint8)
    views = []
    for k, psnr in enumerate((21.0, 30.0, 25.0, 18.5)):
        cv2.imwrite(str(folder / "views" / f"{k}.jpg"), picture)
        views.append({"image": f"images/{k}.png", "psnr": psnr})
    means = {"psnr": 23.6, "ssim": 0.9, "sharpness": 0.8, "coverage": 0.97}
    (folder / "views" / "scores.json").write_text(json.dumps({**means, "views": views}), encoding="utf-8")
    write_report(folder)
    part = read(folder).split("<h2>Images left out</h2>")[1].split("<h2>")[0]
    assert "4 images" in part and "23.6 dB" in part and "97%" in part
    assert re.findall(r"<figcaption>([^<]*)", part) == [
        "3.png, worst: 18.5 dB",
        "0.png, middling: 21.0 dB",
        "1.png, best: 30.0 dB",
    ]
    data = base64.b64decode(re.search(r'base64,([^"]*)"', part)[1])  # type: ignore[index]
    shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert shown is not None and shown.shape[1] == 1440


def test_damaged_results_are_named(small: Small, tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    folder = tmp_path / "m.recon"
    shutil.copytree(small.folder, folder)
    (folder / "metrics.json").write_text('{"seconds": 3}', encoding="utf-8")
    with pytest.raises(InputError, match=r"metrics.json: is damaged"):
        write_report(folder)
    assert read(folder) == read(small.folder)
    (folder / "metrics.json").unlink()
    done = run_recon("report", folder)
    assert done.status == 2 and "metrics.json: no such file" in done.errors[-1]
    done = run_recon("report", tmp_path / "nowhere")
    assert done.status == 2 and len(done.errors) == 1 and "nowhere" in done.errors[0]
    done = run_recon("report", small.folder, "-o", tmp_path / "report.pdf")
    assert done.status == 2 and "expected .html" in done.errors[-1]


def test_the_map_has_every_wall_where_it_is(small: Small) -> None:
    """Lengths in the picture are those of the walls, at one scale."""
    page = read(small.folder)
    drawn = re.findall(r'<path class="wall"[^>]* d="M([^"]*)"><title>wall (\d+), (\w+),', page)
    walls = {wall.id: wall for wall in load_model(small.folder).layout.walls}
    assert sorted(int(name) for _, name, _ in drawn) == sorted(walls)
    scales = []
    for d, name, source in drawn:
        a, b = (np.array(p.split(","), float) for p in d.split())
        wall = walls[int(name)]
        assert source == wall.source
        step = (b - a) * [1, -1]
        scales.append(np.linalg.norm(step) / wall.length)
        assert step / np.linalg.norm(step) == pytest.approx(wall.direction, abs=0.01)
    assert np.ptp(scales) < 0.01 * np.mean(scales)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=20), st.floats(-3, 3))
@settings(deadline=None, max_examples=50)
def test_a_frame_holds_its_points_and_keeps_their_distances(points: list[tuple[float, float]], angle: float) -> None:
    turn, there = rotation2(angle), np.array(points)
    assume(float(np.ptp(there @ turn.T, axis=0)[0]) > 1.0)
    frame = Frame.around(there @ turn.T, 400, turn)
    places = frame.place(there)
    assert (places > 0).all() and (places < [frame.width, frame.height]).all()
    apart = np.linalg.norm(np.diff(there, axis=0), axis=1)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1) == pytest.approx(frame.scale * apart, abs=1e-6)


def test_long_charts_keep_their_mean_square() -> None:
    times = np.arange(10_000.0)
    values = np.sin(times / 900)
    values[::7] = np.nan
    x, y = thinned(times, values)
    assert len(x) == 400 and (np.diff(x) > 0).all()
    assert np.mean(y**2) == pytest.approx(np.nanmean(values**2), rel=1e-3)
    assert thinned(times[:5], values[:5])[0] == pytest.approx([1, 2, 3, 4])


def test_a_disk_that_fills_up_leaves_the_result_that_was_there(small: Small, tmp_path: Path) -> None:
    """A limit on the size of files stands in for the disk: the pictures go through, the page does not."""
    resource = pytest.importorskip("resource", reason="no limits on this system")
    folder = tmp_path / "m.recon"
    shutil.copytree(small.folder, folder)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(read(small.folder)) // 2, hard))
    try:
        with pytest.raises(OutputError, match=r"m.recon: cannot be written: File too large"):
            save_result(small.build, folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    assert list(tmp_path.iterdir()) == [folder]


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


MEASURE = """<script>
const sketch = getComputedStyle(document.querySelector(".sketch")).display, sheet = document.querySelector(".scroll");
document.title = `${document.documentElement.scrollWidth} of ${window.innerWidth}, ${sketch}, ${sheet.scrollLeft}`;
</script>"""


@pytest.mark.parametrize(("width", "more"), [(1100, ""), (500, "--force-dark-mode")])
def test_a_browser_shows_it_on_wide_and_narrow_screens(
    small: Small, browse: Callable[..., str], tmp_path: Path, width: int, more: str
) -> None:
    page = tmp_path / "report.html"
    page.write_text(read(small.folder).replace("</body>", MEASURE + "</body>"), encoding="utf-8")
    seen = browse(page, tmp_path / "page.png", (width, 1600), *filter(None, [more]))
    needed, there = (int(n) for n in re.search(r"<title>(\d+) of (\d+), ", seen).groups())  # type: ignore[union-attr]
    assert there == width and needed <= there
    sketched, left = re.search(r"<title>.*, (\w+), (\d+)", seen).groups()  # type: ignore[union-attr]
    assert (sketched == "block") == (int(left) > 0) == (width < 700)  # where the sheet is too wide there is a sketch
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
    # colours are those of the textures: neither washed out nor dark
    textures = [face.texture for face in small.build.model.faces if face.texture is not None and face.kind != "ceiling"]
    wanted = np.concatenate([t.reshape(-1, 3).mean(axis=1) for t in textures]).mean()
    assert picture[covered].mean() == pytest.approx(wanted, rel=0.25)
    rim = np.concatenate([covered[0], covered[-1], covered[:, 0], covered[:, -1]])
    assert not rim.any()  # the whole building is in view
