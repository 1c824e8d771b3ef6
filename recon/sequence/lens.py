"""Lens models, compiled: as cv2.projectPoints, which spends most of its time on derivatives that nobody asked for."""

from __future__ import annotations

import numba
import numpy as np

from recon.geometry import Array

NEAREST = 1e-9
"""m along the axis: what is nearer, or behind, has no picture."""


@numba.njit(cache=True, nogil=True)
def project_rational(points: Array, pinhole: Array, bent: Array) -> Array:
    """Pixels (N, 2) of points (N, 3) of the camera frame, nan behind it: radial and tangential distortion (Brown).

    pinhole: fx, fy, cx, cy. bent: (8,) in OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6, 0 where absent.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = bent
    out = np.full((len(points), 2), np.nan)
    for i in range(len(points)):
        z = points[i, 2]
        if z > NEAREST:
            x, y = points[i, 0] / z, points[i, 1] / z
            r2 = x * x + y * y
            radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
            v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
            out[i, 0], out[i, 1] = pinhole[0] * u + pinhole[2], pinhole[1] * v + pinhole[3]
    return out


@numba.njit(cache=True, nogil=True)
def project_equidistant(points: Array, pinhole: Array, bent: Array) -> Array:
    """As `project_rational` for a fisheye: the angle off the axis, bent, is the distance from the centre.

    Kannala and Brandt 2006, eq. 6. bent: k1 k2 k3 k4, the rest unused.
    """
    out = np.full((len(points), 2), np.nan)
    for i in range(len(points)):
        z = points[i, 2]
        if z > NEAREST:
            x, y = points[i, 0] / z, points[i, 1] / z
            r = np.sqrt(x * x + y * y)
            scale = 1.0
            if r > 1e-8:
                angle = np.arctan(r)
                a2 = angle * angle
                scale = angle * (1 + a2 * (bent[0] + a2 * (bent[1] + a2 * (bent[2] + a2 * bent[3])))) / r
            out[i, 0], out[i, 1] = pinhole[0] * x * scale + pinhole[2], pinhole[1] * y * scale + pinhole[3]
    return out
