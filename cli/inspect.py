"""`recon inspect`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, topic_choice, verbosity, warn


@click.command(
    short_help="Say what a sequence holds.",
    epilog=examples("recon inspect drive/", "recon inspect drive/ -o drive.png", "recon inspect drive.bag"),
)
@click.argument("sequence", type=PATH)
@click.option("-o", "--output", type=PATH, help="PNG picture of the scans and the first images.")
@topic_choice
@verbosity
def inspect(
    sequence: Path,
    output: Path | None,
    topics: dict[str, str],
    quiet: bool,
) -> None:
    """Says what a SEQUENCE holds: counts, rates, gaps, fields of view, and what looks wrong.

    A SEQUENCE is a folder, a ROS bag or a CARMEN log.
    """
    from recon.cli.outputs import check_writable
    from recon.errors import OutputError
    from recon.sequence.inspection import describe
    from recon.sequence.open import open_sequence
    from recon.sequence.picture import write_picture
    from recon.sequence.topics import Topics

    if output is not None:
        if output.suffix.lower() != ".png":
            raise OutputError(f"{output}: unknown suffix {output.suffix!r}, expected .png")
        check_writable(output)
    drive = open_sequence(sequence, Topics(**topics))
    for line in describe(drive):
        click.echo(line)
    if (sequence / "groundtruth").is_dir():
        click.echo("Truth:      groundtruth/ is there, for recon eval")
    if output is not None:
        write_picture(drive, output)
    for message in drive.warnings:
        warn(message, quiet)
