"""STL, binary: one mesh of all faces, metres, Z up. STL has no units, names or colours."""

from __future__ import annotations

import numpy as np

from recon.exporters.output import Output
from recon.exporters.shape import face_normal
from recon.model import Model

_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = b"recon, metres, Z up"  # must not begin with "solid": readers would take it for ASCII


def write_stl(model: Model, stem: str) -> Output:
    """All faces as triangles, normals into the free space."""
    records = [np.zeros(len(face.triangles), _RECORD) for face in model.faces]
    for face, record in zip(model.faces, records, strict=True):
        record["vertices"] = face.vertices[face.triangles]
        record["normal"] = face_normal(face)
    body = np.concatenate([np.zeros(0, _RECORD), *records])
    return Output(_HEADER.ljust(80, b"\0") + len(body).to_bytes(4, "little") + body.tobytes())
