"""Recordings that commands write whole: under a temporary name until the last frame is in."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from enliven.errors import InputError, ResourceError
from enliven_edge.commands.progress import frame_progress

if TYPE_CHECKING:
    from enliven.frames import Frame


@dataclass
class Found:
    """Counts of what was written so far."""

    frames: int = 0
    people: int = 0
    first_ns: int = 0
    last_ns: int = 0
    coloured: int = 0
    seen: int = 0
    sensors: Counter[str] = field(default_factory=Counter)
    size: str = ""

    def add(self, frame: Frame) -> None:
        """Counts one frame."""
        from enliven.frames import DepthFrame

        self.first_ns = frame.time_ns if not self.frames else self.first_ns
        self.frames, self.last_ns = self.frames + 1, frame.time_ns
        self.sensors[frame.sensor] += 1
        if isinstance(frame, DepthFrame):
            self.size = f"{frame.intrinsics.width}x{frame.intrinsics.height} depth"
            self.coloured += frame.colour is not None
        else:
            self.people = max(self.people, len(frame.bodies))
            self.seen += bool(frame.bodies)

    @property
    def summary(self) -> str:
        """One line for the user."""
        seconds = (self.last_ns - self.first_ns) * 1e-9
        who = "1 person" if self.people == 1 else f"{self.people} people"
        what = self.size or f"bodies, {who}"
        colour = f", {self.coloured} with colour" if self.coloured else ""
        return f"{self.frames} frames of {what}{colour}, {seconds:.1f} s, sensor {', '.join(self.sensors)}"


def write_recording(
    frames: Iterable[Frame],
    output: Path,
    *,
    task: str,
    facts: tuple[str, dict[str, str]],
    empty: InputError,
    console: Console,
    level: int = 1,
    overwrite: bool = False,
) -> Found:
    """Writes all frames under a temporary name, and renames the file when it is complete.

    Args:
        task: what the progress bar says.
        facts: a name and values that the recording keeps about how it was made.
        empty: raised where there are no frames.
        level: of the compression, 1 to 22.

    Raises:
        InputError: where the output exists already, or a file cannot be understood; nothing is left behind.
    """
    from enliven.recording import Recorder

    if output.exists() and not overwrite:
        raise InputError("the file exists already", where=str(output), mend="Add --overwrite to replace it.")
    passing = output.with_name(output.name + ".part")
    found = Found()
    try:
        with (
            Recorder(passing, compression_level=level, sync_seconds=10.0, overwrite=True) as recorder,
            frame_progress(console) as progress,
        ):
            bar = progress.add_task(task, total=None, count=0)
            recorder.add_metadata(*facts)
            for frame in frames:
                found.add(frame)
                recorder.write_frame(frame)
                progress.update(bar, advance=1, count=found.frames)
        if not found.frames:
            raise empty
        _rename(passing, output)
    finally:
        passing.unlink(missing_ok=True)
    return found


def _rename(passing: Path, output: Path) -> None:
    try:
        os.replace(passing, output)
    except OSError as error:
        raise ResourceError(f"it cannot be replaced ({error.strerror})", where=str(output)) from None
