"""Lines, vanishing points and ground-wall boundary candidates of one image (paper, section 2.2)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.config import VisionConfig
from recon.errors import ConfigError
from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.vision.edges import EdgeChains, find_edges
from recon.vision.frame import OUTLIER, VERTICAL, FrameLines
from recon.vision.lines import Segments, fit_segments
from recon.vision.lsd import lsd_chains
from recon.vision.planes import planes_of
from recon.vision.rectify import rectifier
from recon.vision.vanishing import assign, find_directions, frame_near, keep_found

MIN_IMAGE_SIZE = 16  # px
CANNY_SIGMA_FLOOR = 0.05  # px
LSD_SIGMA = 0.3  # px: LSD tells no residuals
MAX_SWAY = np.deg2rad(2.0)


def detect_lines(grey: NDArray[np.uint8], camera: Camera, config: VisionConfig, seed: int) -> FrameLines:
    """Line segments of a raw image (H, W), grey, or (H, W, 3), colour, with their vanishing points.

    Edge points are found in the raw image and undistorted before any line is fitted, so nothing is resampled. An image
    with too few lines gives nan directions; all arrays may be empty. Raises ConfigError for an unknown detector.
    """
    if grey.ndim == 3:
        grey = np.asarray(cv2.cvtColor(grey, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    segments = _segments(grey, camera, config)
    planes = planes_of(segments.endpoints, segments.sigmas, camera)
    directions = find_directions(planes, seed)
    return _frame(segments.endpoints, segments.sigmas, assign(planes, directions), directions, camera)


def relabel(frame: FrameLines, camera: Camera, vertical: Array) -> FrameLines:
    """`frame` with the vertical (3,) of the whole drive: labels, horizontals orthogonal to it, boundary candidates.

    A frame may sway a little about that vertical: lines that only agree with its own are labelled all the same.
    """
    planes = planes_of(frame.endpoints, frame.sigmas, camera)
    vertical = np.asarray(vertical, dtype=np.float64) / np.linalg.norm(vertical)
    directions = keep_found(planes, frame_near(planes, vertical, fixed_vertical=True), vertical_known=True)
    labels = assign(planes, directions)
    swayed = frame_near(planes, vertical, fixed_vertical=False)
    if swayed[0] @ vertical > np.cos(MAX_SWAY):
        labels = np.where(labels == OUTLIER, assign(planes, keep_found(planes, swayed)), labels)
    return _frame(frame.endpoints, frame.sigmas, labels, directions, camera)


def horizon(camera: Camera, vertical: Array) -> Array:
    """The horizon of a direction down (3,) as (3,) l in rectified pixels: l . (x, y, 1) > 0 below it; unit normal."""
    line = np.linalg.inv(camera.matrix).T @ vertical
    return np.asarray(line / max(float(np.hypot(line[0], line[1])), 1e-12))


def boundary_candidates(
    endpoints: Array, labels: NDArray[np.int64], camera: Camera, vertical: Array
) -> NDArray[np.int64]:
    """Indices (B,) of the lines that are not vertical and lie wholly below the horizon.

    Without a vertical (nan) the horizon is taken for the row of the principal point.
    """
    line = horizon(camera, vertical if np.isfinite(vertical).all() else np.array([0.0, 1.0, 0.0]))
    below = (endpoints @ line[:2] + line[2] > 0).all(axis=1)
    return np.flatnonzero(below & (labels != VERTICAL))


def _segments(grey: NDArray[np.uint8], camera: Camera, config: VisionConfig) -> Segments:
    """Segments in rectified pixels, longest first."""
    if config.detector not in ("canny", "lsd"):
        raise ConfigError(f'vision.detector is "{config.detector}", expected "canny" or "lsd"')
    if min(grey.shape) < MIN_IMAGE_SIZE:
        return Segments(np.zeros((0, 2, 2)), np.zeros(0))
    chains: EdgeChains = find_edges(grey) if config.detector == "canny" else lsd_chains(grey)
    points, stretch = rectifier(camera)(chains.points)
    floor = CANNY_SIGMA_FLOOR if config.detector == "canny" else LSD_SIGMA
    return fit_segments(points, chains.gradients, chains.starts, stretch, config.min_length, floor)


def _frame(endpoints: Array, sigmas: Array, labels: NDArray[np.int64], directions: Array, camera: Camera) -> FrameLines:
    """Everything put together."""
    boundary = boundary_candidates(endpoints, labels, camera, directions[0])
    return FrameLines(endpoints, sigmas, labels, directions, boundary)
