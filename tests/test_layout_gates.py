"""Doorways that lie on no wall's line together, and niches behind them."""

import numpy as np
import pytest
import shapely

from recon.geometry import Array
from recon.layout.cells import cut_plane
from recon.layout.evidence import FreeSpace
from recon.layout.frontier import frontier_lines
from recon.layout.gates import with_gates
from recon.layout.labelling import supports
from recon.layout.line import NONE, PlanLine
from recon.layout.rooms import regions

FREE, NOTHING = np.zeros((2, 120, 240), np.bool_)
FREE[21:99, 21:219] = True
SPACE = FreeSpace(np.array([-1.0, -1.0]), 0.05, FREE, NOTHING, NOTHING)  # but for a rim of 5 cm all of the box
PATH = np.array([[2.0, 2.0], [8.0, 2.0]])


def _walls(*ends: tuple[float, float, float, float]) -> list[PlanLine]:
    lines = []
    for x0, y0, x1, y1 in ends:
        start, step = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        length = float(np.linalg.norm(step))
        lines.append(PlanLine(start, step / length, np.array([[0.0, length]]), NONE, 0.01, 0.01, "lidar", 9))
    return lines


BOX = ((0.0, 0.0, 10.0, 0.0), (10.0, 0.0, 10.0, 4.0), (10.0, 4.0, 0.0, 4.0), (0.0, 4.0, 0.0, 0.0))


def _areas(
    *partitions: tuple[float, float, float, float], path: Array = PATH, front: PlanLine | None = None
) -> list[float]:
    """Areas of the rooms of a box of 10 m by 4 m with partitions in it."""
    lines = with_gates([*_walls(*BOX, *partitions), *([front] if front else [])], SPACE)
    lines += frontier_lines(SPACE, lines)
    cells = cut_plane(lines, np.array([-1.0, -1.0]), np.array([11.0, 5.0]))
    middles = shapely.point_on_surface(cells.polygons)
    inside = shapely.contains(shapely.box(0, 0, 10, 4), middles)
    support, nothing = supports(cells, lines)[:, 0], np.zeros(len(inside), np.bool_)
    found, _ = regions(cells, lines, inside, support, cells.spans(lines), nothing, path, SPACE)
    return [region.polygon.area for region in found]


def test_a_doorway_beside_a_corner_parts_rooms() -> None:
    assert _areas((6.0, 4.0, 6.0, 0.9)) == pytest.approx([24.0, 16.0])


def test_a_doorway_between_walls_out_of_line_parts_rooms() -> None:
    areas = _areas((6.0, 4.0, 6.0, 2.4), (6.3, 0.0, 6.3, 1.4))
    assert areas == pytest.approx([24.6, 15.4], abs=0.4) and sum(areas) == pytest.approx(40.0)


def test_a_slit_that_furniture_hides_parts_rooms() -> None:
    assert _areas((6.0, 4.0, 6.0, 0.5)) == pytest.approx([24.0, 16.0])


@pytest.mark.parametrize(
    "partition",
    [((6.0, 4.0, 6.0, 1.8),), ((4.0, 1.2, 10.0, 1.2),)],
    ids=["wider than a door", "the mouth of a corridor"],
)
def test_open_plans_stay_one_room(partition: tuple[tuple[float, float, float, float], ...]) -> None:
    assert _areas(*partition) == pytest.approx([40.0])


def test_a_niche_behind_a_doorway_belongs_to_its_room() -> None:
    assert _areas((9.4, 4.0, 9.4, 0.9)) == pytest.approx([40.0])


def test_between_two_walls_that_go_through_is_a_corridor_and_no_door() -> None:
    corridor = ((4.0, 4.0, 4.0, 0.0), (5.6, 4.0, 5.6, 0.0))
    assert _areas((0.0, 2.0, 3.9, 2.0), (5.7, 2.0, 10.0, 2.0), *corridor, path=np.array([[4.8, 1.0]])) == pytest.approx(
        [8.8, 8.8, 8.0, 8.0, 6.4]
    )


def test_a_wall_ends_where_a_corridor_leaves_it() -> None:
    seen = np.array([[0.0, 1.5], [3.3, 10.0]])
    front = PlanLine(np.array([0.0, 2.0]), np.array([1.0, 0.0]), seen, NONE, 0.01, 0.01, "lidar", 9)
    assert _areas(front=front) == pytest.approx([20.0, 20.0])
    with_arm = _areas((3.3, 2.0, 3.3, 4.0), front=front)
    assert len(with_arm) == 2 and max(with_arm) > 25.0 and sum(with_arm) == pytest.approx(40.0)
