"""`recon simulate`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    short_help="Make a sequence from a plan.",
    epilog=examples("recon simulate plan.json -o drive/", "recon simulate plan.json -o drive/ --seed 3"),
)
@click.argument("plan", type=PATH)
@click.option(
    "-o", "--output", type=PATH, required=True, help="Sequence folder to make; new, empty, or an earlier simulation."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of noise and textures.")
@verbosity
def simulate(plan: Path, output: Path, seed: int, quiet: bool) -> None:
    """Makes a sequence folder with ground truth from a PLAN of rooms, doors and objects (JSON)."""
    from recon.cli.outputs import check_writable
    from recon.cli.progress import terminal_progress
    from recon.simulate import simulate_file

    check_writable(output)
    simulate_file(plan, output, seed, terminal_progress(quiet))
    if not quiet:
        click.echo(f"{output}: try recon inspect {output} -o {output.name}.png")
