"""Terminal output of commands: lines, tables and progress bars. Untrusted text is escaped.

File names, names of devices and characters, and output of other programs may contain terminal escape
sequences, line ends or rich markup. All commands print through this module, which makes them harmless.
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


def print_line(line: str, *, err: bool = False) -> None:
    """Prints one line. Unprintable characters are replaced by visible escape codes.

    Args:
        err: True to print to standard error.
    """
    typer.echo(escape_text(line), err=err)


def make_plain_console(*, err: bool = False) -> Console:
    """Returns a console that does not interpret markup or emoji codes in strings.

    Args:
        err: True to write to standard error.
    """
    from rich.console import Console

    return Console(stderr=err, markup=False, emoji=False, highlight=False)


def make_plain_text(line: str, style: str = "") -> Text:
    """Returns one line of text for a table. Unprintable characters are replaced by visible escape codes."""
    from rich.text import Text

    return Text(escape_text(line), style)


def facts_table(facts: Iterable[tuple[str, ...]]) -> Table:
    """Returns a table without borders from rows of text."""
    from rich.table import Table

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for fact in facts:
        table.add_row(*map(make_plain_text, fact))
    return table


def progress_lines(*formats: str, console: Console | None = None, bar: bool = False) -> Progress:
    """Returns a progress display on standard error, or on ``console``. It disappears at the end.

    Args:
        formats: texts with placeholders for a task's values, such as "{task.description}". The values are
            escaped.
        bar: True to show a progress bar.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TextColumn, TimeElapsedColumn

    class PlainColumn(TextColumn):
        """A text column that does not interpret markup, and escapes the values of its task."""

        def render(self, task: Task) -> Text:
            return make_plain_text(super().render(task).plain)

    texts = [PlainColumn(text, markup=False) for text in formats]
    columns = (SpinnerColumn(), texts[0], *([BarColumn()] if bar else []), *texts[1:], TimeElapsedColumn())
    return Progress(*columns, console=console or make_plain_console(err=True), transient=True)
