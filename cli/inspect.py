"""`recon inspect`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity, warn


@click.command(
    short_help="Say what a sequence holds.",
    epilog=examples("recon inspect drive/", "recon inspect drive/ -o drive.png"),
)
@click.argument("sequence", type=PATH)
@click.option("-o", "--output", type=PATH, help="PNG picture of the scans and the first images.")
@verbosity
def inspect(sequence: Path, output: Path | None, quiet: bool) -> None:
    """Says what a SEQUENCE folder holds: counts, rates, gaps, fields of view, and what looks wrong."""
    from recon.cli.outputs import check_writable
    from recon.errors import OutputError
    from recon.sequence.folder import read_sequence
    from recon.sequence.inspection import describe
    from recon.sequence.picture import write_picture

    if output is not None:
        if output.suffix.lower() != ".png":
            raise OutputError(f"{output}: unknown suffix {output.suffix!r}, expected .png")
        check_writable(output)
    drive = read_sequence(sequence)
    for line in describe(drive):
        click.echo(line)
    if (sequence / "groundtruth").is_dir():
        click.echo("Truth:      groundtruth/ is there, for recon eval")
    if output is not None:
        write_picture(drive, output)
    for message in drive.warnings:
        warn(message, quiet)
