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
@click.option("-o", "--output", type=PATH, required=True, help="Sequence folder to make; must not exist or be empty.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of noise and textures.")
@verbosity
def simulate(plan: Path, output: Path, seed: int, quiet: bool) -> None:
    """Makes a sequence folder with ground truth from a PLAN of rooms, doors and objects (JSON)."""
    from recon.cli.outputs import check_writable
    from recon.simulate import simulate as run

    check_writable(output)
    run(plan, output, seed=seed)
    if not quiet:
        click.echo(f"{output}: try recon inspect {output} -o {output.name}.png")
