"""Which mistakes label images hold, and the pictures of the worst of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.evaluate.confusion import INVENTED, MISTAKES, STRENGTH, confusion, named, write_confusions
from recon.evaluate.labels import compare_labels, label_scores

Labels = NDArray[np.uint16]


def view(*columns: tuple[int, int]) -> Labels:
    """10 rows of columns (label, width); the lowest two rows are floor."""
    image = np.concatenate([np.full((10, width), label, np.uint16) for label, width in columns], axis=1)
    image[8:] = 1
    return image


def write(folder: Path, images: dict[str, Labels]) -> list[Path]:
    folder.mkdir()
    for stem, image in images.items():
        assert cv2.imwrite(str(folder / f"{stem}.png"), image)
    return [folder / f"{stem}.png" for stem in images]


@pytest.fixture
def pairs(tmp_path: Path) -> list[tuple[Path, Path]]:
    """Two images of 100 pixels. a: 8 pixels of wall taken for floor, 8 of an object missed. b: the wall split."""
    theirs = {"a": view((10, 6), (3, 1), (11, 3)), "b": view((10, 10))}
    mine = {"a": view((20, 7), (21, 3)), "b": view((20, 6), (22, 4))}
    mine["a"][:8, 0] = 1
    return list(zip(write(tmp_path / "mine", mine), write(tmp_path / "theirs", theirs), strict=True))


def test_mistakes_by_kind(pairs: list[tuple[Path, Path]]) -> None:
    scores = label_scores(pairs)
    assert scores is not None
    assert scores.wrong == pytest.approx(
        {"wall as another wall": 32 / 200, "object as wall": 8 / 200, "wall as floor": 8 / 200}
    )
    assert next(iter(scores.wrong)) == "wall as another wall"
    assert sum(scores.wrong.values()) == pytest.approx(1 - scores.accuracy)
    same = label_scores([(truth, truth) for _, truth in pairs])
    assert same is not None and same.wrong == {}


def test_walls_are_named_as_those_they_stand_for(pairs: list[tuple[Path, Path]]) -> None:
    _, meaning = compare_labels(pairs)
    labels = np.array([[1, 2, 3, 20, 21, 22]], np.uint16)
    assert named(labels, meaning).tolist() == [[1, 2, 3, 10, 11, INVENTED + 22]]


def test_picture_of_mistakes() -> None:
    truth, estimate = view((10, 6), (3, 1), (11, 3)), view((10, 6), (10, 4))
    estimate[:8, 0] = 1
    photo = np.full((10, 10, 3), 100, np.uint8)
    picture = confusion(photo, estimate, truth)
    assert picture.shape == (20, 20, 3)
    assert np.array_equal(picture[:10, :10], photo)
    shown = picture[:10, 10:]

    def tint(name: str) -> list[int]:
        return [round(25 + STRENGTH * value) for value in MISTAKES[name]]

    assert (shown[:8, 0] == tint("class")).all() and (shown[:8, 6] == tint("object")).all()
    assert (shown[:8, 7:] == tint("identity")).all()
    assert (shown[8:] == 100).all() and (shown[:, 1:6] == 100).all()


def test_the_worst_come_first(pairs: list[tuple[Path, Path]], tmp_path: Path) -> None:
    photo = tmp_path / "b.jpg"
    assert cv2.imwrite(str(photo), np.full((10, 10, 3), 200, np.uint8))
    written = write_confusions(pairs, {"b": photo}, tmp_path / "worst")
    assert [path.name for path in written] == ["b.png", "a.png"]
    for path, grey in zip(written, (200, 128), strict=True):
        picture = cv2.imread(str(path))
        assert picture is not None and abs(int(picture[5, 5, 0]) - grey) < 3
    assert write_confusions([], {}, tmp_path / "none") == []


def test_pictures_from_the_command_line(tiny_sequence: Path, tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    """A result whose labels are right but for one image."""
    result, truth = tmp_path / "drive.recon", tiny_sequence / "groundtruth"
    result.mkdir()
    truth.mkdir()
    (result / "layout.json").write_text('{"version": 1}')
    right = {str(i): np.full((24, 32), 10, np.uint16) for i in range(5)}
    write(truth / "labels", right)
    write(result / "labels", right | {"3": np.full((24, 32), 1, np.uint16)})
    done = run_recon("eval", tiny_sequence, result, "--pictures", tmp_path / "worst")
    assert done.status == 0
    assert "wrong pixels             20.00% wall as floor" in done.output
    assert sorted(p.name for p in (tmp_path / "worst").iterdir()) == [f"{i}.png" for i in range(5)]
    done = run_recon("eval", tiny_sequence, result, "--pictures", tmp_path / "none" / "worst")
    assert (done.status, len(done.errors)) == (2, 1)
