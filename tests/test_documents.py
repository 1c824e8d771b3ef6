"""What the documents say: their commands parse, their links and pictures are there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from urllib.parse import unquote

import click
import pytest
from click.testing import CliRunner

from recon.cli.main import recon

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
DOCUMENTS += [path for top in ("docs", "samples") for path in sorted((ROOT / top).rglob("*.md"))]
BLOCK = re.compile(r"^```[a-z]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(recon [^`\n]+)`")
IN_GENERAL = re.compile(r"COMMAND|\.\.\.|--help")
LINK = re.compile(r"\]\(([^)\s]+)\)")


def commands_of(text: str) -> list[str]:
    """Lines of blocks that begin with `recon`, without what is said behind two spaces, and those in a line."""
    lines = [line for block in BLOCK.findall(text) for line in block.replace("\\\n", " ").splitlines()]
    shown = [re.split(r"\s{2,}|\s#", line.strip())[0] for line in lines if line.strip().startswith("recon ")]
    return shown + [
        found for found in INLINE.findall(BLOCK.sub("", text)) if not re.search(r"COMMAND|\.\.\.|--help", found)
    ]


def parsed(line: str) -> None:
    """Options and arguments read, nothing run. Raises click.UsageError for what the command does not know."""
    name, *rest = shlex.split(line)[1:]
    command: click.Command | None = recon.get_command(click.Context(recon), name)
    if command is None:
        raise click.UsageError(f"no command {name}")
    while isinstance(command, click.Group) and rest and not rest[0].startswith("-"):
        name, *rest = rest
        command = command.get_command(click.Context(command), name)
        if command is None:
            raise click.UsageError(f"no command {name}")
    known = command.make_parser(click.Context(command)).parse_args(list(rest))[0]
    params = {param.name: param for param in command.params}
    for key, value in known.items():
        kind = params[key].type if key in params else None
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if isinstance(kind, click.Choice) and isinstance(one, str):
                kind.convert(one, params[key], None)


DOCUMENTED = [(path.name, line) for path in DOCUMENTS for line in commands_of(path.read_text(encoding="utf-8"))]


@pytest.mark.parametrize(("document", "line"), DOCUMENTED, ids=[f"{name}: {line}" for name, line in DOCUMENTED])
def test_a_documented_command_parses(document: str, line: str) -> None:
    parsed(line)


def test_examples_of_the_help_parse() -> None:
    for name in recon.commands:
        text = CliRunner().invoke(recon, [name, "--help"]).output.split("Examples:")[1]
        examples = [line for line in text.splitlines() if line.strip().startswith("recon ")]
        assert examples
        for line in examples:
            parsed(re.split(r"\s{2,}", line.strip())[0])


def test_wrong_commands_are_told() -> None:
    assert len(DOCUMENTED) > 20
    assert commands_of("```\nrecon build a/ -o b.usd   why\n```\nand `recon inspect a/`.") == [
        "recon build a/ -o b.usd", "recon inspect a/"
    ]  # fmt: skip
    for line in ("recon nothing", "recon build drive/ --no-such-option", "recon export a/ -o b.glb --engine none"):
        with pytest.raises(click.UsageError):
            parsed(line)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document: Path) -> None:
    text = BLOCK.sub("", document.read_text(encoding="utf-8"))
    for target in LINK.findall(text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = unquote(target).partition("#")
        place = (document.parent / path).resolve() if path else document
        assert place.exists(), f"{document.name}: {target}"
        if anchor:
            titles = re.findall(r"^#+ (.+)$", place.read_text(encoding="utf-8"), re.MULTILINE)
            known = {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
            assert anchor in known, f"{document.name}: {target}"
