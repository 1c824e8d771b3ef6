"""Which room leads to which: the adjacency graph of a plan, for planning ways and for search by room."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from recon.doorways import Doorway, doorways
from recon.exporters.output import Output
from recon.geometry import Array
from recon.model import Model, Room
from recon.plan import label_spot

BEYOND = "unknown"
"""Node of everything behind doorways of which only one side was seen."""


def write_room_graph(model: Model, stem: str) -> Output:
    """Node-link JSON, as networkx reads it: rooms are nodes, doors and passages edges; windows are no way through.

    A doorway with no known room behind it leads to the node `unknown`. Rooms that share two doors have two edges.
    """
    ways = [d for d in doorways(model.layout) if d.type != "window" and d.rooms[0] != d.rooms[1]]
    edges = [edge for way in ways if (edge := _edge(way)) is not None]
    nodes = [_node(room) for room in model.layout.rooms]
    if any(BEYOND in (edge["source"], edge["target"]) for edge in edges):
        nodes.append({"id": BEYOND, "name": BEYOND})
    head = {"directed": False, "multigraph": True, "graph": {"name": model.name, "frame": "map", "units": "m"}}
    lines = [f' "{key}": {json.dumps(value, ensure_ascii=False)}' for key, value in head.items()]
    for key, items in (("nodes", nodes), ("edges", edges)):
        rows = ",\n  ".join(json.dumps(item, ensure_ascii=False, allow_nan=False) for item in items)
        lines.append(f' "{key}": [\n  {rows}\n ]' if rows else f' "{key}": []')
    return Output(("{\n" + ",\n".join(lines) + "\n}\n").encode("utf-8", "replace"))


def _node(room: Room) -> dict[str, Any]:
    """at: a place inside the room, where its label goes."""
    spot = label_spot(room.polygon)[0] if room.area > 1e-6 else room.polygon.mean(axis=0)
    return {"id": room.id, "name": room.name, "area": round(float(room.area), 6), "at": _point(spot)}


def _edge(way: Doorway) -> dict[str, Any] | None:
    """at: the middle of the doorway. Its key is the first of its openings in layout.json."""
    source, target = (BEYOND if room is None else room for room in way.rooms)
    if source == target:
        return None
    return {
        "source": source,
        "target": target,
        "key": way.id,
        "openings": [opening.id for opening in way.openings],
        "type": way.type,
        "open": way.open or way.type == "passage",
        "width": round(way.width, 6),
        "height": round(way.top - way.bottom, 6),
        "at": _point(0.5 * (way.start + way.end)),
    }


def _point(point: Array) -> list[float]:
    return [round(float(v), 6) + 0.0 for v in np.asarray(point)]
