"""STL, binary: the building as one closed solid, Z up, metres or millimetres. STL has no units, names or colours."""

from __future__ import annotations

import numpy as np

from recon.body import building_body
from recon.exporters.enclosure import fewest
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
    """The building's body (`recon.body`): watertight, with thickness, to be printed or simulated."""
    vertices, triangles = building_body(model.layout, options.ceiling)
    most = options.max_triangles
    notes = (fewest(len(triangles)),) if most is not None and len(triangles) > most else ()
    return Output(stl_of(vertices[triangles], options.stl_units), notes=notes)


def stl_of(corners: Array, units: StlUnits = "m") -> bytes:
    """A file of triangles (T, 3, 3), m, counter-clockwise seen from outside; none that rounding flattens."""
    scale, header = _SCALES[units]
    rounded = (scale * corners).astype("<f4")
    whole = [(rounded[:, k] != rounded[:, k - 1]).any(axis=1) for k in range(3)]
    corners, rounded = corners[np.all(whole, axis=0)], rounded[np.all(whole, axis=0)]
    records = np.zeros(len(corners), _RECORD)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records["vertices"] = rounded
    records["normal"] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return header.ljust(80, b"\0") + len(records).to_bytes(4, "little") + records.tobytes()
