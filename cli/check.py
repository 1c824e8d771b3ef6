"""`recon check`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    short_help="Open exported files with the programs that are installed.",
    epilog=examples("recon check model.glb model.usdz", "recon check plan.dxf"),
)
@click.argument("files", type=PATH, nargs=-1, required=True)
@verbosity
def check(files: tuple[Path, ...], quiet: bool) -> None:
    """Opens FILES with what is installed of the programs that people would: validators, Blender, Godot, libraries.

    One line each: ok, broken, or not run and why. All files are looked at; exit status 2 when any is missing or broken.
    """
    from recon.clients import check_file
    from recon.errors import InputError

    broken: list[str] = []
    for path in files:
        for finding in check_file(path):
            if not quiet:
                click.echo(f"{path.name}: {finding.client}: {finding.state}: {finding.text}")
            if finding.state == "broken":
                broken.append(f"{path} ({finding.client}: {finding.text})")
    if broken:
        raise InputError(f"{len(broken)} of the checks failed: {broken[0]}")
