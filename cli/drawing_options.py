"""Options of plans, for every command that draws them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from recon.cli.options import gathered

PAPERS = ("A4", "A3", "A2", "A1", "A0", "letter", "tabloid", "ansi-c", "ansi-d", "ansi-e")


def read_scale(_context: click.Context, _option: click.Parameter, value: str | None) -> int | None:
    """The n of `n` or `1:n`; BadParameter for anything else."""
    if value is None:
        return None
    number = value.removeprefix("1:")
    if not number.isascii() or not number.isdigit() or not 1 <= int(number) <= 100_000:
        raise click.BadParameter(f"{value!r} is no scale, expected one like 50 or 1:50.")
    return int(number)


def check_drawings(drawings: Iterable[str], outputs: Iterable[Path]) -> None:
    """Raise UsageError where an option is of plans and no output is one, or of DXF and no output is that."""
    from recon.exporters import DRAWINGS

    suffixes = {path.suffix.lower() for path in outputs}
    for name in drawings:
        option = "--" + ("no-sigmas" if name == "sigmas" else name.replace("_", "-"))
        fitting = {".dxf"} if name == "dxf_profile" else {".dxf", ".svg"} if name == "layers" else DRAWINGS
        if not suffixes & fitting:
            raise click.UsageError(f"{option} is for {' '.join(sorted(fitting))}, and no output is one.")


OPTIONS: dict[str, Any] = {
    "scale": click.option(
        "--scale", metavar="1:N", callback=read_scale, help="Of plans: 50, 100, 200 ... (default: what fits)."
    ),
    "paper": click.option(
        "--paper", type=click.Choice(PAPERS, case_sensitive=False), help="Of plans (default: what fits)."
    ),
    "units": click.option(
        "--units", type=click.Choice(["m", "mm", "ft"]), help="Of plans: metres (default), mm, feet and inches."
    ),
    "layers": click.option(
        "--layers", type=click.Choice(["aia", "iso"]), help="Names of layers: AIA/NCS (default), ISO 13567."
    ),
    "dxf_profile": click.option(
        "--dxf-profile",
        type=click.Choice(["cad", "plain"]),
        help="DXF R2018 with everything (default), or R2000 with polylines and texts only.",
    ),
    "sigmas": click.option(
        "--no-sigmas", "sigmas", flag_value=False, default=None, help="Dimensions without ± on plans."
    ),
    "north": click.option(
        "--north", type=float, help="Of plans: degrees from the map's x axis to north, counter-clockwise."
    ),
}
"""By field of `DrawingOptions`."""

drawing_options = gathered("drawings", OPTIONS)
"""Gives the command those that were used as `drawings`."""
