"""Pictures of lines for people, in the colours of the paper's figure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.sequence.camera import Camera
from recon.vision.frame import HORIZONTAL_1, HORIZONTAL_2, OUTLIER, VERTICAL, FrameLines
from recon.vision.frame_lines import horizon

# Blue, green, red
COLOURS = {
    VERTICAL: (255, 255, 255),
    HORIZONTAL_1: (255, 90, 30),
    HORIZONTAL_2: (40, 40, 255),
    OUTLIER: (120, 120, 120),
}
CANDIDATE, HORIZON = (0, 235, 255), (255, 0, 255)
FRACTION_BITS = 4


def draw_lines(image: NDArray[np.uint8], frame: FrameLines, camera: Camera) -> NDArray[np.uint8]:
    """A copy of the rectified image (H, W, 3) BGR or (H, W), with its lines.

    Vertical lines white, the two horizontal directions blue and red, outliers grey; boundary candidates on a yellow
    ground; the horizon magenta.
    """
    out = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    for i in frame.boundary:
        _draw(out, frame.endpoints[i], CANDIDATE, 4)
    for ends, label in zip(frame.endpoints, frame.labels, strict=True):
        _draw(out, ends, COLOURS[int(label)], 1)
    if np.isfinite(frame.directions[0]).all():
        a, b, c = horizon(camera, frame.directions[0])
        if abs(b) > 1e-6:
            ends = np.array([[x, -(a * x + c) / b] for x in (0.0, out.shape[1] - 1.0)])
            _draw(out, ends, HORIZON, 1)
    return np.asarray(out, dtype=np.uint8)


def _draw(image: NDArray[np.uint8], ends: NDArray[np.float64], colour: tuple[int, int, int], width: int) -> None:
    """One segment (2, 2) with sub-pixel ends."""
    limit = 2.0**26 / 2**FRACTION_BITS
    p, q = (tuple(int(v) for v in np.round(np.clip(e, -limit, limit) * 2**FRACTION_BITS)) for e in ends)
    cv2.line(image, p, q, colour, width, cv2.LINE_AA, FRACTION_BITS)
