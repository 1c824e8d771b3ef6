"""View synthesis as a measure: images left out are compared with what the model shows from where they were taken."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError, OutputError
from recon.evaluate.explained import explained, partner
from recon.evaluate.fidelity import fidelity, fit_exposure
from recon.evaluate.heldout import HeldOut, hold_out
from recon.evaluate.labels import read_label_image
from recon.labels import FIRST_WALL, FLOOR
from recon.model import Face
from recon.raycast import RayScene
from recon.render import TexturedScene, render_scene

LEAST_SCORED = 0.05
"""Share of an image's pixels: with fewer of them to compare, an image is not scored."""
UNLABELLED = "floor and walls by the result's own labels (there are no true ones), where the layout explains the images"
BESIDE = 2.0
"""Differences are drawn this many times as strong, about grey."""
BACKGROUND = (255, 255, 255)
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 88]

Mask = NDArray[np.bool_]
Picture = NDArray[np.float32]


@dataclass(frozen=True)
class ViewScore:
    """One image that was left out. psnr (dB), ssim, sharpness: as `fidelity`, over pixels of floor and walls that some
    other image saw, exposure fitted; psnr_all: over unseen, filled ones too.

    coverage: share of the floor's and walls' pixels that another image saw; scored: share of the image compared.
    """

    image: str
    psnr: float
    psnr_all: float
    ssim: float
    sharpness: float
    coverage: float
    scored: float


@dataclass(frozen=True)
class ViewScores:
    """Every scored image, and how many of the images left out showed too little of floor and walls."""

    views: tuple[ViewScore, ...]
    too_little: int
    labels: str

    def mean(self, name: str) -> float:
        """Mean of a number over the images."""
        return float(np.mean([getattr(view, name) for view in self.views]))

    def to_json(self) -> dict[str, Any]:
        """Means and every image."""
        names = ("psnr", "psnr_all", "ssim", "sharpness", "coverage", "scored")
        means = {name: round(self.mean(name), 4) for name in names}
        return {**means, "labels": self.labels, "too_little": self.too_little, "views": [asdict(v) for v in self.views]}

    def rows(self) -> list[tuple[str, str]]:
        """For a table."""
        worst = min(self.views, key=lambda view: view.psnr)
        return [
            (
                "views, PSNR",
                f"{self.mean('psnr'):.1f} dB over {len(self.views)} images left out, worst {worst.psnr:.1f}",
            ),
            ("views, SSIM", f"{self.mean('ssim'):.3f}"),
            ("views, sharpness ratio", f"{self.mean('sharpness'):.2f}"),
            ("views, coverage", f"{self.mean('coverage'):.1%} of {self.labels}"),
            ("views, not compared", f"{self.too_little} images show too little of them" if self.too_little else "none"),
        ]


def view_scores(sequence: Path, result: Path, folder: Path | None = None) -> ViewScores:
    """Leaves every fifth image out, textures the model of `result` without them, and renders it from where they were.

    The images left out are placed by trajectory and extrinsics; a gain and a bias a channel are fitted. Pixels of
    floor and walls are those of groundtruth/labels/; without it, those of the result's labels/ where another image,
    moved by way of the faces, fits (`explained`: the rest is furniture that the layout does not hold).
    folder: for pictures of photo, render and difference, STEM.jpg, and scores.json. Raises InputError where there is
    nothing to compare, OutputError where `folder` cannot be written.
    """
    held = hold_out(sequence, result)
    truth = sequence / "groundtruth" / "labels"
    labels = truth if truth.is_dir() else result / "labels"
    scene = RayScene(held.model.faces)
    faces, angle = held.model.faces, 1 / float(held.camera.matrix[0, 0])
    scenes = TexturedScene(faces, angle), TexturedScene(tuple(map(_seen, faces)), angle)
    found: list[tuple[ViewScore, NDArray[np.uint8]]] = []
    for i in held.held:
        mask = _surfaces(held, i, labels, scene if labels is not truth else None)
        scored = None if mask is None else _score(held, scenes, i, mask)
        found += [] if scored is None else [scored]
    if not found:
        raise InputError(f"{sequence}: no image left out shows floor or walls of {result}, expected at least one")
    name = "floor and walls" if labels is truth else UNLABELLED
    scores = ViewScores(tuple(score for score, _ in found), len(held.held) - len(found), name)
    if folder is not None:
        _write(folder, scores, [picture for _, picture in found])
    return scores


def _surfaces(held: HeldOut, index: int, labels: Path, scene: RayScene | None) -> Mask | None:
    """Pixels of an image that are floor or wall by its label image; with `scene`, of them those that are explained."""
    path = labels / f"{Path(held.images.names[index]).stem}.png"
    if not path.is_file():
        return None
    values = read_label_image(path)
    mask = (values == FLOOR) | (values >= FIRST_WALL)
    if mask.shape != (held.camera.height, held.camera.width):
        raise InputError(f"{path}: is {mask.shape[1]} x {mask.shape[0]} pixels, expected the camera's size")
    if scene is None:
        return mask
    others = [k for k in range(len(held.poses)) if k not in set(held.held)]
    other = partner(index, list(held.poses), others, held.camera)
    pair = (index, other)
    poses = [None if k is None else held.poses[k] for k in pair]
    photos = [None if k is None else held.load(k) for k in pair]
    if poses[0] is None or poses[1] is None or photos[0] is None or photos[1] is None:
        return None
    return mask & explained(scene, held.camera, (poses[0], poses[1]), (photos[0], photos[1]))


def _seen(face: Face) -> Face:
    """The face, white where an image saw it and black elsewhere."""
    if face.texture is None or face.sources is None:
        return replace(face, texture=np.zeros((1, 1, 3), np.uint8))
    return replace(face, texture=np.repeat(np.where(face.sources < 0, 0, 255).astype(np.uint8)[..., None], 3, axis=2))


def _score(
    held: HeldOut, scenes: tuple[TexturedScene, TexturedScene], index: int, mask: Mask
) -> tuple[ViewScore, NDArray[np.uint8]] | None:
    """Numbers and the picture (H, 3 W, 3) BGR of one image; None where too little can be compared.

    scenes: the model, and the model white where an image saw it.
    """
    raw, pose = held.load(index), held.poses[index]
    if raw is None or pose is None:
        return None
    known = render_scene(scenes[1], held.camera, pose, (0, 0, 0))[..., 0] > 127
    use = mask & known
    if use.mean() < LEAST_SCORED:
        return None
    photo = raw[..., ::-1].astype(np.float32)
    render = fit_exposure(photo, render_scene(scenes[0], held.camera, pose, BACKGROUND), use)
    good = fidelity(photo, render, use)
    everywhere = fidelity(photo, render, mask).psnr
    coverage, share = float(use.sum() / mask.sum()), float(use.mean())
    name = held.images.names[index]
    score = ViewScore(name, good.psnr, everywhere, good.ssim, good.sharpness, coverage, share)
    return score, side_by_side(photo, render, use)


def side_by_side(photo: Picture, render: Picture, mask: Mask) -> NDArray[np.uint8]:
    """Photo, render and their difference about grey, white where nothing is compared: (H, 3 W, 3) BGR."""
    difference = np.where(mask[..., None], 128 + BESIDE * (render - photo), 255)
    row = np.concatenate([photo, render, difference], axis=1)
    return np.ascontiguousarray(np.clip(np.rint(row), 0, 255).astype(np.uint8)[..., ::-1])


def _write(folder: Path, scores: ViewScores, pictures: list[NDArray[np.uint8]]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for view, picture in zip(scores.views, pictures, strict=True):
            data = cv2.imencode(".jpg", picture, JPEG)[1].tobytes()
            (folder / f"{Path(view.image).stem}.jpg").write_bytes(data)
        text = json.dumps(scores.to_json(), indent=1) + "\n"
        (folder / "scores.json").write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
