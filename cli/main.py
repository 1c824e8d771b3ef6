"""The command `recon`: parses, and turns errors into one line and an exit status."""

from __future__ import annotations

import errno
import os
import signal
import sys
from types import FrameType

import click

from recon import __version__
from recon.cli.bench import bench
from recon.cli.build import build
from recon.cli.check import check
from recon.cli.convert import convert
from recon.cli.evaluate import evaluate
from recon.cli.export import export
from recon.cli.floorplan import floorplan
from recon.cli.inspect import inspect
from recon.cli.options import examples
from recon.cli.report import report
from recon.cli.simulate import simulate
from recon.cli.view import view
from recon.errors import ReconError

BAD_INPUT, INTERRUPTED, TERMINATED = 2, 130, 143


@click.group(
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples(
        "recon build drive/ -o model.usd            textured model, and model.recon/ beside it",
        "recon export model.recon/ -o plan.dxf      another format, nothing computed twice",
        "recon inspect drive.bag                    what a sequence folder, ROS bag or CARMEN log holds",
    ),
)
@click.version_option(__version__, prog_name="recon")
def recon() -> None:
    """Offline indoor 3D reconstruction from a camera and a 2D LiDAR."""


for _command in (build, floorplan, convert, export, evaluate, inspect, simulate, bench, check, report, view):
    recon.add_command(_command)


def main() -> None:
    """Entry point. Exit status: 0, 2 for bad input or usage, 130 after Ctrl-C; bugs keep their traceback."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        recon.main(prog_name="recon", standalone_mode=False)
    except ReconError as error:
        _fail(str(error))
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        click.echo("recon: interrupted", err=True)
        sys.exit(INTERRUPTED)
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _fail(f"{error.filename or 'output'}: no space left on the device")


def _fail(message: str) -> None:
    click.echo("recon: " + " ".join(message.split()), err=True)
    sys.exit(BAD_INPUT)


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    sys.exit(TERMINATED)  # unwinds, so that temporary files are removed
