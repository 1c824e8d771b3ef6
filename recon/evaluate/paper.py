"""The paper's experiment (section 3): classification accuracy of labelled images with scans made from their truth."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from recon.config import Config
from recon.errors import InputError
from recon.evaluate.contour import ALL_ROUND, STEP, bearings, contour_ranges, layout_ranges
from recon.evaluate.image_set import ImageSet, read_labels
from recon.evaluate.labels import LabelScores, label_scores
from recon.geometry import Array
from recon.pipeline import build
from recon.progress import SILENT, Progress
from recon.results import save_result
from recon.sequence.sequence import Scans, Sequence

RANGE_MAX = 100.0
RANGE_NOISE = 0.02
"""m, one standard deviation: the paper does not say which it took."""
PAPER_SETS = ("L", "+", "T1")
PAPER_ROWS = {
    "proposed method (the paper)": (0.9564, 0.9724, 0.9809, 0.9659),
    "Tsai and Kuipers 2012": (0.9100, 0.9423, 0.9271, 0.9212),
}
"""Table 1: accuracy on the paper's three sets, and overall."""
PAPER_IMAGES = (90, 30, 41, 167)
"""As printed: the three do not add up to the fourth."""


@dataclass(frozen=True)
class SetScores:
    """Scores of one image set; all_round: whether its scans were made from a layout, not from label images."""

    name: str
    all_round: bool
    labels: LabelScores


def run_set(image_set: ImageSet, config: Config, noise: float, work: Path, progress: Progress = SILENT) -> SetScores:
    """Build from the images and the scans made for them, neither camera pose nor motion given, and compare the labels.

    The result folder is `work`. An image that the build could not place counts as wrong. Raises as `as_sequence`.
    """
    save_result(build(as_sequence(image_set, noise, config.seed), config, progress), work)
    folder, pairs = work / "labels", []
    folder.mkdir(exist_ok=True)
    for label in image_set.labels:
        mine = folder / label.name
        if not mine.is_file():
            shape = (image_set.camera.height, image_set.camera.width)
            mine.write_bytes(cv2.imencode(".png", np.zeros(shape, np.uint16))[1].tobytes())
        pairs.append((mine, label))
    scores = label_scores(pairs)
    assert scores is not None, "an image set holds two images at least"
    return SetScores(image_set.name, image_set.layout is not None, scores)


def as_sequence(image_set: ImageSet, noise: float, seed: int) -> Sequence:
    """Images, odometry where given, and a scan an image: the contour per degree with Gaussian noise of `noise` m.

    Of the layout all round where the set has one, else of each label image in the camera's field of view. Raises
    InputError for damaged label images and labels that show no wall's foot.
    """
    rng = np.random.default_rng(seed)
    ranges, first = _contours(image_set)
    if not np.isfinite(ranges).any():
        raise InputError(
            f"{image_set.labels[0].parent}: no label image shows a wall (10 and above) on the floor (1), expected the "
            "labels of docs/formats.md"
        )
    noisy = np.maximum(ranges + rng.normal(0.0, noise, ranges.shape), 0.01)
    scans = Scans(image_set.images.timestamps, noisy.astype(np.float32), first, float(STEP), 0.0, RANGE_MAX)
    return Sequence(image_set.name, scans, image_set.camera, image_set.images, image_set.odometry)


def table(results: list[SetScores]) -> str:
    """The paper's Table 1 with a row of ours under it, as markdown; sets that the paper has not come last.

    Overall is the mean over images.
    """
    ours = {_paper_name(r.name): r for r in results}
    names = [*PAPER_SETS, *(name for name in ours if name not in PAPER_SETS)]
    more = ["-"] * (len(names) - len(PAPER_SETS))
    rows = [["", *(f"Dataset {n}" if n in PAPER_SETS else n for n in names), "Overall"]]
    for title, values in PAPER_ROWS.items():
        cells = [f"{value:.2%}" for value in values]
        rows.append([title, *cells[:-1], *more, cells[-1]])
    rows.append(["images", *map(str, PAPER_IMAGES[:-1]), *more, str(PAPER_IMAGES[-1])])
    counts = [r.labels.images for r in results]
    overall = float(np.average([r.labels.accuracy for r in results], weights=counts))
    rows.append(["recon", *(f"{ours[n].labels.accuracy:.2%}" if n in ours else "-" for n in names), f"{overall:.2%}"])
    shown = [str(ours[n].labels.images) if n in ours else "-" for n in names]
    rows.append(["its images", *shown, str(sum(counts))])
    return markdown(rows)


def markdown(rows: list[list[str]]) -> str:
    """Rows of cells, the first the head, as an aligned table."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in rows]
    lines.insert(1, "| " + " | ".join("-" * w for w in widths) + " |")
    return "\n".join(lines)


def _contours(image_set: ImageSet) -> tuple[Array, float]:
    """Ranges (N, B) m without noise, and the first bearing, rad."""
    if image_set.layout is not None and image_set.poses is not None:
        walls = image_set.layout.walls
        return np.stack([layout_ranges(walls, pose) for pose in image_set.poses]), float(ALL_ROUND[0])
    camera, mounting = image_set.camera, image_set.platform_from_camera
    rows = [contour_ranges(read_labels(path, camera), camera, mounting) for path in image_set.labels]
    return np.stack(rows), float(bearings(camera, mounting)[0])


def _paper_name(name: str) -> str:
    """L, + or T1 of folder names such as "Dataset_L", "plus" and "t1"; other names as they are."""
    short = re.sub(r"dataset|[^a-z0-9+]", "", name.lower()).replace("plus", "+").upper()
    return short if short in PAPER_SETS else name
