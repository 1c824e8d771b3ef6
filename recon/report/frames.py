"""Images in the report: how well the model shows what each of them shows, the worst first."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from recon.evaluate.fidelity import Mask, Picture, fidelity, fit_exposure
from recon.evaluate.views import side_by_side
from recon.render import TexturedScene, render_scene
from recon.report.html import data_address, figure, jpeg, section
from recon.sequence.camera import Camera
from recon.sequence.images import load_image

if TYPE_CHECKING:
    from recon.pipeline import Build

LOOKED_AT = 20
"""Images compared with the model, evenly over the drive."""
SMALL = 160
"""Pixels, the width at which they are."""
SHOWN = 2
"""Of the worst."""
LARGEST = 480
"""Pixels, the width of a photo that is shown."""


@dataclass(frozen=True)
class _Frame:
    """Image `index`, and how like it (PSNR, dB) the model is where it has faces."""

    index: int
    psnr: float


def frames(build: Build, folder: Path) -> str:
    """The images that the model shows worst, with what it shows instead, and every pixel's label on some."""
    return _compared(build) + section("What every pixel shows", _overlays(folder))


def _compared(build: Build) -> str:
    """Photo, model and difference of the images that fit the model worst, and of the one in the middle."""
    found = sorted(_scores(build), key=lambda frame: frame.psnr)
    if not found:
        return ""
    chosen = [*found[:SHOWN], *found[len(found) // 2 :][:1]] if len(found) > SHOWN else found
    images, camera = build.sequence.images, build.sequence.camera
    assert images is not None and camera is not None
    size = min(LARGEST, camera.width)
    scene = TexturedScene(build.model.faces, pixel_angle=_pixel_angle(shrunk(camera, size)), edge_samples=2)
    shown = []
    for frame in chosen:
        pair = _pair(build, scene, shrunk(camera, size), frame.index)
        if pair is not None:
            which = "worst" if frame in found[:SHOWN] else "middling"
            caption = f"{Path(images.names[frame.index]).name}, {which}: {frame.psnr:.1f} dB"
            shown.append(figure(jpeg(side_by_side(*pair)[..., ::-1], 80), caption, "wide"))
    words = (
        f"Photo, model, and twice their difference about grey, exposure fitted. Of {len(found)} images, evenly over "
        "the drive, those that the model shows worst: people, furniture and what the layout does not hold stand out."
    )
    return section("Photos beside the model", f"<p>{words}</p>" + "".join(shown))


def _scores(build: Build) -> list[_Frame]:
    camera = build.sequence.camera
    if camera is None or not any(face.texture is not None for face in build.model.faces):
        return []
    posed = [i for i, pose in enumerate(build.map_from_camera) if pose is not None]
    small = shrunk(camera, min(SMALL, camera.width))
    scene, out = TexturedScene(build.model.faces, pixel_angle=_pixel_angle(small), edge_samples=1), []
    for i in np.unique(np.linspace(0, len(posed) - 1, min(LOOKED_AT, len(posed))).astype(int)):
        pair = _pair(build, scene, small, posed[i])
        if pair is not None:
            out.append(_Frame(posed[i], fidelity(*pair).psnr))
    return out


def _pair(build: Build, scene: TexturedScene, camera: Camera, index: int) -> tuple[Picture, Picture, Mask] | None:
    """Photo and model (H, W, 3) RGB at the size of `camera`, exposure fitted, and where the model has faces."""
    pose, images, own = build.map_from_camera[index], build.sequence.images, build.sequence.camera
    assert images is not None and own is not None
    raw = load_image(images, index, own)
    if raw is None or pose is None:
        return None
    colour = cv2.cvtColor(raw, cv2.COLOR_GRAY2BGR) if raw.ndim == 2 else raw
    size = (camera.width, camera.height)
    photo = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)[..., ::-1].astype(np.float32)
    render = render_scene(scene, camera, pose, (np.nan, np.nan, np.nan))
    known: Mask = np.asarray(np.isfinite(render).all(axis=2))
    if not known.any():
        return None
    render = np.where(known[..., None], render, 255).astype(np.float32)
    return photo, fit_exposure(photo, render, known), known


def _pixel_angle(camera: Camera) -> float:
    return 1 / float(camera.matrix[0, 0])


def shrunk(camera: Camera, width: int) -> Camera:
    """The same view in a picture `width` pixels wide."""
    scale = width / camera.width
    matrix = camera.matrix.copy()
    matrix[:2] *= scale
    matrix[:2, 2] += (scale - 1) / 2  # pixel centres are at integer coordinates
    return replace(camera, width=width, height=round(camera.height * scale), matrix=matrix)


def _overlays(folder: Path) -> str:
    pictures = sorted((folder / "overlays").glob("*.jpg")) if (folder / "overlays").is_dir() else []
    figures = [figure(data_address(path.read_bytes(), "image/jpeg"), path.stem) for path in pictures]
    return f'<div class="views">{"".join(figures)}</div>' if figures else ""
