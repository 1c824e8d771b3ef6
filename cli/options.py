"""Options and messages that commands share."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from recon.config import Config

F = TypeVar("F", bound=Callable[..., Any])

PATH = click.Path(path_type=Path)


def examples(*lines: str) -> str:
    """Epilog of a help text: command lines, kept as they are."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def verbosity(command: F) -> F:
    """Adds -v and -q, which set up messages before the command runs."""
    for option in (
        click.option(
            "-v", "--verbose", count=True, expose_value=False, callback=_set_level, help="Say more (-vv: all)."
        ),
        click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors."),
    ):
        command = option(command)
    return command


def configuration(command: F) -> F:
    """Adds --config, --seed and --workers."""
    for option in (
        click.option("--workers", type=click.IntRange(1, 256), help="Parallel workers; never changes the result."),
        click.option("--seed", type=click.IntRange(0), help="Seed of all that is random (default 0)."),
        click.option("--config", "config_file", type=PATH, help="TOML file of settings; unknown keys are refused."),
    ):
        command = option(command)
    return command


def gathered(keyword: str, options: dict[str, Callable[[Any], Any]]) -> Callable[[Callable[..., Any]], Any]:
    """Adds `options`, by the field of a dataclass that each one sets, and gives a command those used as `keyword`."""

    def decorate(command: Callable[..., Any]) -> Any:
        @functools.wraps(command)
        def collected(*args: Any, **kwargs: Any) -> Any:
            given = {name: kwargs.pop(name) for name in options}
            used = {name: value for name, value in given.items() if value is not None}
            return command(*args, **{keyword: used}, **kwargs)

        wrapped: Any = collected
        for option in reversed(options.values()):
            wrapped = option(wrapped)
        return wrapped

    return decorate


topic_choice = gathered(
    "topics",
    {
        "scan": click.option(
            "--scan-topic", "scan", help="Laser scans of a ROS bag (default: the topic with the most messages)."
        ),
        "image": click.option("--image-topic", "image", help="Images of a ROS bag; none leaves them out."),
        "camera_info": click.option("--camera-info-topic", "camera_info", help="Intrinsics of a ROS bag's images."),
        "odometry": click.option("--odom-topic", "odometry", help="Odometry of a ROS bag; none leaves it out."),
    },
)
"""Gives the command those topics of a ROS bag that were named, by field of `Topics`, as `topics`."""


def resolve_config(config_file: Path | None, seed: int | None, workers: int | None) -> Config:
    """Defaults, then the file, then what the command line says."""
    from recon.config import Config
    from recon.config_file import load_config

    config = Config() if config_file is None else load_config(config_file)
    if seed is not None:
        config = replace(config, seed=seed)
    return config if workers is None else replace(config, workers=workers)


def warn(message: str, quiet: bool = False) -> None:
    """One line on standard error."""
    if not quiet:
        click.echo(f"recon: warning: {message}", err=True)


def _set_level(_context: click.Context, _option: click.Parameter, count: int) -> int:
    levels = {0: logging.WARNING, 1: logging.INFO}
    logging.basicConfig(format="recon: %(message)s", level=logging.WARNING)
    logging.getLogger("recon").setLevel(levels.get(count, logging.DEBUG))
    return count
