"""Parts of finished pictures hidden, filled and compared: `python benchmarks/fill.py model.recon [...]`."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from recon.results import load_model
from recon.texture.canvas import BLOCK
from recon.texture.render import fill_unseen

HOLES = {
    "side": (slice(0.0, 1.0), slice(0.0, 0.35)),
    "top": (slice(0.0, 0.35), slice(0.0, 1.0)),
    "middle": (slice(0.3, 0.7), slice(0.4, 0.65)),
}
"""Rows and columns, shares of the picture."""
LEAST_SIDE, LEAST_HIDDEN, LEAST_LEFT = 160, 5000, 20_000
"""Texels: smaller pictures, holes and rests are left out."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="+", type=Path)
    found: dict[tuple[str, str], list[float]] = {}
    for folder in parser.parse_args().results:
        for face in load_model(folder).faces:
            if face.texture is None or face.sources is None or face.kind not in ("wall", "floor", "ceiling"):
                continue
            height, width = (n // BLOCK * BLOCK for n in face.texture.shape[:2])
            if min(height, width) < LEAST_SIDE:
                continue
            picture, seen = face.texture[:height, :width], face.sources[:height, :width] >= 0
            for name, (rows, columns) in HOLES.items():
                hole = np.zeros((height, width), bool)
                hole[_part(rows, height), _part(columns, width)] = True
                if (hole & seen).sum() < LEAST_HIDDEN or (seen & ~hole).sum() < LEAST_LEFT:
                    continue
                filled = np.where((seen & ~hole)[..., None], picture, 0).astype(np.uint8)
                alpha = np.where(seen & ~hole, 255, 0).astype(np.uint8)
                fill_unseen(filled, alpha, np.ones_like(hole), face.kind == "wall")
                away = filled[hole & seen].astype(float) - picture[hole & seen]
                found.setdefault((face.kind, name), []).append(10 * np.log10(255**2 / float(np.mean(away**2))))
    for (kind, name), values in sorted(found.items()):
        print(f"{kind}, {name}: {np.mean(values):.1f} dB over {len(values)}")


def _part(share: slice, size: int) -> slice:
    return slice(int(share.start * size), int(share.stop * size))


if __name__ == "__main__":
    main()
