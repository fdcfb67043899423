"""``enliven import``: converts recordings of other programs."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from enliven.errors import InputError, ResourceError
from enliven_edge.commands.progress import frame_progress

if TYPE_CHECKING:
    from enliven.frames import Frame
    from enliven_edge.importing import Reader


@dataclass
class Found:
    """Counts of what an import has read so far."""

    frames: int = 0
    people: int = 0
    first_ns: int = 0
    last_ns: int = 0
    coloured: int = 0
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

    @property
    def summary(self) -> str:
        """One line for the user."""
        seconds = (self.last_ns - self.first_ns) * 1e-9
        who = "1 person" if self.people == 1 else f"{self.people} people"
        what = self.size or f"bodies, {who}"
        colour = f", {self.coloured} with colour" if self.coloured else ""
        return f"{self.frames} frames of {what}{colour}, {seconds:.1f} s, sensor {', '.join(self.sensors)}"


def import_recording(
    files: Annotated[list[str] | None, typer.Argument(help="Files, folders or patterns.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The recording to make.")] = None,
    reader: Annotated[str | None, typer.Option(help="The layout, where it is not recognised.")] = None,
    fps: Annotated[
        float | None,
        typer.Option(min=0.1, max=1000.0, help="Frames a second, where the files hold no times."),
    ] = None,
    device: Annotated[
        str | None, typer.Option(help="Which sensor of several in a file; else the name to give the sensor.")
    ] = None,
    mirror: Annotated[
        bool, typer.Option(help="Swap left and right (some drivers deliver a mirror image).")
    ] = False,
    level: Annotated[int, typer.Option(min=1, max=22, help="Compression: 1 fast, 19 small.")] = 1,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
    list_readers: Annotated[bool, typer.Option("--list-readers", help="Show the known layouts.")] = False,
) -> None:
    """Bring a foreign recording in: depth images or skeletons, in any of the known layouts.

    \b
      enliven import PERSON_TURN/ -o turn.mcap                    a folder of depth images
      enliven import GESTURES/WAVE.csv -o wave.mcap               one skeleton recording
      enliven import STUDY.csv --device 10.0.0.7 -o two.mcap      one of several Kinects in a file
      enliven import VIEWER.bag -o viewer.mcap                    RealSense Viewer, Orbbec Viewer (or .db3)
      enliven import "FRAMES/*.u16" --fps 15 -o frames.mcap       images without times
      enliven import --list-readers                               the layouts that are known
    """
    from enliven_edge.importing import ImportOptions, find_files, find_reader, mirrored

    console = Console()
    if list_readers:
        console.print(_reader_table())
        return
    if not files or output is None:
        raise InputError(
            "nothing to import" if not files else "the recording to make is not named",
            where="enliven import",
            mend="For example: enliven import FOLDER -o take.mcap",
        )
    paths = find_files(files)
    chosen = find_reader(paths, reader)
    frames = chosen.read(paths, ImportOptions(fps, device))
    found = write_recording(mirrored(frames) if mirror else frames, chosen, output, level, overwrite, console)
    size = output.stat().st_size / 1e6
    typer.echo(f"{output}: {found.summary} ({chosen.name}, {size:.1f} MB)")
    if chosen.note:
        typer.echo(f"Note: {chosen.note}.")


def write_recording(
    frames: Iterator[Frame], reader: Reader, output: Path, level: int, overwrite: bool, console: Console
) -> Found:
    """Writes all frames under a temporary name, and renames the file when it is complete.

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
            task = progress.add_task(f"Importing ({reader.name})", total=None, count=0)
            recorder.add_metadata("import", {"reader": reader.name, "note": reader.note})
            for frame in frames:
                found.add(frame)
                recorder.write_frame(frame)
                progress.update(task, advance=1, count=found.frames)
        if not found.frames:
            raise InputError("the files hold no frames", where=reader.name, mend="Choose others.")
        _rename(passing, output)
    finally:
        passing.unlink(missing_ok=True)
    return found


def _rename(passing: Path, output: Path) -> None:
    try:
        os.replace(passing, output)
    except OSError as error:
        raise ResourceError(f"it cannot be replaced ({error.strerror})", where=str(output)) from None


def _reader_table() -> Table:
    from enliven_edge.importing import readers

    table = Table("reader", "layout", "note")
    for reader in readers().values():
        table.add_row(reader.name, reader.description, reader.note)
    return table
