"""`recon eval`: everything that the ground truth of a sequence can say of a result."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from recon.errors import InputError
from recon.evaluate.confusion import write_confusions
from recon.evaluate.extrinsics import ExtrinsicsErrors, extrinsics_errors
from recon.evaluate.labels import LabelScores, label_scores
from recon.evaluate.layout import LayoutScores, layout_scores
from recon.evaluate.relations import RelationErrors, given_odometry, relation_errors
from recon.evaluate.trajectory import TrajectoryErrors, trajectory_errors
from recon.evaluate.views import ViewScores, view_scores
from recon.evaluate.walls import WallScores, wall_scores
from recon.results.reader import load_layout
from recon.sequence.extrinsics import read_extrinsics
from recon.sequence.groundtruth import GroundTruth, read_groundtruth
from recon.sequence.images import read_image_list
from recon.sequence.tum import read_planar


@dataclass(frozen=True)
class Evaluation:
    """Scores; None for what the ground truth or the result does not hold. ceiling: m, estimate minus truth."""

    trajectory: TrajectoryErrors | None
    relations: RelationErrors | None
    extrinsics: ExtrinsicsErrors | None
    walls: WallScores | None
    layout: LayoutScores | None
    ceiling: float | None
    labels: LabelScores | None
    views: ViewScores | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values, described in docs/formats.md; lengths in m, angles in degrees but those of `layout`, rad."""
        content: dict[str, Any] = {"version": 1, "ceiling": self.ceiling}
        for name in ("trajectory", "relations", "extrinsics", "walls", "labels"):
            part = getattr(self, name)
            content[name] = None if part is None else asdict(part)
        content["layout"] = None if self.layout is None else self.layout.to_json()
        content["views"] = None if self.views is None else self.views.to_json()
        if self.walls is not None:
            content["walls"]["f1"] = list(self.walls.f1)
        return content

    def table(self) -> str:
        """Two aligned columns for a terminal."""
        rows = self._trajectory_rows() + self._relation_rows() + self._extrinsics_rows()
        rows += self._layout_rows() + self._label_rows() + ([] if self.views is None else self.views.rows())
        width = max(len(name) for name, _ in rows) if rows else 0
        return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)

    def _trajectory_rows(self) -> list[tuple[str, str]]:
        if (t := self.trajectory) is None:
            return []
        return [
            ("trajectory, ATE", f"{t.ate * 100:.2f} cm rms, {t.ate_max * 100:.2f} cm worst, over {t.poses} poses"),
            ("trajectory, heading", f"{t.heading:.3f} deg rms"),
            ("trajectory, RPE pose to pose", f"{t.rpe * 100:.2f} cm, {t.rpe_rotation:.3f} deg rms"),
        ]

    def _relation_rows(self) -> list[tuple[str, str]]:
        if (r := self.relations) is None:
            return []
        rows = [
            (
                f"relations, {name}",
                f"{s.mean:.4f} +- {s.deviation:.4f} {unit}, squared {s.squared_mean:.4f} +- {s.squared_deviation:.4f}",
            )
            for name, unit, s in (("translation", "m", r.translation), ("rotation", "deg", r.rotation))
        ]
        if r.clock is not None:
            moved = f"{r.clock.lag:+.3f} +- {r.clock.sigma:.3f} s behind the scans, which is taken off"
            rows.append(("odometry's clock", moved))
        return [*rows, ("relations used", f"{r.used}, {r.left_out} left out")]

    def _extrinsics_rows(self) -> list[tuple[str, str]]:
        if (e := self.extrinsics) is None:
            return []
        return [
            ("camera position", f"x {e.x * 100:+.1f} cm, y {e.y * 100:+.1f} cm, height {e.height * 100:+.1f} cm"),
            ("camera rotation", f"{e.rotation:.3f} deg, of it tilt {e.tilt:.3f} deg"),
        ]

    def _layout_rows(self) -> list[tuple[str, str]]:
        rows = []
        if (w := self.walls) is not None:
            for t, a, c, f in zip(w.thresholds, w.accuracy, w.completeness, w.f1, strict=True):
                name = f"walls within {t * 100:.0f} cm"
                rows.append((name, f"accuracy {a:.3f}, completeness {c:.3f}, F1 {f:.3f}"))
            rows.append(("walls, median distance", f"{w.median_distance * 1000:.1f} mm"))
        if self.ceiling is not None:
            rows.append(("ceiling height", f"{self.ceiling * 100:+.1f} cm"))
        return rows + (self.layout.rows() if self.layout is not None else [])

    def _label_rows(self) -> list[tuple[str, str]]:
        if (s := self.labels) is None:
            return []
        worst = ", ".join(f"{stem} {value:.1%}" for stem, value in s.worst[:3])
        return [
            ("classification accuracy", f"{s.accuracy:.2%} over {s.images} images, {s.median_image:.2%} in the median"),
            ("worst images", worst),
            ("wrong pixels", ", ".join(f"{share:.2%} {name}" for name, share in list(s.wrong.items())[:4]) or "none"),
        ]


def evaluate(sequence: Path, result: Path, views: Path | None = None) -> Evaluation:
    """Compare a result folder with the ground truth of its sequence folder.

    views: leave images out and compare them with the model, too (`view_scores`, which needs no ground truth); pictures
    go into this folder. Raises InputError when either folder is missing or damaged, or when the sequence has no ground
    truth and no `views` are asked for.
    """
    seen = None if views is None else view_scores(sequence, result, views)
    if seen is not None and not (sequence / "groundtruth").is_dir():
        return Evaluation(None, None, None, None, None, None, None, seen)
    truth = read_groundtruth(sequence)
    layout = load_layout(result)
    pose = None
    if truth.platform_from_camera is not None and (result / "extrinsics.yaml").is_file():
        pose = extrinsics_errors(read_extrinsics(result / "extrinsics.yaml"), truth.platform_from_camera)
    trajectory, relations = _motion_errors(truth, sequence, result)
    walls = scores = ceiling = None
    if truth.layout is not None:
        walls = wall_scores(layout.walls, truth.layout.walls)
        scores = layout_scores(layout, truth.layout)
        if layout.ceiling_height is not None and truth.layout.ceiling_height is not None:
            ceiling = layout.ceiling_height - truth.layout.ceiling_height
    labels = label_scores(label_pairs(truth, result))
    evaluation = Evaluation(trajectory, relations, pose, walls, scores, ceiling, labels, seen)
    if all(part is None for part in (trajectory, relations, pose, walls, labels, seen)):
        raise InputError(f"{sequence / 'groundtruth'}: holds nothing that can be compared")
    return evaluation


def _motion_errors(
    truth: GroundTruth, sequence: Path, result: Path
) -> tuple[TrajectoryErrors | None, RelationErrors | None]:
    """Against the true trajectory and the true relations, read along the odometry where there is one."""
    if truth.trajectory is None and truth.relations is None:
        return None, None
    estimate = read_planar(result / "trajectory.txt")
    errors = None if truth.trajectory is None else trajectory_errors(estimate, truth.trajectory)
    if truth.relations is None:
        return errors, None
    odometry, clock = given_odometry(sequence, estimate)
    used = clock if clock is not None and clock.believed else None
    return errors, replace(relation_errors(estimate, truth.relations, odometry), clock=used)


def confusion_pictures(sequence: Path, result: Path, folder: Path) -> list[Path]:
    """Pictures of the images whose labels are the least right, as `write_confusions`; none without true labels."""
    listed = sequence / "images.txt"
    images = {path.stem: path for path in read_image_list(listed).paths} if listed.is_file() else {}
    return write_confusions(label_pairs(read_groundtruth(sequence), result), images, folder)


def label_pairs(truth: GroundTruth, result: Path) -> list[tuple[Path, Path]]:
    """Label images (estimate, truth) that both the result and the ground truth hold."""
    if truth.labels is None:
        return []
    found = sorted((result / "labels").glob("*.png"))
    return [(mine, truth.labels / mine.name) for mine in found if (truth.labels / mine.name).is_file()]
