"""USD: .usd and .usdc (binary), .usda (text), .usdz (one package with its textures); metres, Z up or Y up."""

from __future__ import annotations

import io
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.parts import part_pictures, parts_of
from recon.exporters.usd_stage import build_stage
from recon.model import Model
from recon.storeys import Building, one_storey

if TYPE_CHECKING:
    from pxr import Usd

USDZ_ALIGNMENT = 64
_LOCAL_HEADER, _EXTRA_HEADER = 30, 4  # bytes, of a zip archive's entry and of its extra field
_PADDING_FIELD = 0x1986  # id of the extra field that OpenUSD's own packages are padded with


def write_usdc(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Binary USD, textures beside it in `<stem>.textures`."""
    return write_building_usdc(one_storey(model), stem, options)


def write_usda(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Text USD, textures beside it in `<stem>.textures`."""
    return write_building_usda(one_storey(model), stem, options)


def write_usdz(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """A package of a binary layer and its textures: stored, every file at a multiple of 64 bytes."""
    return write_building_usdz(one_storey(model), stem, options)


def write_building_usdc(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Binary USD of all storeys, textures beside it in `<stem>.textures`, by storey where there are several."""
    parts = parts_of(building, f"{stem}.textures")
    return Output(_crate(build_stage(building.name, parts, options)), part_pictures(parts, options))


def write_building_usda(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Text USD of all storeys, textures as `write_building_usdc`."""
    parts = parts_of(building, f"{stem}.textures")
    stage = build_stage(building.name, parts, options)  # held here: its layer dies with it
    return Output(stage.GetRootLayer().ExportToString().encode(), part_pictures(parts, options))


def write_building_usdz(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All storeys in one package, as `write_usdz`."""
    parts = parts_of(building, "textures")
    files = {"model.usdc": _crate(build_stage(building.name, parts, options))}
    return Output(_package(files | part_pictures(parts, options)))


def _crate(stage: Usd.Stage) -> bytes:
    with tempfile.TemporaryDirectory() as folder:  # the binary format can only be written to a file
        path = Path(folder) / "model.usdc"
        if not stage.GetRootLayer().Export(str(path)):
            raise OSError(None, "OpenUSD cannot write a temporary layer", str(path))
        return path.read_bytes()


def _package(files: dict[str, bytes]) -> bytes:
    """A zip archive as the USDZ specification wants it: nothing compressed, data aligned, the layer first."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            data_start = buffer.tell() + _LOCAL_HEADER + len(name.encode()) + _EXTRA_HEADER
            padding = -data_start % USDZ_ALIGNMENT
            info.extra = _PADDING_FIELD.to_bytes(2, "little") + padding.to_bytes(2, "little") + bytes(padding)
            archive.writestr(info, content)
    return buffer.getvalue()
