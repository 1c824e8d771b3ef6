"""The paper's classification accuracy (section 3): share of rightly labelled pixels, ceiling left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.labels import CEILING, FIRST_WALL, FLOOR, OBJECT, UNLABELLED

MAX_LABEL = 4096
NAMES = {UNLABELLED: "unlabelled", FLOOR: "floor", CEILING: "ceiling", OBJECT: "object"}


@dataclass(frozen=True)
class LabelScores:
    """accuracy over all scored pixels; worst: (stem, accuracy) of the five worst images.

    wrong: shares of the scored pixels by mistake, "floor as wall" and so on, the largest first; they add up to
    1 - accuracy. A wall taken for one that it is not is "wall as another wall".
    """

    images: int
    accuracy: float
    median_image: float
    worst: tuple[tuple[str, float], ...]
    wrong: dict[str, float] = field(default_factory=dict)


def label_scores(pairs: list[tuple[Path, Path]]) -> LabelScores | None:
    """Compare label images, (estimate, truth) paths; None when there is no pair.

    Raises InputError as `compare_labels`.
    """
    return compare_labels(pairs)[0] if pairs else None


def compare_labels(pairs: list[tuple[Path, Path]]) -> tuple[LabelScores, NDArray[np.int64]]:
    """Scores of label images, (estimate, truth) paths, and what each estimated label means: (MAX_LABEL,) the true label
    that it stands for over the drive, -1 for none.

    Pixels that are unlabelled or ceiling in the truth are not scored. Strict about walls: each estimated wall stands
    for one true wall and each true wall for one estimated one, chosen over the whole drive for most common pixels.
    Raises InputError for damaged images and images of different size.
    """
    confusions = [_confusion(*pair) for pair in pairs]
    total = _total(confusions)
    meaning = _meaning(total)
    accuracies = []
    right = scored = 0
    for rows, columns, counts in confusions:
        good = int(counts[meaning[rows] == columns].sum())
        all_pixels = int(counts.sum())
        right, scored = right + good, scored + all_pixels
        accuracies.append(good / all_pixels if all_pixels else 1.0)
    order = np.argsort(accuracies, kind="stable")[:5]
    worst = tuple((pairs[i][1].stem, float(accuracies[i])) for i in order)
    wrong = _mistakes(total, meaning)
    return LabelScores(len(pairs), right / max(scored, 1), float(np.median(accuracies)), worst, wrong), meaning


Counts = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


def _total(confusions: list[Counts]) -> NDArray[np.int64]:
    total = np.zeros((MAX_LABEL, MAX_LABEL), np.int64)
    for rows, columns, counts in confusions:
        total[rows, columns] += counts
    return total


def _mistakes(total: NDArray[np.int64], meaning: NDArray[np.int64]) -> dict[str, float]:
    rows, columns = np.nonzero(total)
    pixels = total.sum()
    shares: dict[str, float] = {}
    for mine, true in zip(rows.tolist(), columns.tolist(), strict=True):
        if meaning[mine] != true:
            both_walls = min(mine, true) >= FIRST_WALL
            name = f"{NAMES.get(true, 'wall')} as {'another wall' if both_walls else NAMES.get(mine, 'wall')}"
            shares[name] = shares.get(name, 0.0) + float(total[mine, true] / pixels)
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _confusion(estimate: Path, truth: Path) -> Counts:
    """Estimated labels, true labels and their pixel counts, where the truth is scored."""
    mine, theirs = read_label_image(estimate), read_label_image(truth)
    if mine.shape != theirs.shape:
        raise InputError(f"{estimate}: is {mine.shape[1]} x {mine.shape[0]} pixels, {truth} is "
                         f"{theirs.shape[1]} x {theirs.shape[0]}")  # fmt: skip
    scored = (theirs != UNLABELLED) & (theirs != CEILING)
    joint = mine[scored].astype(np.int64) * MAX_LABEL + theirs[scored]
    keys, counts = np.unique(joint, return_counts=True)
    return keys // MAX_LABEL, keys % MAX_LABEL, counts


def read_label_image(path: Path) -> NDArray[np.uint16]:
    """Labels (H, W); raises InputError for anything but one channel of labels below MAX_LABEL."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2:
        raise InputError(f"{path}: is no PNG with one channel, expected single-channel labels")
    if int(image.max(initial=0)) >= MAX_LABEL:
        raise InputError(f"{path}: holds label {int(image.max())}, expected less than {MAX_LABEL}")
    return np.asarray(image, dtype=np.uint16)


def _meaning(total: NDArray[np.int64]) -> NDArray[np.int64]:
    """(MAX_LABEL,) true label that each estimated label stands for; -1 for walls without a counterpart."""
    from scipy.optimize import linear_sum_assignment

    meaning = np.arange(MAX_LABEL)
    walls = total[FIRST_WALL:, FIRST_WALL:]
    mine, theirs = np.flatnonzero(walls.any(axis=1)), np.flatnonzero(walls.any(axis=0))
    rows, columns = linear_sum_assignment(-walls[np.ix_(mine, theirs)])
    meaning[FIRST_WALL:] = -1
    meaning[FIRST_WALL + mine[rows]] = FIRST_WALL + theirs[columns]
    return meaning
