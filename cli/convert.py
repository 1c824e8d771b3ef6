"""`recon convert`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, topic_choice, verbosity, warn


@click.command(
    short_help="Write a log as a sequence folder.",
    epilog=examples(
        "recon convert drive.bag -o drive/",
        "recon convert drive.mcap -o drive/ --scan-topic /front/scan --image-topic none",
        "recon convert aces.log.gz -o aces/",
    ),
)
@click.argument("sequence", type=PATH)
@click.option("-o", "--output", type=PATH, required=True, help="Sequence folder to make; new or empty.")
@topic_choice
@verbosity
def convert(
    sequence: Path,
    output: Path,
    topics: dict[str, str],
    quiet: bool,
) -> None:
    """Writes a SEQUENCE (ROS bag, CARMEN log or folder) as a sequence folder."""
    from recon.cli.outputs import check_writable
    from recon.cli.progress import terminal_progress
    from recon.sequence.open import open_sequence
    from recon.sequence.topics import Topics
    from recon.sequence.write import write_sequence

    check_writable(output)
    drive = open_sequence(sequence, Topics(**topics))
    for message in drive.warnings:
        warn(message, quiet)
    write_sequence(drive, output, terminal_progress(quiet))
    if not quiet:
        click.echo(f"{output}: try recon inspect {output} -o {output.name}.png")
