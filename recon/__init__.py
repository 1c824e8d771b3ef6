"""Offline indoor 3D reconstruction from a camera and a 2D LiDAR.

The house: `recon.pipeline.build` shows every stage, top to bottom; `recon.model` is what comes out and what the
exporters see. Conventions (frames, units, names of transforms) are in `recon.geometry`.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("recon")
except PackageNotFoundError:  # run from a checkout that was not installed
    __version__ = "0+unknown"
