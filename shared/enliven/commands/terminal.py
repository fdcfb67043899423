"""Output of commands: lines, tables and progress in which text from outside stays text.

File names, names of devices and of characters, and words of other programs may hold terminal escapes, line
ends or the markup of rich. Every command prints by this module, so none of them has an effect.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import typer

from enliven.logs import escape_text

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table
    from rich.text import Text


def say(line: str, *, err: bool = False) -> None:
    """Prints one line; whatever is not shown as itself is written as an escape sequence.

    Args:
        err: to standard error.
    """
    typer.echo(escape_text(line), err=err)


def plain_console(*, err: bool = False) -> Console:
    """Returns a console that takes no markup or emoji codes from strings.

    Args:
        err: it writes to standard error.
    """
    from rich.console import Console

    return Console(stderr=err, markup=False, emoji=False, highlight=False)


def plain_text(line: str, style: str = "") -> Text:
    """Returns text of one line for a table, with whatever is not shown as itself escaped."""
    from rich.text import Text

    return Text(escape_text(line), style)


def facts_table(facts: Iterable[tuple[str, ...]]) -> Table:
    """Returns facts, each with its name, as a table without lines."""
    from rich.table import Table

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for fact in facts:
        table.add_row(*map(plain_text, fact))
    return table


def progress_lines(*formats: str, console: Console | None = None, bar: bool = False) -> Progress:
    """Returns a display of work on standard error, or on ``console``; it vanishes at the end.

    Args:
        formats: texts with a task's values, such as "{task.description}"; the values are escaped.
        bar: whether it shows the share that is done.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TextColumn, TimeElapsedColumn

    class PlainColumn(TextColumn):
        """A text column that takes no markup, and escapes the values of its task."""

        def render(self, task: Task) -> Text:
            return plain_text(super().render(task).plain)

    texts = [PlainColumn(text, markup=False) for text in formats]
    columns = (SpinnerColumn(), texts[0], *([BarColumn()] if bar else []), *texts[1:], TimeElapsedColumn())
    return Progress(*columns, console=console or plain_console(err=True), transient=True)
