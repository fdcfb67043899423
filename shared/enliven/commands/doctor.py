"""enliven doctor: what this machine has, what it lacks, and how to mend it."""

from __future__ import annotations

import json

import typer
from rich.table import Table

from enliven.commands.terminal import plain_console, plain_text
from enliven.doctor import Check, all_checks

_LACKING = 4
"""Exit code where a check fails: the same 4 as of :class:`enliven.errors.ResourceError`."""


def doctor(
    as_json: bool = typer.Option(False, "--json", help="Print the checks as JSON, for scripts."),
) -> None:
    """Say what this machine has and lacks: OpenGL, ports, sensors, permissions, and how to mend it.

    Ends with exit code 0 where all is well, 4 where something is missing.

    \b
      enliven doctor
      enliven doctor --json | python -m json.tool
    """
    found = all_checks()
    if as_json:
        typer.echo(json.dumps([vars(check) for check in found], indent=2))
    else:
        plain_console().print(_table(found))
    if not all(check.ok for check in found):
        raise typer.Exit(_LACKING)


def _table(found: list[Check]) -> Table:
    """Builds the table of checks: one row each, with the remedy below a check that failed."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for check in found:
        mark = plain_text("ok", "green") if check.ok else plain_text("missing", "red")
        detail = plain_text(check.detail)
        if not check.ok:
            detail.append("\n").append(plain_text(check.mend, "yellow"))
        table.add_row(mark, plain_text(check.name), detail)
    return table
