"""Size and CPU seconds of every 3D file of a result: `python benchmarks/formats.py model.recon`."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from recon.exporters import export
from recon.exporters.options import ExportOptions
from recon.results import load_model

FILES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("model.glb", {}),
    ("model.glb", {"texture_format": "webp"}),
    ("model.glb", {"texture_format": "png"}),
    ("model.glb", {"texture_size": 1024}),
    ("model.glb", {"engine": "godot"}),
    ("model.glb", {"engine": "unreal"}),
    ("model.gltf", {}),
    ("model.usd", {}),
    ("model.usdz", {"usd_profile": "arkit"}),
    ("model.usdz", {"usd_profile": "simready"}),
    ("model.obj", {}),
    ("model.ply", {}),
    ("model.ply", {"max_triangles": 20_000}),
    ("model.stl", {}),
    ("model.sdf", {}),
    ("model.cloud.ply", {}),
)


def main() -> None:
    model = load_model(Path(sys.argv[1]))
    textured = sum(face.texture is not None for face in model.faces)
    triangles = sum(len(face.triangles) for face in model.faces)
    print(f"{len(model.faces)} faces, {textured} with a picture, {triangles} triangles")
    for name, options in FILES:
        with tempfile.TemporaryDirectory() as folder:
            start = time.process_time()
            export(model, Path(folder) / name, ExportOptions(**options))
            seconds = time.process_time() - start
            size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
        said = " ".join(f"{key}={value}" for key, value in options.items())
        print(f"{name:<16} {said:<24} {size / 1e6:8.2f} MB {seconds:6.2f} s CPU")


if __name__ == "__main__":
    main()
