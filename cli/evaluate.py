"""`recon eval`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    "eval",
    short_help="Compare a result with ground truth.",
    epilog=examples("recon eval drive/ model.recon/", "recon eval drive/ model.recon/ --json scores.json"),
)
@click.argument("sequence", type=PATH)
@click.argument("result", type=PATH)
@click.option("--json", "json_file", type=PATH, help="Write the numbers here too; - prints them instead of the table.")
@verbosity
def evaluate(sequence: Path, result: Path, json_file: Path | None, quiet: bool) -> None:
    """Compares the RESULT folder of a build with the ground truth of its SEQUENCE folder."""
    from recon.cli.outputs import check_writable
    from recon.evaluate import evaluate as compare
    from recon.files import atomic_path

    to_stdout = json_file == Path("-")
    if json_file is not None and not to_stdout:
        check_writable(json_file)
    evaluation = compare(sequence, result)
    text = json.dumps(evaluation.to_json(), indent=1)
    if to_stdout:
        click.echo(text)
        return
    if json_file is not None:
        with atomic_path(json_file) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    if not quiet:
        click.echo(evaluation.table())
