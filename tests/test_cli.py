"""The command line: messages, progress, interruption. The build itself is stood in for here; others test it."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from recon.cli.progress import PlainProgress, terminal_progress
from recon.files import atomic_path
from recon.measured import NOTHING, Measured
from recon.model import Face, Layout, Model, Room, Wall
from recon.progress import SILENT, Progress

CORNERS = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]


def square_room(**layout: Any) -> Model:
    """A room of 4 m x 3 m with walls known to 2, 4, 4 mm and one inferred."""
    points = np.array(CORNERS)
    walls = tuple(
        Wall(
            i,
            points[i],
            points[(i + 1) % 4],
            (0.002, 0.004, 0.004, 0.5)[i],
            0.001,
            "inferred" if i == 3 else "lidar",
            9,
        )
        for i in range(4)
    )
    faces = tuple(_face(wall) for wall in walls)
    return Model("room", Layout(walls, (Room(0, "room", points),), **layout), faces)


def _face(wall: Wall) -> Face:
    corners = [[*wall.start, 0.0], [*wall.end, 0.0], [*wall.end, 2.5], [*wall.start, 2.5]]
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return Face(f"wall_{wall.id:03d}", "wall", wall.id, np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), uv)


@dataclass(frozen=True)
class StandInBuild:
    model: Model
    warnings: tuple[str, ...] = ()
    measured: Measured = NOTHING
    calibration: Any = None


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """`stand_in(build=..., save=...)`: what `recon build` calls instead of the pipeline and of writing a result."""

    def save_nothing(_build: Any, folder: Path, _outputs: Any) -> None:
        folder.mkdir()

    def replace(build: Callable[..., Any], save: Callable[..., None] = save_nothing) -> None:
        for name, attribute, function in (("pipeline", "build", build), ("results", "save_result", save)):
            module = ModuleType(f"recon.{name}")
            setattr(module, attribute, function)
            monkeypatch.setitem(sys.modules, module.__name__, module)

    return replace


def test_five_lines_say_what_was_found(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    seen: list[Any] = []

    def build(sequence: Any, config: Any, progress: Progress, measured: Any) -> StandInBuild:
        seen.append((sequence.name, config.seed, config.workers))
        with progress.stage("image lines", total=2, unit="images") as stage:
            stage.advance()
            stage.advance()
        return StandInBuild(square_room(ceiling_height=2.5, sigma_ceiling=0.012), ("the images disagree by 4 cm",))

    stand_in(build)
    output = tmp_path / "model.glb"
    result = run_recon("build", tiny_sequence, "-o", output, "--seed", 7, "--workers", 1)
    assert result.status == 0
    assert seen == [("drive", 7, 1)]
    assert result.output == [
        "Walls:     14.0 m in 4 walls (no texture, 1 inferred)",
        "Rooms:     1 room, 12.0 m2 of floor",
        "Height:    ceiling at 2.50 m +- 1.2 cm",
        "Accuracy:  a wall's place is known to 4.0 mm, its direction to 0.06 deg (median sigma)",
        f"Open:      {output}",
    ]
    assert result.errors[0].startswith("image lines: 2 images in ")
    assert result.errors[-1] == "recon: warning: the images disagree by 4 cm"
    assert output.read_bytes()[:4] == b"glTF"
    assert (tmp_path / "model.recon").is_dir()


def test_report_is_opened_first_and_an_unseen_ceiling_is_said(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    def save(_build: StandInBuild, folder: Path, _outputs: Any) -> None:
        folder.mkdir()
        (folder / "report.html").write_text("")

    stand_in(lambda *_: StandInBuild(square_room()), save)
    result = run_recon(
        "build", tiny_sequence, "-o", tmp_path / "a.stl", "-o", tmp_path / "b.json", "--work", tmp_path / "w"
    )
    assert result.output[2] == "Height:    ceiling not seen, 2.60 m assumed"
    assert result.output[4] == f"Open:      {tmp_path}/w/report.html, then {tmp_path}/a.stl, {tmp_path}/b.json"


def test_quiet_says_nothing(tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]) -> None:
    stand_in(lambda *_: StandInBuild(square_room(), ("odd",)))
    (tiny_sequence / "scans.csv").write_text("a second source, which is warned of")
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "model.stl", "-q")
    assert (result.status, result.output, result.errors) == (0, [], [])


def test_verbose_and_default_warn_of_the_sequence(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    warning = "both scans.npz and scans.csv are there: scans.csv is not read"
    stand_in(lambda sequence, *_: StandInBuild(square_room(), sequence.warnings))
    (tiny_sequence / "scans.csv").write_text("")
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "model.stl", "-v")
    assert result.errors.count(f"recon: warning: {warning}") == 1


@pytest.mark.parametrize("moment", ["build", "save"])
def test_interruption_leaves_nothing_half_written(
    moment: str, tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background start with it ignored

    def interrupted(*_: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        signal.sigtimedwait([], 1)

    def half_saved(_build: Any, folder: Path, _outputs: Any) -> None:
        with atomic_path(folder) as temporary:
            temporary.mkdir()
            (temporary / "layout.json").write_text("{")
            interrupted()

    stand_in(interrupted if moment == "build" else lambda *_: StandInBuild(square_room()), half_saved)
    (tmp_path / "out").mkdir()
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "out" / "model.usd")
    assert result.status == 130
    assert result.errors[-1] == "recon: interrupted"
    assert list((tmp_path / "out").iterdir()) == []


def test_termination_unwinds(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    def terminated(*_: Any) -> None:
        with atomic_path(tmp_path / "part.bin") as temporary:
            temporary.write_bytes(b"half")
            os.kill(os.getpid(), signal.SIGTERM)
            signal.sigtimedwait([], 1)

    stand_in(terminated)
    before = sorted(tmp_path.iterdir())
    assert run_recon("build", tiny_sequence, "-o", tmp_path / "model.usd").status == 143
    assert sorted(tmp_path.iterdir()) == before


def test_bugs_keep_their_traceback(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    def bug(*_: Any) -> None:
        raise ZeroDivisionError("a bug")

    stand_in(bug)
    with pytest.raises(ZeroDivisionError):
        run_recon("build", tiny_sequence, "-o", tmp_path / "model.usd")


def test_full_disk_is_one_line(
    tiny_sequence: Path, tmp_path: Path, run_recon: Any, stand_in: Callable[..., None]
) -> None:
    def full(_build: Any, folder: Path, _outputs: Any) -> None:
        raise OSError(28, "No space left on device", str(folder))

    stand_in(lambda *_: StandInBuild(square_room()), full)
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "model.usd", "-q")
    assert result.status == 2
    assert result.errors == [f"recon: {tmp_path}/model.recon: no space left on the device"]


@pytest.mark.parametrize(
    "arguments", [[], ["drive"], ["drive", "--seed", "-1"], ["drive", "--workers", "0"], ["--nope"]]
)
def test_wrong_usage_is_status_2(arguments: list[str], run_recon: Any) -> None:
    result = run_recon("build", *arguments)
    assert result.status == 2
    assert result.errors[0].startswith("Usage: recon build")
    assert result.output == []


def test_help_through_a_closed_pipe_is_quiet() -> None:
    command = f"{sys.executable} -c 'from recon.cli.main import main; main()' build --help | true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    assert "Traceback" not in done.stderr


def test_plain_progress_is_a_line_a_stage(capsys: pytest.CaptureFixture[str]) -> None:
    progress = PlainProgress()
    with progress.stage("calibration"):
        pass
    with progress.stage("image lines", total=3, unit="images") as stage:
        stage.advance(3)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "calibration: 0.0 s"
    assert lines[1].startswith("image lines: 3 images in 0.0 s")
    assert len(lines) == 2


def test_long_stages_report_on_the_way(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 5.0, 12.0, 13.0, 40.0])
    monkeypatch.setattr("recon.cli.progress.time.monotonic", lambda: next(clock))
    with PlainProgress().stage("image lines", total=30, unit="images") as stage:
        for _ in range(3):
            stage.advance(10)
    assert capsys.readouterr().err.splitlines() == [
        "image lines: 20 of 30 images after 12 s",
        "image lines: 30 images in 40.0 s, 0.8/s",
    ]


def test_progress_is_silent_when_asked() -> None:
    assert terminal_progress(quiet=True) is SILENT
    assert isinstance(terminal_progress(quiet=False), PlainProgress)  # the tests' standard error is no terminal


def test_bars_with_rates_on_a_terminal() -> None:
    code = """
import time
from recon.cli.progress import terminal_progress
progress = terminal_progress(quiet=False)
print(type(progress).__name__)
with progress.stage("image lines", total=5, unit="images") as stage:
    for _ in range(5):
        stage.advance(); time.sleep(0.05)
"""
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100"}
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=follower, env=environment, check=True, text=True
    )
    os.close(follower)
    shown = b""
    while not shown.endswith(b"/s\r\n"):
        shown += os.read(leader, 65536)
    os.close(leader)
    text = shown.decode()
    assert done.stdout.strip() == "BarProgress"
    assert "━" in text
    assert "images" in text
    assert text.splitlines()[-1].split("\r")[-1].endswith("/s")
