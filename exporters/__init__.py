"""Writers of a finished `Model`, chosen by the suffix of the output file.

Every writer is a pure function `write(model, stem) -> Output`: it computes bytes and touches no file. The same model
gives the same bytes. `export` puts them on disk, all or nothing. Writers in `WITH_OPTIONS` take `ExportOptions` as a
third argument. Those in `BUILDING_WRITERS` are `write(building, stem, options) -> Output`, for several storeys at once.

Lengths are metres in every format and frames are right-handed with the floor at height 0. `.glb`, `.gltf` and `.obj`
have Y up (glTF's rule and OBJ's habit): x, z, -y of the map frame. All others have Z up and are in map coordinates.
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from recon.errors import OutputError
from recon.exporters.options import DEFAULTS, PICTURE_FORMATS, ExportOptions, check_options
from recon.exporters.output import Output
from recon.files import atomic_path

if TYPE_CHECKING:
    from recon.model import Model
    from recon.storeys import Building

Writer = Callable[..., Output]

# "module:function", imported when used: the command line asks for SUFFIXES long before it needs a writer.
WRITERS: dict[str, str] = {
    ".usd": "usd:write_usdc",
    ".usda": "usd:write_usda",
    ".usdc": "usd:write_usdc",
    ".usdz": "usd:write_usdz",
    ".glb": "gltf:write_glb",
    ".gltf": "gltf:write_gltf",
    ".obj": "obj:write_obj",
    ".ply": "ply:write_ply",
    ".cloud.ply": "cloud:write_cloud",
    ".stl": "stl:write_stl",
    ".sdf": "robot:write_sdf",
    ".urdf": "robot:write_urdf",
    ".dxf": "dxf:write_dxf",
    ".svg": "svg:write_svg",
    ".pdf": "pdf:write_pdf",
    ".png": "png:write_png",
    ".ifc": "ifc:write_ifc",
    ".geojson": "geojson:write_geojson",
    ".yaml": "nav_map:write_map",
    ".tum": "trajectory_file:write_tum_file",
    ".csv": "trajectory_file:write_csv",
    ".rooms.json": "room_graph:write_room_graph",
    ".json": "layout_file:write_json",
}
"""Suffix (lower case) to writer. To add a format: one module with one `write` function, one line here."""

MESHES: frozenset[str] = frozenset(
    {".usd", ".usda", ".usdc", ".usdz", ".glb", ".gltf", ".obj", ".ply", ".stl", ".sdf", ".urdf"}
)
"""Suffixes of formats that hold the faces; they come in several levels of detail (`ExportOptions.lod`)."""

DRAWINGS: frozenset[str] = frozenset({".dxf", ".svg", ".pdf", ".png"})
"""Suffixes of plans (`ExportOptions.drawing`)."""

WITH_OPTIONS: frozenset[str] = frozenset({*MESHES, *DRAWINGS, ".ifc", ".geojson", ".yaml"})
"""Suffixes whose writers take `ExportOptions` as a third argument."""

BUILDING_WRITERS: dict[str, str] = {
    ".usd": "usd:write_building_usdc",
    ".usda": "usd:write_building_usda",
    ".usdc": "usd:write_building_usdc",
    ".usdz": "usd:write_building_usdz",
    ".glb": "gltf:write_building_glb",
    ".gltf": "gltf:write_building_gltf",
    ".dxf": "dxf:write_building_dxf",
    ".ifc": "ifc:write_building_ifc",
    ".geojson": "geojson:write_building_geojson",
}
"""Suffixes of formats that hold several storeys, to their writers of a `Building`."""

SUFFIXES: tuple[str, ...] = tuple(WRITERS)
"""Known suffixes of output files, lower case, with the dot."""

TEXTURES_BESIDE: frozenset[str] = frozenset({".usd", ".usda", ".usdc", ".gltf", ".obj"})
"""Suffixes whose textures lie beside the file, in the folder `<stem>.textures`."""


def suffix_of(path: Path) -> str:
    """The suffix that chooses the format, lower case: of those known the longest (`.rooms.json` before `.json`).

    Files named just `cloud.ply` or `rooms.json` are what `.cloud.ply` and `.rooms.json` are.
    """
    name = path.name.lower()
    known = [suffix for suffix in WRITERS if name.endswith(suffix) and len(name) > len(suffix)]
    known += [suffix for suffix in WRITERS if suffix == f".{name}" and suffix.count(".") > 1]
    return max(known, key=len, default=path.suffix.lower())


def writer_for(path: Path) -> Writer:
    """The writer for the suffix of `path`; OutputError, listing the known suffixes, when there is none."""
    suffix = suffix_of(path)
    if suffix not in WRITERS:
        found = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise OutputError(f"{path}: unknown output format ({found}), expected one of {' '.join(SUFFIXES)}")
    return _load(WRITERS[suffix])


def building_writer_for(path: Path) -> Writer:
    """The writer of several storeys for the suffix of `path`; OutputError when its format holds one only."""
    suffix = suffix_of(path)
    if suffix not in BUILDING_WRITERS:
        writer_for(path)
        known = " ".join(BUILDING_WRITERS)
        raise OutputError(f"{path}: {suffix} holds one storey only, expected one of {known} for several results")
    return _load(BUILDING_WRITERS[suffix])


def _load(name: str) -> Writer:
    module, function = name.split(":")
    writer: Writer = getattr(importlib.import_module(f"recon.exporters.{module}"), function)
    return writer


def export(model: Model, path: Path, options: ExportOptions = DEFAULTS) -> tuple[str, ...]:
    """Write `model` to `path` in the format of its suffix, with the files that belong beside it.

    `.usd`, `.usda`, `.usdc`, `.gltf` and `.obj` put their textures into the folder `<stem>.textures`, `.obj` its
    materials into `<stem>.mtl`, `.gltf` its shapes into `<stem>.bin`; every other format is one file. All files are
    written beside their targets first and moved at the end, the named file last. Gives lines for people about what
    could not be done as asked. Raises OutputError when the suffix is unknown or a file cannot be written.
    """
    suffix, writer = suffix_of(path), writer_for(path)
    stem = path.name[: -len(suffix)]
    if suffix not in MESHES:
        output = writer(model, stem, options) if suffix in WITH_OPTIONS else writer(model, stem)
        _put(output, path)
        return tuple(f"{path.name}: {note}" for note in output.notes)
    from recon.exporters.detail import with_detail
    from recon.exporters.enclosure import enclosed, too_many_triangles

    check_options([path], options)
    model = model if suffix == ".stl" else enclosed(model, options)
    notes: tuple[str, ...] = ()
    for level in range(options.lod, -1, -1):
        name = f"{stem}.lod{level}" if level else stem
        detailed, said = with_detail(model, options, level, suffix in PICTURE_FORMATS)
        output = writer(detailed, name, options)
        _put(output, path.with_name(name + path.name[len(stem) :]))
        notes = (*said, *too_many_triangles(model, suffix, options), *output.notes)
    return tuple(f"{path.name}: {note}" for note in notes)


def export_building(building: Building, path: Path, options: ExportOptions = DEFAULTS) -> None:
    """Write all storeys of `building` to `path`; as `export`, and OutputError when the format holds one storey only."""
    writer, suffix = building_writer_for(path), suffix_of(path)
    if suffix in MESHES:
        from recon.exporters.detail import with_detail
        from recon.exporters.enclosure import enclosed

        check_options([path], options)
        storeys = tuple(replace(s, model=with_detail(enclosed(s.model, options), options)[0]) for s in building.storeys)
        building = replace(building, storeys=storeys)
    _put(writer(building, path.name[: -len(suffix)], options), path)


def _put(output: Output, path: Path) -> None:
    """The file and those beside it, all or nothing."""
    made: list[Path] = []
    try:
        with ExitStack() as stack:  # left in reverse order: `path` itself is moved into place last
            for name, content in [(path.name, output.content), *output.beside.items()]:
                target = path.parent / name
                made += [folder for folder in (target.parent, *target.parent.parents) if not folder.exists()]
                target.parent.mkdir(exist_ok=True, parents=True)
                stack.enter_context(atomic_path(target)).write_bytes(content)
    except BaseException as error:
        for folder in sorted(made, reverse=True):  # a folder after those in it
            with suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError):
            raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
        raise


def check_outputs(paths: Sequence[Path], options: ExportOptions = DEFAULTS) -> None:
    """Raise OutputError, before any work is done, when one of `paths` could not be exported to.

    Refused: an unknown suffix, a folder, a parent folder that is missing or not writable, the same file twice, and
    files in the way of the texture folder.
    """
    seen: set[Path] = set()
    check_options(paths, options)
    for path in paths:
        if suffix_of(path) not in WRITERS:
            writer_for(path)
        if path.is_dir():
            raise OutputError(f"{path}: is a folder, expected the name of a file to write")
        _check_folder(path)
        textures = path.parent / f"{path.stem}.textures"
        if path.suffix.lower() in TEXTURES_BESIDE and textures.exists() and not textures.is_dir():
            raise OutputError(f"{textures}: is a file, expected a folder for the textures of {path.name}")
        resolved = path.resolve()
        if resolved in seen:
            raise OutputError(f"{path}: is named twice as an output, expected each file once")
        seen.add(resolved)


def _check_folder(path: Path) -> None:
    parent = path.parent
    if not parent.is_dir():
        raise OutputError(f"{path}: the folder {parent} does not exist, expected an existing folder")
    try:  # a try tells more than permission bits: read-only mounts, full disks, the super-user
        with tempfile.TemporaryFile(dir=parent):
            pass
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"{path}: the folder {parent} is not writable ({reason})") from None
