"""`recon report`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    short_help="Write the report of a result anew.",
    epilog=examples(
        "recon report model.recon/                      model.recon/report.html, with what was added since",
        "recon report model.recon/ -o report.html       elsewhere",
    ),
)
@click.argument("result", type=PATH)
@click.option("-o", "--output", type=PATH, help="File to write, *.html (default: RESULT/report.html).")
@verbosity
def report(result: Path, output: Path | None, quiet: bool) -> None:
    """Writes the page that shows a RESULT folder, with links to the files that are there now.

    After `recon eval --views` it shows the images that were left out, beside the model.
    """
    from recon.cli.outputs import check_writable
    from recon.errors import OutputError
    from recon.report import write_report

    path = result / "report.html" if output is None else output
    if path.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{path}: unknown suffix {path.suffix!r}, expected .html")
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, expected the name of a file to write")
    if result.is_dir():
        check_writable(path)
    write_report(result, path)
    if not quiet:
        click.echo(path)
