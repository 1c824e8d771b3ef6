"""Makes the pictures in docs/images from sequence folders: `python benchmarks/pictures.py SEQ [SEQ ...]`."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from recon.config import Config
from recon.dollhouse import render_dollhouse
from recon.labels import LabelRenderer, draw_labels
from recon.pipeline import Build, build
from recon.render import render_model
from recon.sequence.folder import read_sequence
from recon.sequence.images import load_image

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
VIEWS = 4


def main() -> None:
    IMAGES.mkdir(parents=True, exist_ok=True)
    for folder in map(Path, sys.argv[1:]):
        made = build(read_sequence(folder), Config())
        name = made.model.name
        house = cv2.resize(render_dollhouse(made.model, (2400, 1500)), (1200, 750), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(IMAGES / f"{name}.png"), house[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
        cv2.imwrite(str(IMAGES / f"{name}_views.jpg"), views(made), [cv2.IMWRITE_JPEG_QUALITY, 85])


def views(made: Build) -> np.ndarray:  # type: ignore[type-arg]
    """Photo, labels and render of some images, one a column."""
    images, camera = made.sequence.images, made.sequence.camera
    assert images is not None and camera is not None
    posed = [i for i, pose in enumerate(made.map_from_camera) if pose is not None]
    labels = LabelRenderer(made.model.faces, camera, made.model.layout.objects)
    columns = []
    for i in (posed[k] for k in np.linspace(0, len(posed) - 1, VIEWS + 2).astype(int)[1:-1]):
        photo, pose = load_image(images, i, camera), made.map_from_camera[i]
        if photo is None or pose is None:
            continue
        render = render_model(made.model, camera, pose)[:, :, ::-1]
        stack = np.vstack([photo, draw_labels(photo, labels.render(pose)), render])
        columns.append(cv2.resize(stack, (320, 320 * stack.shape[0] // stack.shape[1]), interpolation=cv2.INTER_AREA))
    return np.hstack(columns)


if __name__ == "__main__":
    main()
