"""STL, binary: one mesh of all faces, Z up, metres or millimetres. STL has no units, names or colours."""

from __future__ import annotations

import numpy as np

from recon.exporters.options import DEFAULTS, ExportOptions, StlUnits
from recon.exporters.output import Output
from recon.geometry import Array
from recon.model import Model

_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_SCALES = {
    "m": (1.0, b"recon, metres, Z up"),
    "mm": (1000.0, b"recon, millimetres, Z up"),
}  # must not begin with "solid": readers would take it for ASCII


def write_stl(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All faces as triangles, normals into the free space."""
    corners = [np.zeros((0, 3, 3)), *(face.vertices[face.triangles] for face in model.faces)]
    return Output(stl_of(np.concatenate(corners), options.stl_units))


def stl_of(corners: Array, units: StlUnits = "m") -> bytes:
    """A file of triangles (T, 3, 3), m, counter-clockwise seen from outside."""
    scale, header = _SCALES[units]
    records = np.zeros(len(corners), _RECORD)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records["vertices"] = scale * corners
    records["normal"] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return header.ljust(80, b"\0") + len(records).to_bytes(4, "little") + records.tobytes()
