"""`recon view`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, topic_choice, verbosity


@click.command(
    short_help="Look at a result on a time line.",
    epilog=examples(
        "recon view model.recon/ drive/                 in a window",
        "recon view model.recon/ drive/ -o run.rrd      as a file for Rerun's viewer",
    ),
)
@click.argument("result", type=PATH)
@click.argument("sequence", type=PATH, required=False)
@click.option("-o", "--output", type=PATH, help="File to write, *.rrd, instead of opening a window.")
@topic_choice
@verbosity
def view(
    result: Path,
    sequence: Path | None,
    output: Path | None,
    topics: dict[str, str],
    quiet: bool,
) -> None:
    """Shows walls, model and trajectory of a RESULT folder, and scans and images of the SEQUENCE it was built from.

    Needs rerun-sdk: pip install 'recon[view]'.
    """
    from recon.errors import OutputError
    from recon.recording import save_recording, show_recording
    from recon.sequence.open import open_sequence
    from recon.sequence.topics import Topics

    if output is not None and output.suffix.lower() != ".rrd":
        raise OutputError(f"{output}: unknown suffix {output.suffix!r}, expected .rrd")
    drive = None if sequence is None else open_sequence(sequence, Topics(**topics))
    if output is None:
        show_recording(result, drive)
    else:
        save_recording(result, drive, output)
        if not quiet:
            click.echo(f"Open:      {output} (rerun {output})")
