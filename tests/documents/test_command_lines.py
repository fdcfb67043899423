"""Tests that every command line in documents and help texts is valid, so that its options and files exist."""

from __future__ import annotations

import itertools
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from blocks import PAGES, ROOT, TOOLS, Block, blocks_of

from enliven.cli import HELP, build_command_group
from enliven_edge.sensors.registry import sensor_names

GROUP = build_command_group()
MADE = ("-o", "--output", "--record", "--film", "--sheet", "--write-map", "--print")
"""Options that name an output file."""
FILE = re.compile(r"(?:\w+=)?([\w/*.-]+\.[a-z]\w+)(?:#\w+)?")


def leaves(command, name):
    """Yields (name, command) of a command, or of every command in a group."""
    with command.make_context(name, [], resilient_parsing=True) as context:
        names = command.list_commands(context) if hasattr(command, "list_commands") else []
        members = [(f"{name} {word}", command.get_command(context, word)) for word in names]
    return [(name, command)] + [leaf for word, member in members for leaf in leaves(member, word)]


COMMANDS = dict(leaves(GROUP, "enliven"))


def parse(words: list[str]):
    """Parses a command line without its first word as the program would, and returns its context.

    Raises:
        Exception: a usage error of click's or typer's.
    """
    words = list(words) or ["studio"]  # the program without arguments opens that window
    with GROUP.make_context("enliven", list(words)) as context:
        name, command, rest = GROUP.resolve_command(context, words)
        while hasattr(command, "list_commands"):
            with command.make_context(name, list(rest), parent=context) as context:
                name, command, rest = command.resolve_command(context, rest)
        return command.make_context(name, list(rest), parent=context)


EXAMPLE = tomllib.loads((ROOT / "docs/example-sensor/pyproject.toml").read_text())["project"]
KNOWN = {*sensor_names(), *EXAMPLE["entry-points"]["enliven.sensors"]}
"""Names of the sensors that a document may use."""


def of_help(name: str) -> list[list[str]]:
    """Returns the examples in a command's help. A comment on the same line follows two spaces or a #."""
    text = HELP if name == "enliven" else COMMANDS[name].help or ""
    lines = re.findall(r"^ *(enliven .*)$", text, re.MULTILINE)
    return [shlex.split(re.split(r"\s{2,}| \| ", line)[0], comments=True) for line in lines]


SHELL = [block for page in PAGES for block in blocks_of(page) if block.kind == "shell"]
HELPS = [name for name in COMMANDS if of_help(name)]


def checked(words: list[str], where) -> None:
    try:
        context = parse(words[1:])
    except Exception as error:
        pytest.fail(f"{where}: {shlex.join(words)}: {error}")
    for sensor in _several(context.params.get("sensor")):
        assert sensor.rpartition("=")[2] in KNOWN, f"{where}: {shlex.join(words)}"


def _several(value) -> list[str]:
    return [value] if isinstance(value, str) else list(value or [])


@pytest.mark.parametrize("name", HELPS)
def test_every_example_of_a_help_parses(name):
    for words in of_help(name):
        checked(words, name)


def test_a_wrong_option_or_sensor_is_found():
    for line in ("enliven edge --sensr synthetic", "enliven edge --sensor kinect", "enliven examples fit"):
        with pytest.raises(pytest.fail.Exception if "kinect" not in line else AssertionError):
            checked(line.split(), "here")


@pytest.mark.parametrize("block", SHELL, ids=str)
def test_every_command_line_of_a_document_parses(block: Block):
    for words in block.commands:
        assert words[0] in TOOLS, words
        if words[0] == "enliven" and "COMMAND" not in words:
            checked(words, block)
        elif words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), words
        elif words[0] == ".venv/bin/python":
            assert (ROOT / words[1]).exists(), words


def unmade(commands: list[list[str]]) -> list[str]:
    """Returns lower-case files that a line reads although they are not shipped and no earlier line writes
    them.
    """
    written: set[str] = set()
    missing = []
    for words in commands:
        for before, word in zip(["", *words], words, strict=False):
            named = FILE.fullmatch(word)
            if not named or before in ("--edge", "--host") or words[0] != "enliven":
                continue
            name = Path(named[1])
            own = (
                name.stem.strip("*/").upper() == name.stem.strip("*/")
                or str(name.parent) == str(name.parent).upper() != "."
            )
            if before not in MADE and named[1] not in written and not own and not (ROOT / name).exists():
                missing.append(named[1])
        written |= {word for before, word in itertools.pairwise(words) if before in MADE}
    return missing


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_document_names_only_what_ships_was_made_before_or_is_in_capitals(page):
    assert not unmade([words for block in SHELL if block.page == page for words in block.commands])


@pytest.mark.parametrize("name", HELPS)
def test_a_help_names_only_what_was_made_before_or_is_in_capitals(name):
    assert not unmade(of_help(name))
