"""STL, binary: one mesh of all faces, Z up, metres or millimetres. STL has no units, names or colours."""

from __future__ import annotations

import numpy as np

from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.shape import face_normal
from recon.model import Model

_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_SCALES = {
    "m": (1.0, b"recon, metres, Z up"),
    "mm": (1000.0, b"recon, millimetres, Z up"),
}  # must not begin with "solid": readers would take it for ASCII


def write_stl(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All faces as triangles, normals into the free space."""
    scale, header = _SCALES[options.stl_units]
    records = [np.zeros(len(face.triangles), _RECORD) for face in model.faces]
    for face, record in zip(model.faces, records, strict=True):
        record["vertices"] = scale * face.vertices[face.triangles]
        record["normal"] = face_normal(face)
    body = np.concatenate([np.zeros(0, _RECORD), *records])
    return Output(header.ljust(80, b"\0") + len(body).to_bytes(4, "little") + body.tobytes())
