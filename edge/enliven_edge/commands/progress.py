"""Progress lines of commands, their handling of Ctrl-C, and the writing of complete recordings."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from enliven.commands.terminal import progress_lines
from enliven.errors import InputError
from enliven.files import replace_file

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from enliven.frames import Frame


@contextlib.contextmanager
def handle_signals(callback: Callable[[], None], *signals: int) -> Iterator[None]:
    """Calls ``callback`` when one of the signals arrives while the context is open.

    Does nothing outside the main thread, because only the main thread receives signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handlers = {
        signal_number: signal.signal(signal_number, lambda *_: callback()) for signal_number in signals
    }
    try:
        yield
    finally:
        for signal_number, handler in previous_handlers.items():
            signal.signal(signal_number, handler)


@contextlib.contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C sets, so that the caller can finish its work. A second Ctrl-C interrupts at
    once."""
    stop = threading.Event()

    def interrupted() -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with handle_signals(interrupted, signal.SIGINT):
        yield stop


def frame_progress(console: Console) -> Progress:
    """Returns a progress line with the frame count and the time. Its tasks need the field ``count``."""
    return progress_lines("{task.description}: {task.fields[count]} frames", console=console)


@dataclass
class RecordingCounts:
    """Counts of the frames and people written so far."""

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
        """Returns a summary of the counts in one line for the user."""
        seconds = (self.last_ns - self.first_ns) * 1e-9
        people = "1 person" if self.people == 1 else f"{self.people} people"
        content = self.size or f"bodies, {people}"
        colour = f", {self.coloured} with colour" if self.coloured else ""
        return f"{self.frames} frames of {content}{colour}, {seconds:.1f} s, sensor {', '.join(self.sensors)}"


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
) -> RecordingCounts:
    """Writes all frames under a temporary name, and renames the file when it is complete.

    Args:
        task: text of the progress bar.
        facts: name and values of a metadata record that describes the origin of the recording.
        empty: the error that is raised if there are no frames.
        level: compression level, 1 to 22.

    Raises:
        InputError: if the output exists already, or an input file is invalid. No partial file is left.
    """
    from enliven.recording import Recorder

    if output.exists() and not overwrite:
        raise InputError(
            "the file exists already", where=str(output), remedy="Add --overwrite to replace it."
        )
    contents = RecordingCounts()
    with replace_file(output) as part:
        with (
            Recorder(part, compression_level=level, sync_seconds=10.0, overwrite=True) as recorder,
            frame_progress(console) as progress,
        ):
            bar = progress.add_task(task, total=None, count=0)
            recorder.add_metadata(*facts)
            for frame in frames:
                contents.add(frame)
                recorder.write_frame(frame)
                progress.update(bar, advance=1, count=contents.frames)
        if not contents.frames:
            raise empty
    return contents
