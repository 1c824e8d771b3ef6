"""Closed solids of results and of ten random plans, read back by trimesh: benchmarks/bodies.py A.recon B.recon."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import numpy as np
import trimesh

from recon.exporters.options import ExportOptions
from recon.exporters.stl import write_stl
from recon.model import Layout, Model
from recon.results import load_model
from recon.simulate import random_plan
from recon.simulate.building import build_building
from recon.simulate.truth import true_layout

SEEDS = range(100, 110)


def row(name: str, layout: Layout) -> None:
    for ceiling in (True, False):
        start = time.process_time()
        content = write_stl(Model(name, layout, ()), name, ExportOptions(ceiling=ceiling)).content
        seconds = time.process_time() - start
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type="stl")
        sound = mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
        kind = "closed" if ceiling else "open above"
        print(f"{name} | {kind} | {len(mesh.faces)} | {mesh.volume:.1f} m3 | {sound} | {seconds:.2f} s")


if __name__ == "__main__":
    for path in sys.argv[1:]:
        row(Path(path).stem, load_model(Path(path)).layout)
    for seed in SEEDS:
        plan = random_plan(seed, rooms=4, angles="any" if seed % 2 else "manhattan")
        row(f"plan {seed}", true_layout(build_building(plan), np.zeros(3)))
