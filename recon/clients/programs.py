"""Programs beside Python: Khronos' validator, Assimp, Blender and Godot, each where it is installed."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from recon.clients.finding import Broken, Missing

PATIENCE = 300.0
"""s for one program, at most."""
SETTLED = 3.0
"""s after Godot has written what it made of a file; it may not end by itself."""

HEADER = 4096
"""Bytes of a PLY file that hold its header."""

_VALIDATE = """
const fs = require("fs"), path = require("path"), file = process.argv[1];
const read = (uri) => new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri))));
require("gltf-validator").validateBytes(read(path.basename(file)), {
  uri: path.basename(file), maxIssues: 0, externalResourceFunction: async (uri) => read(uri),
}).then((report) => console.log(JSON.stringify(report)));
"""
_BLENDER = Path(__file__).with_name("blender_script.py")
_GODOT = """extends SceneTree
func _init():
	var counts = {"meshes": 0, "shapes": 0}
	var scene = load("res://model" + OS.get_environment("RECON_SUFFIX"))
	if scene != null:
		count(scene.instance(), counts)
		print("RECON " + to_json(counts))
	quit()
func count(node, counts):
	counts["meshes"] += int(node is MeshInstance)
	counts["shapes"] += int(node is CollisionShape)
	for child in node.get_children():
		count(child, counts)
"""


def khronos(path: Path) -> str:
    """Khronos' gltf-validator, as a program or as a package of Node.js."""
    program = shutil.which("gltf_validator")
    if program is not None:
        output = _run([program, "-o", "-m", str(path)]).stdout
    else:
        output = _run_node(path)
    try:
        report: dict[str, Any] = json.loads(output)
    except json.JSONDecodeError:
        raise Broken(f"is no glTF: {output[:200]}") from None
    issues, info = report["issues"], report.get("info", {})
    if issues["numErrors"]:
        first = next((m for m in issues.get("messages", ()) if m["severity"] == 0), {"message": "see its report"})
        raise Broken(f"{issues['numErrors']} errors, the first {first['message']}")
    counts = f"{info.get('totalTriangleCount', 0)} triangles, {info.get('materialCount', 0)} materials"
    return f"no error, {issues['numWarnings']} warnings, {counts}"


def assimp(path: Path) -> str:
    """`assimp info`."""
    program = _program("assimp", hint="assimp-utils of Debian and Ubuntu")
    if path.suffix.lower() == ".ply" and b"element face" not in path.read_bytes()[:HEADER]:
        raise Missing("it reads meshes, and this file has points only")
    done = _run([program, "info", str(path)])
    facts = dict(line.split(":", 1) for line in reversed(done.stdout.splitlines()) if line.count(":") == 1)
    if done.returncode != 0 or "Meshes" not in facts:
        said = [line for line in done.stdout.splitlines() if line.startswith(("ERROR", "assimp"))]
        raise Broken(said[0] if said else f"ended with status {done.returncode}")
    return f"{facts['Meshes'].strip()} meshes, {facts.get('Materials', '?').strip()} materials"


def blender(path: Path) -> str:
    """Blender's importers, through its Python module."""
    done = _run([blender_python(), str(_BLENDER), str(path)])
    line = next((x for x in done.stdout.splitlines() if x.startswith("RECON ")), None)
    if line is None:
        raise Broken(f"cannot import it: {(done.stderr or done.stdout).strip()[-200:]}")
    found = json.loads(line.removeprefix("RECON "))
    if not found["meshes"]:
        return "nothing in it"
    size = " x ".join(f"{b - a:.2f}" for a, b in zip(found["low"], found["high"], strict=True))
    return f"{found['meshes']} meshes, {found['materials']} materials, {found['images']} images, {size} m"


def blender_python() -> str:
    """The interpreter that has Blender as its module bpy; Missing where there is none."""
    if importlib.util.find_spec("bpy") is not None:
        return sys.executable
    named = os.environ.get("RECON_BPY_PYTHON")
    if named is None or not Path(named).is_file():
        raise Missing("no Blender: pip install bpy into an environment and name its Python in RECON_BPY_PYTHON")
    return named


def godot(path: Path) -> str:
    """Godot 3's import of glTF, in a project of its own."""
    program = _program("godot3-server", "godot3", hint="godot3-server of Debian and Ubuntu")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "project.godot").write_text('config_version=4\n[application]\nconfig/name="check"\n')
        (folder / "check.gd").write_text(_GODOT)
        shutil.copy(path, folder / f"model{path.suffix}")
        for beside in (path.with_suffix(".bin"), path.with_suffix(".textures")) if path.suffix == ".gltf" else ():
            if beside.exists():
                (shutil.copytree if beside.is_dir() else shutil.copy)(beside, folder / beside.name)
        _import_into(program, folder)
        done = _run([program, "--path", name, "-s", "check.gd"], RECON_SUFFIX=path.suffix)
    line = next((x for x in done.stdout.splitlines() if x.startswith("RECON ")), None)
    if line is None:
        raise Broken("cannot import it")
    counts = json.loads(line.removeprefix("RECON "))
    return f"{counts['meshes']:.0f} meshes, {counts['shapes']:.0f} collision shapes"


def _import_into(program: str, folder: Path) -> None:
    """Runs the editor until it ends, or has written the imported scene and then nothing more."""
    command = [program, "--editor", "--quit", "--path", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    start, newest, since = time.monotonic(), 0.0, time.monotonic()
    try:
        while process.poll() is None and time.monotonic() - start < PATIENCE:
            time.sleep(0.2)
            written = max((p.stat().st_mtime for p in folder.glob("model.*.import")), default=0.0)
            if written != newest:
                newest, since = written, time.monotonic()
            if newest and time.monotonic() - since > SETTLED:
                break
    finally:
        process.kill()
        process.wait()


def _run_node(path: Path) -> str:
    node = _program("node", hint="npm install gltf-validator")
    places = [os.environ.get("NODE_PATH", ""), str(Path.cwd() / "node_modules")]
    npm = shutil.which("npm")
    if npm is not None:
        places.append(_run([npm, "root", "-g"]).stdout.strip())
    done = _run([node, "-e", _VALIDATE, str(path)], NODE_PATH=os.pathsep.join(filter(None, places)))
    if "Cannot find module 'gltf-validator'" in done.stderr:
        raise Missing("its gltf-validator is not installed: npm install gltf-validator, here or globally")
    return done.stdout or done.stderr


def _program(*names: str, hint: str) -> str:
    for name in names:
        found = shutil.which(name)
        if found is not None:
            return found
    raise Missing(f"{names[0]} is not installed ({hint})")


def _run(command: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE, env={**os.environ, **environment}, check=False
        )
    except subprocess.TimeoutExpired:
        raise Broken(f"{Path(command[0]).name} did not end within {PATIENCE:.0f} s") from None
