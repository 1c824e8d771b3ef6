"""Semantic labels of every image, and overlays of some for people (paper, figure 1c)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from recon.labels import OBJECT, LabelRenderer, draw_labels
from recon.sequence.images import load_image

if TYPE_CHECKING:
    from recon.pipeline import Build

OVERLAYS = 12  # evenly spread over the drive


def write_overlays(build: Build, folder: Path) -> None:
    """labels/STEM.png (16 bit) of every image with a pose; overlays/STEM.jpg of some."""
    camera, images = build.sequence.camera, build.sequence.images
    posed = [i for i, pose in enumerate(build.map_from_camera) if pose is not None]
    if camera is None or images is None or not posed or not build.model.faces:
        return
    (folder / "labels").mkdir()
    (folder / "overlays").mkdir()
    chosen = {posed[i] for i in np.linspace(0, len(posed) - 1, min(OVERLAYS, len(posed))).astype(int)}
    renderer = LabelRenderer(build.model.faces, camera)
    for i in posed:
        pose = build.map_from_camera[i]
        assert pose is not None
        labels = renderer.render(pose)
        objects = build.objects.of(i)
        if objects is not None:
            labels[objects] = OBJECT
        stem = Path(images.names[i]).stem
        (folder / "labels" / f"{stem}.png").write_bytes(cv2.imencode(".png", labels)[1].tobytes())
        image = load_image(images, i, camera) if i in chosen else None
        if image is not None:
            picture = draw_labels(image, labels)
            data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
            (folder / "overlays" / f"{stem}.jpg").write_bytes(data.tobytes())
