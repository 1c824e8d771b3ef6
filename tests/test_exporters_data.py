"""GeoJSON, the graph of rooms and trajectories, read back by other readers."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from evo.tools import file_interface
from shapely.geometry import shape
from two_rooms import two_rooms
from walled_plans import drive, odd_models, row_of_rooms

from recon.errors import InputError
from recon.exporters import export
from recon.graph.estimate import MapEstimate
from recon.layout_json import layout_to_json
from recon.model import Model
from recon.occupancy import save_occupancy
from recon.results.accuracy import write_accuracy
from recon.results.reader import load_model
from recon.sequence.tum import as_written, write_planar


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_geojson_is_the_plan(tmp_path: Path) -> None:
    layout = row_of_rooms([3.0, 4.0, 2.5], 4.0, 0.2, np.array([-40.0, 12.0, 0.3]))
    export(Model("row", layout, (), ("A note.",)), tmp_path / "plan.geojson")
    data = read(tmp_path / "plan.geojson")
    assert data["type"] == "FeatureCollection"
    assert "not longitude and latitude" in data["about"][0]
    assert data["about"][1] == "A note."
    by_kind: dict[str, list[Any]] = {}
    for feature in data["features"]:
        by_kind.setdefault(feature["properties"]["kind"], []).append(feature)
    assert {kind: len(found) for kind, found in by_kind.items()} == {"room": 3, "wall": 10, "door": 2}
    for feature, room in zip(by_kind["room"], layout.rooms, strict=True):
        polygon = shape(feature["geometry"])
        assert polygon.exterior.is_ccw
        assert polygon.equals_exact(shapely.Polygon(room.polygon), 1e-6)
        assert feature["properties"]["name"] == room.name
        assert feature["properties"]["area"] == pytest.approx(polygon.area, abs=1e-4)
        assert feature["properties"]["sigma_height"] == 0.01
    walls = [shape(feature["geometry"]) for feature in by_kind["wall"]]
    rooms = shapely.union_all([shape(feature["geometry"]) for feature in by_kind["room"]])
    assert shapely.union_all(walls).intersection(rooms).area < 1e-4
    measured = [f["properties"] for f in by_kind["wall"] if f["properties"]["thickness_source"] == "measured"]
    assert [wall["thickness"] for wall in measured] == [0.2, 0.2]
    assert all(wall["sigma_offset"] == 0.004 for wall in measured)
    assert [door["properties"]["rooms"] for door in by_kind["door"]] == [[0, 1], [1, 2]]
    assert len({feature["id"] for feature in data["features"]}) == len(data["features"])


def test_room_graph_says_which_door_leads_where(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "two.rooms.json")
    graph = read(tmp_path / "two.rooms.json")
    assert [node["id"] for node in graph["nodes"]] == [0, 1, "unknown"]
    for node, room in zip(graph["nodes"], model.layout.rooms, strict=False):
        assert node["name"] == room.name
        assert shapely.Polygon(room.polygon).contains(shapely.Point(node["at"]))
    edges = {(edge["source"], edge["target"]): edge for edge in graph["edges"]}
    assert set(edges) == {(0, "unknown"), (0, 1)}  # the window is no way
    passage = edges[0, 1]
    assert passage["openings"] == [1, 2]
    assert passage["open"]
    assert (passage["width"], passage["height"]) == (1.0, 2.1)
    assert not edges[0, "unknown"]["open"]


def test_trajectories_as_other_readers_read_them(tmp_path: Path) -> None:
    trajectory, sigmas, grid = drive()
    model = replace(two_rooms(), trajectory=trajectory, pose_sigmas=sigmas, occupancy=grid)
    export(model, tmp_path / "drive.tum")
    read_back = file_interface.read_tum_trajectory_file(tmp_path / "drive.tum")
    np.testing.assert_allclose(read_back.positions_xyz[:, :2], trajectory.poses[:, :2], atol=1e-6)
    np.testing.assert_allclose(read_back.timestamps, trajectory.timestamps, atol=1e-6)
    yaw = read_back.get_orientations_euler("rxyz")[:, 2]
    np.testing.assert_allclose(yaw, trajectory.poses[:, 2], atol=1e-6)
    export(model, tmp_path / "drive.csv")
    with (tmp_path / "drive.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for key, column in zip(("x", "y", "yaw"), trajectory.poses.T, strict=True):
        assert [float(row[key]) for row in rows] == pytest.approx(column.tolist(), abs=1e-6)
    for key, column in zip(("sigma_x", "sigma_y", "sigma_yaw"), sigmas.T, strict=True):
        assert [float(row[key]) for row in rows] == pytest.approx(column.tolist(), abs=1e-6)
    assert float(rows[1]["timestamp"]) == pytest.approx(1.5e9 + 0.1, abs=1e-6)
    export(replace(model, pose_sigmas=np.zeros((0, 3))), tmp_path / "drive.csv")
    with (tmp_path / "drive.csv").open(newline="") as file:
        assert [row["sigma_x"] for row in csv.DictReader(file)] == ["", "", ""]


def test_the_drive_of_a_result_is_the_one_that_was_built(tmp_path: Path) -> None:
    trajectory, sigmas, grid = drive()
    kept = as_written(trajectory)
    (tmp_path / "layout.json").write_text(json.dumps(layout_to_json(two_rooms().layout)), encoding="utf-8")
    (tmp_path / "model.json").write_text(json.dumps({"version": 1, "name": "m", "notes": [], "faces": []}))
    write_planar(tmp_path / "trajectory.txt", trajectory)
    write_accuracy(tmp_path, MapEstimate(trajectory, sigmas, ()))
    save_occupancy(grid, tmp_path)
    model = load_model(tmp_path)
    assert model.trajectory is not None
    assert (model.trajectory.poses == kept.poses).all()
    assert (model.trajectory.timestamps == kept.timestamps).all()
    np.testing.assert_allclose(kept.poses, trajectory.poses, atol=1e-6)
    built = replace(two_rooms(), name="m", trajectory=kept, pose_sigmas=sigmas, occupancy=grid)
    for suffix in (".tum", ".csv", ".yaml"):
        export(model, tmp_path / f"a{suffix}")
        export(built, tmp_path / f"b{suffix}")
        first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in "ab")
        assert first.replace(b"a.pgm", b"b.pgm") == second
    lines = (tmp_path / "pose_sigmas.txt").read_text().splitlines()
    (tmp_path / "pose_sigmas.txt").write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(InputError, match=r"2 rows in pose_sigmas.txt, expected 3"):
        load_model(tmp_path)


@pytest.mark.parametrize("name", odd_models())
def test_odd_plans_give_sound_files(name: str, tmp_path: Path) -> None:
    model = odd_models()[name]
    for suffix in (".geojson", ".rooms.json"):
        export(model, tmp_path / f"odd{suffix}")
        assert read(tmp_path / f"odd{suffix}")
