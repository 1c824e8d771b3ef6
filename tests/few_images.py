"""A drive with some of its images, for tests that need not all of them."""

from __future__ import annotations

from dataclasses import replace

from recon.sequence.sequence import Sequence


def every_image(step: int, drive: Sequence) -> Sequence:
    """The drive with its first image, the `step`-th after it and so on."""
    images = drive.images
    assert images is not None and images.source is None
    stamps, paths, names = images.timestamps[::step], images.paths[::step], images.names[::step]
    return replace(drive, images=replace(images, timestamps=stamps, paths=paths, names=names))
