"""layout.json of FORMAT.md, with the model's name and notes."""

from __future__ import annotations

import json

from recon.exporters.output import Output
from recon.layout_json import layout_to_json
from recon.model import Model


def write_json(model: Model, stem: str) -> Output:
    """The layout in the schema of FORMAT.md, plus `name`, `notes` and `metadata`; one line an item."""
    data = layout_to_json(model.layout)
    data |= {"name": model.name, "notes": list(model.notes), "metadata": dict(sorted(model.metadata.items()))}
    lines = []
    for key, value in data.items():
        text = json.dumps(value, ensure_ascii=False, allow_nan=False)
        if isinstance(value, list) and value:
            items = [json.dumps(item, ensure_ascii=False, allow_nan=False) for item in value]
            text = "[\n  " + ",\n  ".join(items) + "\n ]"
        lines.append(f" {json.dumps(key)}: {text}")
    return Output(("{\n" + ",\n".join(lines) + "\n}\n").encode())
