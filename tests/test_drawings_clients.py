"""DXF plans in CAD programs: LibreCAD and FreeCAD read them with readers of their own, where they are installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pypdfium2
import pytest
from test_drawings import check_walls, random_model

from recon.exporters import export
from recon.exporters.options import ExportOptions
from recon.geometry import Array, rotation2
from recon.model import Model
from recon.plan.draw import draw_plan
from recon.plan.options import DrawingOptions

VARIANTS = (("cad", "m"), ("cad", "mm"), ("cad", "ft"), ("plain", "m"))
IN_FREECAD = """
import json, os
try:
    import FreeCAD, importDXF
    found = {}
    for name in os.environ["PLANS"].split(":"):
        document = FreeCAD.newDocument("plan")
        importDXF.insert(name, document.Name)
        shapes = [o.Shape for o in document.Objects if hasattr(o, "Shape") and not o.Shape.isNull()]
        found[name] = [[[v.X, v.Y] for v in edge.Vertexes] for shape in shapes for edge in shape.Edges]
    json.dump(found, open(os.environ["FOUND"], "w"))
finally:
    os._exit(0)
"""


def run_on_a_screen(arguments: list[str], folder: Path, **environment: str) -> None:
    """Run a program of the system with a window that nobody sees."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    kept |= {"HOME": str(folder), "QTWEBENGINE_DISABLE_SANDBOX": "1"} | environment
    subprocess.run(["xvfb-run", "-a", *arguments], cwd=folder, env=kept, check=True, capture_output=True, timeout=240)


def needs(program: str) -> pytest.MarkDecorator:
    missing = [name for name in (program, "xvfb-run") if shutil.which(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"{' and '.join(missing)} not installed")


@pytest.fixture(scope="module")
def plan() -> Model:
    return random_model(11, 5)


@pytest.fixture(scope="module")
def files(plan: Model, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("dxf")
    out = []
    for profile, units in VARIANTS:
        out.append(folder / f"{profile}_{units}.dxf")
        export(plan, out[-1], ExportOptions(drawing=DrawingOptions(dxf_profile=profile, units=units)))  # type: ignore[arg-type]
    return out


@needs("freecad")
def test_freecad_finds_the_walls(plan: Model, files: list[Path], tmp_path: Path) -> None:
    (tmp_path / "plans.py").write_text(IN_FREECAD)
    where = {"PLANS": ":".join(map(str, files)), "FOUND": str(tmp_path / "found.json")}
    run_on_a_screen(["freecad", "plans.py"], tmp_path, **where)
    found = json.loads((tmp_path / "found.json").read_text())
    to_map = rotation2(draw_plan(plan).angle)
    for path in files:
        edges: list[Array] = [np.array(e) / 1000 for e in found[str(path)] if len(e) == 2]  # it counts in millimetres
        check_walls([edge @ to_map.T for edge in edges], plan.layout)
    assert len(found[str(files[0])]) == len(found[str(files[1])])


@needs("librecad")
def test_librecad_prints_a_plan_in_any_units(files: list[Path], tmp_path: Path) -> None:
    pictures = []
    for path in files[:3]:
        run_on_a_screen(["librecad", "dxf2pdf", "-a", "-o", str(tmp_path / "out.pdf"), str(path)], tmp_path)
        made = next(p for p in (path.with_suffix(".pdf"), tmp_path / "out.pdf") if p.exists())
        page = pypdfium2.PdfDocument(made)[0]
        assert max(page.get_size()) < 4000  # points: a sheet of paper, and no field
        pictures.append(np.asarray(page.render(scale=600 / max(page.get_size())).to_pil().convert("L")))
    for picture in pictures:
        rows, columns = np.nonzero(picture < 200)
        drawn = np.array([np.ptp(rows), np.ptp(columns)]) / picture.shape
        assert drawn.max() > 0.75  # the plan fills the sheet, so nothing lies far away from it
        assert 0.005 < np.mean(picture < 200) < 0.4
