"""Photos beside what the model shows from there: photos/ of the result folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from recon.evaluate.fidelity import Mask, Picture, fidelity, fit_exposure
from recon.evaluate.views import side_by_side
from recon.geometry import Array, Pose3
from recon.render import Rays, TexturedScene
from recon.sequence.camera import Camera
from recon.sequence.images import load_image

if TYPE_CHECKING:
    from recon.pipeline import Build

FOLDER, LIST = "photos", "photos.json"
LOOKED_AT = 20
"""Images compared with the model, evenly over the drive."""
SMALL = 96
"""Pixels, the width at which they are."""
SHOWN = 2
"""Of the worst."""
LARGEST = 480
"""Pixels, the width of a photo that is shown."""
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 80]


def write_photos(build: Build, folder: Path) -> None:
    """photos/STEM.jpg: photo, model and difference of the images that fit the model worst, and of a middling one.

    photos/photos.json says which, how well each fits (PSNR, dB, exposure fitted, where the model has faces), and of how
    many. Nothing for a build without textures.
    """
    camera, images = build.sequence.camera, build.sequence.images
    if camera is None or images is None or not any(face.texture is not None for face in build.model.faces):
        return
    small = _Viewer(build, shrunk(camera, min(SMALL, camera.width)), 1)
    scores = {i: fidelity(*pair).psnr for i in _looked_at(build) if (pair := small.pair(i)) is not None}
    found = sorted(scores, key=lambda i: scores[i])
    if not found:
        return
    large = _Viewer(build, shrunk(camera, min(LARGEST, camera.width)), 2)
    (folder / FOLDER).mkdir()
    rows = []
    for i in [*found[:SHOWN], *found[max(len(found) // 2, SHOWN) :][:1]]:
        pair = large.pair(i)
        if pair is not None:
            stem, rank = Path(images.names[i]).stem, "worst" if i in found[:SHOWN] else "middling"
            picture = cv2.imencode(".jpg", side_by_side(*pair), JPEG)[1]
            (folder / FOLDER / f"{stem}.jpg").write_bytes(picture.tobytes())
            rows.append({"image": images.names[i], "rank": rank, "psnr": round(fidelity(*pair).psnr, 2)})
    content = {"compared": len(found), "photos": rows}
    (folder / FOLDER / LIST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _looked_at(build: Build) -> list[int]:
    posed = [i for i, pose in enumerate(build.map_from_camera) if pose is not None]
    return [posed[i] for i in np.unique(np.linspace(0, len(posed) - 1, min(LOOKED_AT, len(posed))).astype(int))]


class _Viewer:
    """Looks at the model of a build through one camera; edge_samples as `TexturedScene`."""

    def __init__(self, build: Build, camera: Camera, edge_samples: int) -> None:
        self._build, self._camera = build, camera
        angle = 1 / float(camera.matrix[0, 0])
        self._scene = TexturedScene(build.model.faces, pixel_angle=angle, edge_samples=edge_samples)
        rays = camera.rays().reshape(-1, 3)
        self._rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def pair(self, index: int) -> tuple[Picture, Picture, Mask] | None:
        """Photo and model (H, W, 3) RGB, exposure fitted, and where the model has faces; None where there is none."""
        pose, images, own = self._build.map_from_camera[index], self._build.sequence.images, self._build.sequence.camera
        assert images is not None and own is not None
        raw = load_image(images, index, own)
        if raw is None or pose is None:
            return None
        colour = cv2.cvtColor(raw, cv2.COLOR_GRAY2BGR) if raw.ndim == 2 else raw
        size = (self._camera.width, self._camera.height)
        photo = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)[..., ::-1].astype(np.float32)
        render = self._scene.render(self._from(pose), np.full((size[1], size[0], 3), np.nan, np.float32))
        known: Mask = np.asarray(np.isfinite(render).all(axis=2))
        if not known.any():
            return None
        render = np.where(known[..., None], render, 255).astype(np.float32)
        return photo, fit_exposure(photo, render, known), known

    def _from(self, pose: Pose3) -> Rays:
        """Rays of pixels; those of all pixels, in their order, are known already."""

        def rays(pixels: Array) -> tuple[Array, Array]:
            own = self._rays
            if len(pixels) != len(own):
                own = np.column_stack([self._camera.undistort(pixels), np.ones(len(pixels))])
                own = own / np.linalg.norm(own, axis=1, keepdims=True)
            directions = own @ pose.rotation.T
            return np.broadcast_to(pose.translation, directions.shape), directions

        return rays


def shrunk(camera: Camera, width: int) -> Camera:
    """The same view in a picture `width` pixels wide."""
    scale = width / camera.width
    matrix = camera.matrix.copy()
    matrix[:2] *= scale
    matrix[:2, 2] += (scale - 1) / 2  # pixel centres are at integer coordinates
    return replace(camera, width=width, height=round(camera.height * scale), matrix=matrix)
