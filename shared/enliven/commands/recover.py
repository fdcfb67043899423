"""The command ``enliven recover``: copies all complete messages of a truncated or damaged recording to a new
one."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from enliven.commands.terminal import print_line


def recover(
    recording: Annotated[Path, typer.Argument(help="The truncated or damaged recording.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="New recording for the recovered messages. The file must not exist yet."
        ),
    ],
) -> None:
    """Copy every complete message of a truncated or damaged recording, and report the losses.

    \b
      enliven recover BROKEN.mcap -o whole.mcap
    """
    from enliven.recording import RecordingWarning, Recovery
    from enliven.recording import recover as recovered

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordingWarning)
        recovery: Recovery = recovered(recording, output)
    print_line(f"{output}: {sum(recovery.kept.values())} messages")
    for topic in sorted({*recovery.kept, *recovery.lost}):
        lost = f", {recovery.lost[topic]} lost" if recovery.lost[topic] else ""
        print_line(f"  {topic}: {recovery.kept[topic]} messages{lost}")
    origin = recovery.first_ns or 0
    for span in recovery.spans:
        print_line(f"lost: {_span_in_words(span.start_ns, span.end_ns, origin)}")
    if recovery.nameless:
        print_line(f"lost: {recovery.nameless} messages of unknown topics")
    if not recovery.spans and not recovery.nameless and not recovery.lost:
        print_line("nothing was lost")


def _span_in_words(start_ns: int | None, end_ns: int | None, origin_ns: int) -> str:
    """Describes a time span in words, with times relative to the first recovered message."""
    start, end = (None if t is None else f"{max(0, t - origin_ns) * 1e-9:.3f} s" for t in (start_ns, end_ns))
    if start is None and end is None:
        return "everything"
    if start is None:
        return f"everything before {end}"
    return f"everything after {start}" if end is None else f"between {start} and {end}"
