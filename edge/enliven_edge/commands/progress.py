"""The progress bar of commands that count frames."""

from __future__ import annotations

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn


def frame_progress(console: Console) -> Progress:
    """Returns a bar with the share done, the frames and the time; tasks need the field ``count``."""
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}: {task.fields[count]} frames"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )
