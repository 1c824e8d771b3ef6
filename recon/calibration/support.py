"""How well a camera pose explains image lines by wall feet: the consensus of recursive RANSAC.

The paper counts LiDAR points near ground-map lines (2.4). Here the feet of the LiDAR segments are projected into the
image and compared there, where the noise is the same near and far.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

SAMPLE_STEP = 12.0  # pixels between the places where a projected foot is compared
MAX_SINE = 0.12  # of the angle between a foot and an image line that explains it
NEAR = 0.05  # m in front of the camera


@dataclass(frozen=True)
class CalibrationFrames:
    """Boundary candidates and LiDAR segments of F images, flat; part i is rows offsets[i]:offsets[i + 1].

    lines: (B, 2, 2) pixels of the rectified image; line_groups: (B,) horizontal direction 0, 1 or -1.
    segments: (M, 2, 2) m, platform frame at the image's time; segment_groups: (M,) direction 0, 1 or -1.
    images: (F,) index of each image in the sequence.
    """

    lines: Array
    line_groups: NDArray[np.int64]
    line_offsets: NDArray[np.int64]
    segments: Array
    segment_groups: NDArray[np.int64]
    segment_offsets: NDArray[np.int64]
    images: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.images)

    def thinned(self, most: int) -> CalibrationFrames:
        """At most that many images, evenly spread."""
        if len(self) <= most:
            return self
        keep = np.unique(np.linspace(0, len(self) - 1, most).astype(np.int64))
        lines = [np.arange(self.line_offsets[i], self.line_offsets[i + 1]) for i in keep]
        segments = [np.arange(self.segment_offsets[i], self.segment_offsets[i + 1]) for i in keep]
        line, segment = np.concatenate(lines), np.concatenate(segments)
        return CalibrationFrames(
            self.lines[line],
            self.line_groups[line],
            np.cumsum([0, *map(len, lines)]),
            self.segments[segment],
            self.segment_groups[segment],
            np.cumsum([0, *map(len, segments)]),
            self.images[keep],
        )

    def with_segments(self, keep: NDArray[np.bool_]) -> CalibrationFrames:
        """The same images with those segments (M,) only."""
        before = np.concatenate([[0], np.cumsum(keep)])
        return replace(
            self,
            segments=self.segments[keep],
            segment_groups=self.segment_groups[keep],
            segment_offsets=before[self.segment_offsets],
        )


@dataclass(frozen=True)
class Matches:
    """N overlaps of a projected foot with an image line.

    segment, line, frame: (N,) indices. pixels: (N, 2, 2) the ends of the overlap, on the image line.
    """

    segment: NDArray[np.int64]
    line: NDArray[np.int64]
    frame: NDArray[np.int64]
    pixels: Array

    def __len__(self) -> int:
        return len(self.segment)


@njit(cache=True)
def _project(
    a: Array, b: Array, rotation: Array, centre: Array, k: Array, size: Array, out: Array
) -> bool:  # pragma: no cover - compiled
    """Foot a-b on the floor as pixels out (2, 2), clipped to what is in front and in the image."""
    p = rotation @ np.array([a[0] - centre[0], a[1] - centre[1], -centre[2]])
    q = rotation @ np.array([b[0] - centre[0], b[1] - centre[1], -centre[2]])
    if p[2] < NEAR and q[2] < NEAR:
        return False
    if p[2] < NEAR:
        p = p + (q - p) * ((NEAR - p[2]) / (q[2] - p[2]))
    elif q[2] < NEAR:
        q = q + (p - q) * ((NEAR - q[2]) / (p[2] - q[2]))
    x0, y0 = k[0, 0] * p[0] / p[2] + k[0, 1] * p[1] / p[2] + k[0, 2], k[1, 1] * p[1] / p[2] + k[1, 2]
    x1, y1 = k[0, 0] * q[0] / q[2] + k[0, 1] * q[1] / q[2] + k[0, 2], k[1, 1] * q[1] / q[2] + k[1, 2]
    t0, t1 = 0.0, 1.0
    for side in range(4):  # Liang-Barsky
        d = (x1 - x0) if side < 2 else (y1 - y0)
        start = x0 if side < 2 else y0
        limit = size[0] - 1 if side < 2 else size[1] - 1
        num, den = (start, -d) if side % 2 == 0 else (limit - start, d)
        if den == 0:
            if num < 0:
                return False
        elif den < 0:
            t0 = max(t0, num / den)
        else:
            t1 = min(t1, num / den)
    if t0 >= t1:
        return False
    out[0, 0], out[0, 1] = x0 + t0 * (x1 - x0), y0 + t0 * (y1 - y0)
    out[1, 0], out[1, 1] = x0 + t1 * (x1 - x0), y0 + t1 * (y1 - y0)
    return True


@njit(cache=True)
def _support(
    rotation: Array,
    centre: Array,
    k: Array,
    size: Array,
    lines: Array,
    line_offsets: NDArray[np.int64],
    segments: Array,
    segment_offsets: NDArray[np.int64],
    frames: NDArray[np.int64],
    tolerance: float,
) -> Array:  # pragma: no cover - compiled
    """(len(frames), 2): pixels of projected foot that image lines explain (MSAC weights), and pixels projected."""
    out = np.zeros((len(frames), 2))
    foot = np.empty((2, 2))
    near = np.empty((len(lines), 5))  # of lines along the foot: start x, y, direction x, y, length
    for row in range(len(frames)):
        f = frames[row]
        for m in range(segment_offsets[f], segment_offsets[f + 1]):
            if not _project(segments[m, 0], segments[m, 1], rotation, centre, k, size, foot):
                continue
            dx, dy = foot[1, 0] - foot[0, 0], foot[1, 1] - foot[0, 1]
            length = np.sqrt(dx * dx + dy * dy)
            if length < SAMPLE_STEP:
                continue
            dx, dy = dx / length, dy / length
            count = 0
            for b in range(line_offsets[f], line_offsets[f + 1]):
                ex, ey = lines[b, 1, 0] - lines[b, 0, 0], lines[b, 1, 1] - lines[b, 0, 1]
                e = np.sqrt(ex * ex + ey * ey)
                if abs(dx * ey - dy * ex) <= MAX_SINE * e:
                    near[count] = lines[b, 0, 0], lines[b, 0, 1], ex / e, ey / e, e
                    count += 1
            n = int(length / SAMPLE_STEP) + 1
            for i in range(n):
                s = (i + 0.5) / n * length
                x, y = foot[0, 0] + s * dx, foot[0, 1] + s * dy
                best = 0.0
                for c in range(count):
                    px, py, ex, ey, e = near[c]
                    across = (x - px) * ey - (y - py) * ex
                    if abs(across) >= tolerance:
                        continue
                    along = (x - px) * ex + (y - py) * ey
                    if -tolerance <= along <= e + tolerance:
                        best = max(best, 1.0 - (across / tolerance) ** 2)
                out[row, 0] += best * length / n
            out[row, 1] += length
    return out


@njit(cache=True)
def _match(
    rotation: Array,
    centre: Array,
    k: Array,
    size: Array,
    lines: Array,
    line_offsets: NDArray[np.int64],
    segments: Array,
    segment_offsets: NDArray[np.int64],
    frame: int,
    tolerance: float,
    found: NDArray[np.int64],
    pixels: Array,
) -> int:  # pragma: no cover - compiled
    """Fill found (N, 2) [segment, line] and pixels (N, 2, 2) with overlaps closer than tolerance; returns N."""
    count = 0
    foot = np.empty((2, 2))
    for m in range(segment_offsets[frame], segment_offsets[frame + 1]):
        if not _project(segments[m, 0], segments[m, 1], rotation, centre, k, size, foot):
            continue
        for b in range(line_offsets[frame], line_offsets[frame + 1]):
            ex, ey = lines[b, 1, 0] - lines[b, 0, 0], lines[b, 1, 1] - lines[b, 0, 1]
            e = np.hypot(ex, ey)
            ex, ey = ex / e, ey / e
            s0 = (foot[0, 0] - lines[b, 0, 0]) * ex + (foot[0, 1] - lines[b, 0, 1]) * ey
            s1 = (foot[1, 0] - lines[b, 0, 0]) * ex + (foot[1, 1] - lines[b, 0, 1]) * ey
            d0 = (foot[0, 0] - lines[b, 0, 0]) * ey - (foot[0, 1] - lines[b, 0, 1]) * ex
            d1 = (foot[1, 0] - lines[b, 0, 0]) * ey - (foot[1, 1] - lines[b, 0, 1]) * ex
            lo, hi = max(0.0, min(s0, s1)), min(e, max(s0, s1))
            if hi - lo < SAMPLE_STEP or count >= len(found):
                continue
            slope = (d1 - d0) / (s1 - s0)
            if abs(slope) > MAX_SINE or max(abs(d0 + slope * (lo - s0)), abs(d0 + slope * (hi - s0))) > tolerance:
                continue
            found[count, 0], found[count, 1] = m, b
            pixels[count, 0, 0], pixels[count, 0, 1] = lines[b, 0, 0] + lo * ex, lines[b, 0, 1] + lo * ey
            pixels[count, 1, 0], pixels[count, 1, 1] = lines[b, 0, 0] + hi * ex, lines[b, 0, 1] + hi * ey
            count += 1
    return count


def support(
    frames: CalibrationFrames,
    camera: Camera,
    platform_from_camera: Pose3,
    tolerance: float,
    which: NDArray[np.int64] | None = None,
    offset: float = 0.0,
) -> Array:
    """(F, 2) for all frames or those in `which`: pixels of wall foot that lines explain, and pixels in the image.

    offset: m by which the visible foot stands in front of what the scanner sees (a baseboard).
    """
    segments = frames.segments
    if offset:
        along = segments[:, 1] - segments[:, 0]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
        segments = segments + offset * normal[:, None]
    return _support(
        np.ascontiguousarray(platform_from_camera.rotation.T),
        platform_from_camera.translation,
        camera.matrix,
        np.array([camera.width, camera.height], dtype=np.float64),
        frames.lines,
        frames.line_offsets,
        segments,
        frames.segment_offsets,
        np.arange(len(frames)) if which is None else which,
        tolerance,
    )


def match(
    frames: CalibrationFrames,
    camera: Camera,
    platform_from_camera: Pose3,
    tolerance: float,
    which: NDArray[np.int64] | None = None,
) -> Matches:
    """All overlaps of projected feet with image lines closer than `tolerance` pixels over their common length."""
    rotation = np.ascontiguousarray(platform_from_camera.rotation.T)
    size = np.array([camera.width, camera.height], dtype=np.float64)
    found, pixels = np.empty((4096, 2), np.int64), np.empty((4096, 2, 2))
    parts: list[tuple[NDArray[np.int64], Array, int]] = []
    for f in np.arange(len(frames)) if which is None else which:
        n = _match(
            rotation,
            platform_from_camera.translation,
            camera.matrix,
            size,
            frames.lines,
            frames.line_offsets,
            frames.segments,
            frames.segment_offsets,
            int(f),
            tolerance,
            found,
            pixels,
        )
        parts.append((found[:n].copy(), pixels[:n].copy(), int(f)))
    if not parts:
        none = np.zeros(0, np.int64)
        return Matches(none, none, none, np.zeros((0, 2, 2)))
    pairs = np.concatenate([p[0] for p in parts])
    owner = np.concatenate([np.full(len(p[0]), p[2]) for p in parts])
    return Matches(pairs[:, 0], pairs[:, 1], owner, np.concatenate([p[1] for p in parts]))


def score(counts: Array) -> float:
    """Evidence of a hypothesis: explained pixels against what chance would explain, in its standard deviations.

    counts: (F, 2) explained and projected pixels an image.
    """
    explained, projected = counts.sum(axis=0)
    return float((explained - 0.1 * projected) / np.sqrt(0.1 * projected + 100.0))
