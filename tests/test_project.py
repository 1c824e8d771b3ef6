"""The project itself: packages, links, documents, and a command line that starts quickly."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())

HEAVY = ("cv2", "gtsam", "matplotlib", "numba", "numpy", "open3d", "PIL", "pxr", "rich", "scipy", "shapely", "trimesh")


def test_package_list_is_the_tree() -> None:
    found = {"recon", "recon.cli", "recon.exporters"}
    for top, name in (("recon", "recon"), ("cli", "recon.cli"), ("exporters", "recon.exporters")):
        for init in (ROOT / top).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT / top).parts
            if top == "recon" and parts[:1] in (("cli",), ("exporters",)):
                continue
            found.add(".".join((name, *parts)))
    assert sorted(PYPROJECT["tool"]["setuptools"]["packages"]) == sorted(found)


@pytest.mark.parametrize("name", ["cli", "exporters"])
def test_links_for_type_checkers_are_relative(name: str) -> None:
    link = ROOT / "recon" / name
    assert link.is_symlink()
    assert link.readlink() == Path("..") / name


@pytest.mark.parametrize("arguments", [["--help"], ["build", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    code = f"""
import sys
sys.argv = ["recon", *{arguments!r}]
from recon.cli.main import main
try:
    main()
finally:
    print("heavy:", sorted(set({HEAVY!r}) & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "heavy: []"
    assert len(done.stdout.splitlines()) > 1


def test_every_command_has_help_with_examples() -> None:
    from click.testing import CliRunner

    from recon.cli.main import recon

    assert sorted(recon.commands) == [
        "bench",
        "build",
        "check",
        "convert",
        "eval",
        "export",
        "floorplan",
        "inspect",
        "report",
        "simulate",
        "view",
    ]
    for name in recon.commands:
        result = CliRunner().invoke(recon, [name, "--help"])
        assert result.exit_code == 0
        assert f"  recon {name} " in result.output.split("Examples:")[1]


def test_licence_is_apache() -> None:
    text = (ROOT / "LICENSE").read_text()
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text
    assert PYPROJECT["project"]["license"] == "Apache-2.0"


def test_make_targets() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in ("demo", "test", "lint", "bench"):
        assert re.search(rf"^{target}: \$\(READY\)$", makefile, re.MULTILINE)


def test_readme_names_every_output_suffix() -> None:
    from recon.exporters import SUFFIXES

    text = (ROOT / "README.md").read_text()
    for suffix in SUFFIXES:
        assert f"`{suffix}`" in text


def test_sample_is_small() -> None:
    size = sum(path.stat().st_size for path in (ROOT / "samples").rglob("*") if path.is_file())
    assert 1e6 < size < 8e6
