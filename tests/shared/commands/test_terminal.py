"""Tests that commands print foreign text literally: terminal escapes, line ends and markup have no effect."""

from __future__ import annotations

import ast
import io
from pathlib import Path

import pytest
from rich.console import Console

from enliven.commands.terminal import facts_table, make_plain_console, print_line, progress_lines

HOSTILE = "a\x1b[31m\u202e[red]\nforged:rm\x07\x9b2J"
SHOWN = r"a\x1b[31m\u202e[red]\nforged:rm\x07\x9b2J"
HOUSE = Path(__file__).parents[3]
OWN = {
    "shared/enliven/cli.py": 3,  # the version, the help, and a message that it escapes itself
    "shared/enliven/commands/terminal.py": 1,
    "shared/enliven/commands/doctor.py": 1,  # JSON in ASCII
    "edge/enliven_edge/commands/sensors.py": 2,  # JSON in ASCII, and an image
}
"""Number of calls per module that print without :func:`enliven.commands.terminal.print_line`."""


def test_a_line_from_outside_is_one_line(capsys):
    print_line(f"enliven: {HOSTILE}")
    print_line(HOSTILE, err=True)
    assert capsys.readouterr() == (f"enliven: {SHOWN}\n", f"{SHOWN}\n")


def test_tables_and_progress_take_no_markup():
    stream = io.StringIO()
    console = Console(file=stream, width=200, force_terminal=True, color_system=None, markup=False)
    console.print(facts_table([("name", HOSTILE), (HOSTILE, "[bold]b[/bold] :smile:")]))
    with progress_lines("{task.description}: {task.fields[count]}", console=console, bar=True) as progress:
        progress.add_task(HOSTILE, total=3, count=HOSTILE)
        progress.refresh()
    text = stream.getvalue()
    assert text.count(SHOWN) == 2 and text.count(SHOWN[:20]) >= 4, "rich itself drops the bell of progress"
    assert "[bold]b[/bold] :smile:" in text
    assert "\x1b[31m" not in text and "\u202e" not in text and "\x9b" not in text


def test_the_console_of_commands_takes_no_markup(capsys):
    make_plain_console().print("[red]x[/red] :smile: 12")
    assert capsys.readouterr().out.strip() == "[red]x[/red] :smile: 12"


def prints(path: Path) -> int:
    """Returns the number of calls in a module that print without ``print_line``."""
    tree, count = ast.parse(path.read_text(encoding="utf-8")), 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            count += name in (
                "typer.echo",
                "click.echo",
                "Console",
                "sys.stdout.write",
                "Table",
                "TextColumn",
            )
    return count


@pytest.mark.parametrize("package", ["shared/enliven", "edge/enliven_edge", "viewer/enliven_viewer"])
def test_commands_print_through_one_function(package):
    for folder in ("commands", "."):
        for path in sorted((HOUSE / package / folder).glob("*.py")):
            name = path.relative_to(HOUSE).as_posix()
            tables = name in ("shared/enliven/commands/terminal.py", "shared/enliven/commands/doctor.py")
            more = 2 if name.endswith("terminal.py") else 1
            allowed = OWN.get(name, 0) + more * tables + (name == "edge/enliven_edge/commands/import_.py")
            assert prints(path) <= allowed, f"{name} prints without enliven.commands.terminal.print_line"
