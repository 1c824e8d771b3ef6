"""CARMEN logs of a drive through a room of known size: what is read must lie on its walls."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, apply2, between2, compose2, inverse2
from recon.sequence.no_return import no_return_limit
from recon.sequence.open import open_sequence
from recon.sequence.sequence import Sequence as Drive

HALF = np.array([4.0, 2.5])
PERIOD = 0.2
EVERY = 5
"""A scan of a corrected log is written for so many readings of the wheels."""


def robot(index: float) -> Array:
    """odom_from_robot at reading `index`."""
    s = index / 40
    return np.array([2 * np.sin(2 * s), np.cos(3 * s) - 0.2, 0.3 + 3 * s])


def ranges(at: Array, beams: int = 180, start: float = -90.0, step: float = 1.0) -> Array:
    angles = at[2] + np.radians(start + step * np.arange(beams))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray((np.where(rays > 0, HALF - at[:2], -HALF - at[:2]) / rays).min(axis=1))


def off_walls(drive: Drive) -> float:
    """m: how far the farthest return lies from the walls, where the odometry puts it, its first pose being the true."""
    assert drive.odometry is not None
    poses = compose2(compose2(robot(0), inverse2(drive.odometry.poses[0])), drive.odometry.at(drive.scans.timestamps))
    worst = 0.0
    for i in range(len(drive.scans)):
        points = apply2(poses[i], drive.scans.points(i))
        worst = max(worst, float(np.abs((np.abs(points) - HALF).max(axis=1)).max()))
    return worst


def text(values: Sequence[float] | Array) -> str:
    return " ".join(f"{v:.6f}" for v in values)


def flaser(values: Array, laser: Array, own: Array, stamp: str, logger: str | None = None) -> str:
    return f"FLASER {len(values)} {text(values)} {text(laser)} {text(own)} {stamp} host {logger or stamp}"


def odom(at: Array, stamp: str, logger: str | None = None) -> str:
    return f"ODOM {text(at)} 0 0 0 {stamp} host {logger or stamp}"


def read(lines: Sequence[str], folder: Path, name: str = "drive.log") -> Drive:
    (folder / name).write_text("\n".join(["# message formats defined: ODOM FLASER", *lines]) + "\n")
    return open_sequence(folder / name)


def raw_log(count: int = 40, stamp: Callable[[int], str] = lambda i: f"{PERIOD * i:g}") -> list[str]:
    """A scan and its odometry at each reading, as the logger wrote them."""
    lines = []
    for i in range(count):
        at = robot(i)
        lines += [odom(at, stamp(i)), flaser(ranges(at), at, at, stamp(i))]
    return lines


def corrected_log(seed: int, neff: bool = True, stamp: Callable[[int], str] = lambda i: f"{PERIOD * i:g}") -> list[str]:
    """As GMapping writes it: at every scan the map jumps, and what the wheels say goes on from there."""
    rng, lines = np.random.default_rng(seed), []
    map_from_odom = np.zeros(3)
    for i in range(60):
        lines.append(odom(compose2(map_from_odom, robot(i)), stamp(i)))
        if i % EVERY == 0:
            map_from_odom = compose2(rng.normal(0, [0.2, 0.2, 0.1]), map_from_odom)
            estimate = compose2(map_from_odom, robot(i))
            lines.append(flaser(ranges(robot(i)), estimate, estimate, stamp(i)))
            lines += ["NEFF 17.3"] * neff + [odom(estimate, "0")]
    return lines


@given(seed=st.integers(0, 10**6), neff=st.booleans())
@settings(max_examples=10, deadline=None)
def test_odometry_of_a_corrected_log_is_chained_between_corrections(
    seed: int, neff: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    drive = read(corrected_log(seed, neff), tmp_path_factory.mktemp("log"))
    assert any("odometry is what was added between corrections" in w for w in drive.warnings)
    assert drive.odometry is not None and len(drive.odometry) == 60 and len(drive.scans) == 60 // EVERY
    steps = between2(drive.odometry.poses[:-1], drive.odometry.poses[1:])
    truth = np.array([robot(i) for i in range(60)])
    np.testing.assert_allclose(steps, between2(truth[:-1], truth[1:]), atol=5e-6)
    assert off_walls(drive) < 1e-3


def test_raw_log_is_not_taken_for_a_corrected_one(tmp_path: Path) -> None:
    """Also where the robot stands, and where the odometry comes after each scan."""
    for lines in (
        raw_log(),
        [line for i in range(30) for line in reversed(raw_log()[2 * i : 2 * i + 2])],
        [line.replace(f"{PERIOD * 5:g} host {PERIOD * 5:g}", "1.0 host 1.0") for line in raw_log()],
    ):
        drive = read(lines, tmp_path)
        assert drive.warnings == ()
        assert off_walls(drive) < 1e-5


@pytest.mark.parametrize("source", ["ODOM", "FLASER", "ROBOTLASER1", "RAWLASER1"])
def test_odometry_is_moved_to_the_scanner(source: str, tmp_path: Path) -> None:
    """The scanner is ahead of the robot's middle; only RAWLASER1 does not say so."""
    mounting = np.array([0.25, 0.0, 0.0]) if source != "RAWLASER1" else np.zeros(3)
    lines = []
    for i in range(30):
        at = robot(i)
        laser, stamp = compose2(at, mounting), f"{PERIOD * i:g}"
        if source in ("ODOM", "RAWLASER1"):
            lines.append(odom(at, stamp))
        if source in ("ODOM", "FLASER"):
            lines.append(flaser(ranges(laser), laser, at, stamp))
            continue
        values = ranges(laser, 361, -90, 0.5)
        values[5] = 20.0  # its limit
        head = f"{source} 0 -1.570796 3.141593 0.008726646 20.0 0.01 0 361 {text(values)} 2 7 9"
        poses = f" {text(laser)} {text(at)} 0 0 0.1 0.1 0.5" if source == "ROBOTLASER1" else ""
        lines.append(f"{head}{poses} {stamp} host {stamp}")
    drive = read(lines, tmp_path)
    assert drive.warnings == ()
    assert drive.odometry is not None
    np.testing.assert_allclose(drive.odometry.poses[7], compose2(robot(7), mounting), atol=1e-5)
    if "1" in source:
        assert np.isinf(drive.scans.ranges[:, 5]).all()
        assert drive.scans.angle_increment == pytest.approx(np.radians(0.5), rel=1e-5)
    for i in range(30):
        off = np.abs((np.abs(apply2(drive.odometry.poses[i], drive.scans.points(i))) - HALF).max(axis=1))
        assert off.max() < 1e-4


def test_one_estimate_beside_raw_odometry(tmp_path: Path) -> None:
    """Where the two poses of a scan wander apart, the robot's is the odometry and PARAM says where the scanner is."""
    rng, lines = np.random.default_rng(3), ["PARAM robot_frontlaser_offset 0.1 nohost 0"]
    for i in range(30):
        laser = compose2(robot(i), np.array([0.1, 0, 0]))
        lines.append(flaser(ranges(laser), laser + rng.normal(0, 0.3, 3), robot(i), f"{i}"))
    drive = read(lines, tmp_path)
    assert drive.odometry is not None
    np.testing.assert_allclose(drive.odometry.poses[9], compose2(robot(9), np.array([0.1, 0, 0])), atol=1e-5)


@pytest.mark.parametrize(
    ("beams", "start", "step"), [(180, -90, 1), (181, -90, 1), (360, -90, 0.5), (361, -90, 0.5), (1081, -135, 0.25)]
)
def test_bearings_follow_from_the_number_of_beams(beams: int, start: float, step: float, tmp_path: Path) -> None:
    lines = [flaser(ranges(robot(i), beams, start, step), robot(i), robot(i), f"{i}") for i in range(5)]
    drive = read(lines, tmp_path)
    assert drive.scans.ranges.shape == (5, beams)
    assert off_walls(drive) < 1e-4


# no return


@pytest.mark.parametrize("values", [(50.0,), (81.83,), (81.91,), (51.14, 51.15, 51.16), (50.0, 51.15), (8.0,)])
@given(seed=st.integers(0, 10**6), share=st.floats(0.01, 0.6))
@settings(max_examples=6, deadline=None)
def test_the_number_for_no_return_is_found(values: tuple[float, ...], seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    scans = np.array([ranges(robot(i)) for i in range(60)]).astype(np.float32)
    none = rng.random(scans.shape) < share
    scans[none] = rng.choice(values, int(none.sum()))
    limit = no_return_limit(scans)
    assert max(scans[~none]) < limit <= min(values)


@given(seed=st.integers(0, 10**6), stands=st.booleans(), noise=st.sampled_from([0.0, 0.01, 0.03]))
@settings(max_examples=20, deadline=None)
def test_walls_are_not_taken_for_no_return(seed: int, stands: bool, noise: float) -> None:
    """Also not those far away that a robot looks at while it stands; ranges come in centimetres."""
    rng = np.random.default_rng(seed)
    start = float(rng.uniform(0, 100))
    scans = np.array([ranges(robot(start + (0 if stands else i / 5))) for i in range(200)])
    scans = np.round(scans + rng.normal(0, noise, scans.shape) if noise else scans, 2)
    assert no_return_limit(scans.astype(np.float32)) == np.inf


def test_a_beam_that_is_always_at_the_limit(tmp_path: Path) -> None:
    scans = np.array([ranges(robot(i)) for i in range(60)]).astype(np.float32)
    scans[:, -1] = 50.0
    assert 40 < no_return_limit(scans) <= 50
    scans[:, -1] = 5e6  # no range of any scanner
    assert 4 < no_return_limit(scans) < 5e6
    assert no_return_limit(np.full((3, 4), np.nan, np.float32)) == np.inf


# time


@dataclass(frozen=True)
class BrokenClock:
    stamp: Callable[[int], str]
    said: str
    span: float
    """s between the first scan and the last of 40."""


CLOCKS = {
    "zero": BrokenClock(lambda i: "0", "tell nothing", 39 * 0.2),
    "six digits of a date": BrokenClock(lambda i: f"{976052857 + 0.2 * i:g}", "tell nothing", 39 * 0.2),
    "whole seconds": BrokenClock(lambda i: f"{int(100000 + 0.2 * i)}", "are rounded", 39 * 0.2),
    "wrapped microseconds": BrokenClock(lambda i: f"{(4290 + 0.2 * i) % 4294.967296:.6f}", "start again 1 time", 7.8),
    "wrapped seconds": BrokenClock(lambda i: f"{(2**32 - 3 + 0.2 * i) % 2**32:.6f}", "start again 1 time", 7.8),
}


@pytest.mark.parametrize("name", CLOCKS)
@pytest.mark.parametrize("corrected", [False, True])
def test_time_is_rebuilt(name: str, corrected: bool, tmp_path: Path) -> None:
    """One clock for scans and odometry, and it ends up right where anything can be known of it."""
    clock = CLOCKS[name]
    lines = corrected_log(1, True, clock.stamp) if corrected else raw_log(stamp=clock.stamp)
    drive = read(lines, tmp_path)
    assert len([w for w in drive.warnings if clock.said in w]) == 1
    assert off_walls(drive) < 0.01
    assert len(drive.scans) == (60 // EVERY if corrected else 40)
    span = float(np.ptp(drive.scans.timestamps))
    assert span == pytest.approx(clock.span * (55 / 39 if corrected else 1), rel=0.1)
    assert drive.odometry is not None
    at = np.searchsorted(drive.odometry.timestamps, drive.scans.timestamps[3])
    assert abs(drive.odometry.timestamps[at] - drive.scans.timestamps[3]) < 1e-6


def test_stamps_of_the_logger_stand_in(tmp_path: Path) -> None:
    lines = [odom(robot(i), "0", f"{PERIOD * i:g}") for i in range(20)]
    lines = [
        x for i in range(20) for x in (lines[i], flaser(ranges(robot(i)), robot(i), robot(i), "0", f"{PERIOD * i:g}"))
    ]
    drive = read(lines, tmp_path)
    assert any("those of the logger are used" in w for w in drive.warnings)
    np.testing.assert_allclose(drive.scans.timestamps, PERIOD * np.arange(20), atol=1e-9)
    assert off_walls(drive) < 1e-4


def test_few_wrong_stamps_cost_only_their_records(tmp_path: Path) -> None:
    drive = read(raw_log(stamp=lambda i: {7: "1e7", 20: "0.5"}.get(i, f"{PERIOD * i:g}")), tmp_path)
    assert len(drive.scans) == 38
    assert any(w.startswith("2 scans of drive.log left out (of 40)") for w in drive.warnings)
    assert any(w.startswith("2 odometry records left out (of 40)") for w in drive.warnings)
    assert off_walls(drive) < 1e-4


# files


def test_gzip_whole_and_cut(tmp_path: Path) -> None:
    content = "\n".join(raw_log()).encode()
    (tmp_path / "drive.log.gz").write_bytes(gzip.compress(content, mtime=0))
    whole = open_sequence(tmp_path / "drive.log.gz")
    assert (whole.name, len(whole.scans), whole.warnings) == ("drive", 40, ())
    data = (tmp_path / "drive.log.gz").read_bytes()
    (tmp_path / "cut.log.gz").write_bytes(data[: len(data) // 2])
    part = open_sequence(tmp_path / "cut.log.gz")
    assert 10 < len(part.scans) < 30
    assert "cut.log.gz: its end cannot be read (cut off?); the rest is used" in part.warnings
    np.testing.assert_array_equal(part.scans.ranges, whole.scans.ranges[: len(part.scans)])


def test_damaged_records_are_left_out_and_counted(tmp_path: Path) -> None:
    lines = raw_log()
    lines[5] = lines[5][: len(lines[5]) // 2]
    lines[7] = "FLASER 0 0 0 0 0 0 0 1.5 host 1.5"
    lines[9] = lines[9].replace(" ", " x", 3)
    lines[13] = lines[13].replace("FLASER 180", "FLASER 999999999999")
    lines += ["FLASER", "ODOM 1 2", "SONAR 1 2 3", ""]
    lines.append(flaser(ranges(robot(40), 181), robot(40), robot(40), "8"))
    drive = read(lines, tmp_path)
    assert len(drive.scans) == 36
    assert "6 records of drive.log left out: damaged or without beams" in drive.warnings
    assert "1 scan of drive.log left out: not FLASER of 180 beams" in drive.warnings
    assert off_walls(drive) < 1e-4


def test_a_second_scanner_is_named(tmp_path: Path) -> None:
    rear = flaser(ranges(robot(0)), robot(0), robot(0), "0").replace("FLASER", "RLASER")
    drive = read([*raw_log(), rear, rear], tmp_path)
    assert "FLASER is used, not the other scanners of drive.log: RLASER (2)" in drive.warnings


def test_odometry_that_never_moves_is_left_out(tmp_path: Path) -> None:
    lines = [flaser(ranges(robot(i)), np.zeros(3), np.zeros(3), f"{i}") for i in range(9)]
    drive = read(lines, tmp_path)
    assert drive.odometry is None
    assert "the odometry never moves: left out" in drive.warnings


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", ["no laser scans", "nothing"]),
        (b"ODOM 0 0 0 0 0 0 1 h 1\nSONAR 3\n", ["no laser scans", "ODOM (1)", "SONAR (1)"]),
        (b"FLASER 0 0 0 0 0 0 0 1 h 1\n" * 3, ["no laser scans", "FLASER (3)"]),
        (b"\x00\x01\x02" * 99, ["no CARMEN log"]),
        (b"\x1f\x8b broken", ["no laser scans"]),
        (b"\xff\xfe\xfa\n" * 99, ["no laser scans"]),
    ],
)
def test_files_that_hold_no_scans_end_in_one_line(
    content: bytes, said: list[str], tmp_path: Path, run_recon: Any
) -> None:
    (tmp_path / "a.log").write_bytes(content)
    result = run_recon("inspect", tmp_path / "a.log")
    assert result.status == 2
    assert len(result.errors) == 1
    for piece in ("a.log", *said):
        assert piece in result.errors[0]


def test_stamps_that_only_go_back_are_an_error_or_rebuilt(tmp_path: Path) -> None:
    """Nothing of them can be true, but the order of the log can."""
    drive = read(raw_log(stamp=lambda i: f"{100 - i}"), tmp_path)
    assert len(drive.scans) == 40
    assert any("do not increase" in w for w in drive.warnings)


@given(
    st.lists(st.sampled_from(["FLASER", "ODOM", "PARAM", "ROBOTLASER1", "RAWLASER1", "1", "-2.5", "nan", "1e99", "x"]))
)
@settings(max_examples=60, deadline=None)
def test_any_words_give_a_sequence_or_one_line(tmp_path_factory: pytest.TempPathFactory, words: list[str]) -> None:
    folder = tmp_path_factory.mktemp("words")
    try:
        drive = read(["\n".join(words), " ".join(words), *raw_log(3)], folder)
    except InputError as error:
        assert "drive.log" in str(error) and "\n" not in str(error)
    else:
        assert len(drive.scans) >= 1


def test_convert_and_inspect(tmp_path: Path, run_recon: Any) -> None:
    read(raw_log(), tmp_path)
    assert run_recon("convert", tmp_path / "drive.log", "-o", tmp_path / "seq", "-q").status == 0
    direct, folder = open_sequence(tmp_path / "drive.log"), open_sequence(tmp_path / "seq")
    np.testing.assert_array_equal(direct.scans.ranges, folder.scans.ranges)
    np.testing.assert_array_equal(direct.scans.timestamps, folder.scans.timestamps)
    assert direct.odometry is not None and folder.odometry is not None
    np.testing.assert_allclose(direct.odometry.poses, folder.odometry.poses, atol=2e-6)
    lines = run_recon("inspect", tmp_path / "drive.log").output
    assert lines[0] == "Sequence:   drive"
    assert "40 in 7.8 s" in lines[1]


# logs of real robots


@pytest.mark.parametrize(
    ("name", "scans", "odometry", "path", "span", "no_return"),
    [
        ("aces", (440, 180), 7374, 325, 1366, 620),
        ("acapulco", (861, 181), 11281, 825, 1387, 863 + 11 + 12337 + 2),
    ],
)
def test_radish(
    name: str,
    scans: tuple[int, int],
    odometry: int,
    path: float,
    span: float,
    no_return: int,
    shared_data: Callable[[str], Path],
) -> None:
    """Counts, spans and paths of the data's own description; counts of no return from histograms of the files."""
    drive = open_sequence(shared_data("carmen") / f"{name}.log.gz")
    assert drive.scans.ranges.shape == scans
    assert int(np.isinf(drive.scans.ranges).sum()) == no_return
    assert drive.odometry is not None and len(drive.odometry) == odometry
    steps: NDArray[np.float64] = np.linalg.norm(np.diff(drive.odometry.poses[:, :2], axis=0), axis=1)
    assert steps.sum() == pytest.approx(path, abs=0.6)
    assert float(np.ptp(drive.odometry.timestamps)) == pytest.approx(span, abs=1)
    assert steps.max() < 0.5  # m: no correction is among them
    assert len(drive.warnings) == 1


@pytest.mark.parametrize(("beams", "start", "step"), [(180, -90, 1.0), (361, -90, 0.5), (541, -135, 0.5)])
def test_odometry_that_starts_anew(beams: int, start: float, step: float, tmp_path: Path) -> None:
    """The wheels' count falls back to 0 in mid-drive: the way goes on from there, and the line says so."""
    lines, base = [], np.zeros(3)
    for i in range(40):
        if i in (16, 36):
            base = robot(i)
        at, stamp = compose2(inverse2(base), robot(i)), f"{PERIOD * i:g}"
        lines += [odom(at, stamp), flaser(ranges(robot(i), beams, start, step), at, at, stamp)]
    drive = read(lines, tmp_path)
    assert drive.warnings == ("the odometry jumps 2 times, first at 3.000 s: those steps are left out",)
    assert drive.odometry is not None
    steps = between2(drive.odometry.poses[:-1], drive.odometry.poses[1:])
    truth = np.array([robot(i) for i in range(40)])
    expected = between2(truth[:-1], truth[1:])
    expected[[15, 35]] = 0.0
    np.testing.assert_allclose(steps, expected, atol=5e-6)
