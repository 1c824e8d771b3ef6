"""Maps and drawings: whether the pictures that they name are there, and whether their shapes are valid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from recon.clients.finding import Broken
from recon.errors import InputError

MAP_KEYS = "image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate"
"""What ROS map_server refuses to start without."""


def pdf(path: Path) -> str:
    """PDFium, the reader of Chromium, draws every page."""
    import pypdfium2

    try:
        document = pypdfium2.PdfDocument(path)
        sizes = [page.get_size() for page in document]
        blank = [k + 1 for k, page in enumerate(document) if page.render(scale=0.5).to_numpy().min() > 250]
    except pypdfium2.PdfiumError as error:
        raise Broken(f"cannot be read: {error}") from None
    if blank or not sizes:
        raise Broken(f"page {blank[0]} is white" if blank else "has no page")
    width, height = (value / 72 * 25.4 for value in sizes[0])
    return f"{len(sizes)} pages, the first {width:.0f} x {height:.0f} mm"


def nav_map(path: Path) -> str:
    """A map of ROS map_server: its keys, and the picture that it names."""
    import numpy as np

    from recon.sequence.yaml_file import read_mapping

    try:
        content = read_mapping(path)
    except InputError as error:
        raise Broken(str(error)) from None
    missing = [key for key in MAP_KEYS if key not in content]
    if missing:
        raise Broken(f"has no {missing[0]}, is no map")
    try:
        resolution, (_, _, yaw) = float(content["resolution"]), map(float, content["origin"])
    except (TypeError, ValueError):
        raise Broken("resolution or origin are no numbers, expected metres and x, y, yaw") from None
    if not (resolution > 0 and np.isfinite(resolution) and np.isfinite(yaw)):
        raise Broken(f"resolution is {resolution}, expected metres")
    rows, columns = _picture(path.parent / str(content["image"]))
    return f"{columns} x {rows} cells, {columns * resolution:.2f} x {rows * resolution:.2f} m"


def png(path: Path) -> str:
    """A picture, to its last row."""
    rows, columns = _picture(path)
    return f"{columns} x {rows} pixels"


def _picture(path: Path) -> tuple[int, int]:
    """Rows and columns, by Pillow, which refuses pictures that are cut short."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
            return picture.height, picture.width
    except FileNotFoundError:
        raise Broken(f"{path.name} is missing") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise Broken(f"{path.name} cannot be read: {error}") from None


def geojson(path: Path) -> str:
    """Every geometry, by Shapely's rules."""
    import shapely

    features = _json(path).get("features")
    if not isinstance(features, list):
        raise Broken("has no list of features")
    for number, feature in enumerate(features):
        try:
            geometry = feature["geometry"] and shapely.from_geojson(json.dumps(feature["geometry"]))
        except (KeyError, TypeError, shapely.GEOSException) as error:
            raise Broken(f"feature {number} is none: {error}") from None
        if geometry is not None and not geometry.is_valid:
            raise Broken(f"feature {feature.get('id', number)}: {shapely.is_valid_reason(geometry)}")
    return f"{len(features)} features, all valid"


def room_graph(path: Path) -> str:
    """Nodes, and edges between them."""
    content = _json(path)
    try:
        nodes = {node["id"] for node in content["nodes"]}
        ends = [edge[key] for edge in content["edges"] for key in ("source", "target")]
    except (KeyError, TypeError) as error:
        raise Broken(f"is no graph: {error}") from None
    unknown = [end for end in ends if end not in nodes]
    if unknown:
        raise Broken(f"an edge leads to {unknown[0]!r}, which is no node")
    return f"{len(nodes)} nodes, {len(ends) // 2} edges"


def _json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise Broken(f"is no JSON: {error}") from None
    if not isinstance(content, dict):
        raise Broken("is no JSON object")
    return content
