"""What commands show on a terminal: frames as they are counted, and facts."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table


def frame_progress(console: Console) -> Progress:
    """Returns a bar with the share done, the frames and the time; tasks need the field ``count``."""
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}: {task.fields[count]} frames"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )


def facts_table(facts: Iterable[tuple[str, str]]) -> Table:
    """Returns facts, each with its name, as a table without lines."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for fact in facts:
        table.add_row(*fact)
    return table
