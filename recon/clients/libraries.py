"""Python libraries that read formats."""

from __future__ import annotations

import importlib.util
import logging
from pathlib import Path

from recon.clients.finding import Broken, Missing

LONGEST = 200
"""Characters of what a library says is wrong."""


def trimesh(path: Path) -> str:
    """Counts and size of a mesh file."""
    _need("trimesh")
    import trimesh as library

    try:
        scene = library.load_scene(path)
        shapes = list(scene.geometry.values())
        triangles = sum(len(getattr(shape, "faces", ())) for shape in shapes)
        points = sum(len(shape.vertices) for shape in shapes)
        bounds = scene.bounds
    except Exception as error:  # readers of damaged files fail in ways of their own
        raise Broken(f"cannot be read: {type(error).__name__}: {error}"[:LONGEST]) from None
    if bounds is None:
        return "nothing in it"
    size = " x ".join(f"{v:.2f}" for v in bounds[1] - bounds[0])
    kind = f"{triangles} triangles" if triangles else f"{points} points"
    return f"{len(shapes)} meshes, {kind}, {size}"


def openusd(path: Path) -> str:
    """All validators of OpenUSD, and whether every file that it names is there."""
    _need("pxr")
    from pxr import Tf, Usd, UsdUtils, UsdValidation

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise Broken(f"cannot be opened: {error}"[:LONGEST]) from None
    _, _, unresolved = UsdUtils.ComputeAllDependencies(str(path))
    if unresolved:
        raise Broken(f"{len(unresolved)} files that it names are missing, one is {unresolved[0]}")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    if errors:
        first = f"{errors[0].GetName()}: {errors[0].GetMessage()}"
        raise Broken(f"{len(errors)} complaints of validators, the first {first}"[:LONGEST])
    prims = sum(1 for _ in stage.Traverse())
    return f"{len(validators)} validators pass, {prims} prims"


def nvidia(path: Path) -> str:
    """NVIDIA's asset validator, all of its rules."""
    _need("omni.asset_validator" if importlib.util.find_spec("omni") else "omni", "omniverse-asset-validator")
    from omni.asset_validator import IssueSeverity, ValidationEngine

    log = logging.getLogger("omni")
    level, log.level = log.level, logging.ERROR
    try:
        issues = list(ValidationEngine().validate(str(path)).issues())
    finally:
        log.level = level
    bad = [issue for issue in issues if issue.severity in (IssueSeverity.ERROR, IssueSeverity.FAILURE)]
    if bad:
        raise Broken(f"{len(bad)} complaints, the first {bad[0].message}"[:LONGEST])
    return f"no error, {len(issues)} warnings"


def ezdxf(path: Path) -> str:
    """An audit of a DXF drawing."""
    _need("ezdxf")
    import ezdxf as library

    try:
        drawing = library.readfile(path)
    except (library.DXFError, OSError, ValueError) as error:
        raise Broken(f"cannot be read: {error}"[:LONGEST]) from None
    faults = drawing.audit().errors
    if faults:
        raise Broken(f"{len(faults)} faults, the first {faults[0].message}"[:LONGEST])
    return f"{len(drawing.modelspace())} entities on {len(drawing.layers)} layers, no fault"


def ifcopenshell(path: Path) -> str:
    """An IFC file against its schema."""
    _need("ifcopenshell")
    import ifcopenshell as library
    import ifcopenshell.validate as validation

    try:
        content = library.open(str(path))
    except Exception as error:  # it raises what its C++ core throws
        raise Broken(f"cannot be read: {error}"[:LONGEST]) from None
    logger = validation.json_logger()
    validation.validate(content, logger)
    if logger.statements:
        raise Broken(f"{len(logger.statements)} faults, the first {logger.statements[0]}"[:LONGEST])
    return f"{content.schema}, {len(content.by_type('IfcProduct'))} products, no fault"


def _need(name: str, distribution: str | None = None) -> None:
    if importlib.util.find_spec(name) is None:
        raise Missing(f"the Python library {distribution or name} is not installed")
