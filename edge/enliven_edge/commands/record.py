"""``enliven record``: writes what a sensor delivers to a file."""

from __future__ import annotations

import contextlib
import logging
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from enliven.errors import InputError
from enliven_edge.commands.progress import frame_progress

if TYPE_CHECKING:
    from enliven.recording import Recorder
    from enliven_edge.sensors import Sensor

log = logging.getLogger(__name__)

_PATIENCE = 0.25
"""Seconds to wait for a frame before checking for an end and handing the written data to the disk."""


def record(
    output: Annotated[Path, typer.Option("--output", "-o", help="The recording to make.")],
    sensor: Annotated[str, typer.Option(help="The sensor's name.")] = "synthetic",
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="An option of the sensor, KEY=VALUE; may be repeated.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Stop after so many seconds of the sensor's clock.")
    ] = None,
    level: Annotated[int, typer.Option(min=1, max=22, help="Compression: 1 fast, 19 small.")] = 1,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
) -> None:
    """Record a sensor until its stream ends, the time is up, or Ctrl-C.

    \b
      enliven record --sensor synthetic --seconds 10 -o take.mcap
      enliven record --sensor replay --set path=LONG.mcap --set speed=0 --seconds 5 -o start.mcap
    """
    from enliven.recording import Recorder
    from enliven_edge.recording import DiskSync
    from enliven_edge.sensors import kept_open, sensor_opener, sensor_options

    console = Console()
    with (
        kept_open(sensor_opener(sensor, every_frame=True, **sensor_options(setting or []))) as stream,
        Recorder(output, compression_level=level, overwrite=overwrite) as recorder,
        contextlib.closing(DiskSync(recorder.fileno())) as disk,
        stop_on_interrupt() as stop,
        frame_progress(console) as progress,
    ):
        recorder.add_metadata("record", {"sensor": sensor, "options": " ".join(setting or [])})
        task = progress.add_task(f"Recording {stream.name}", total=None, count=0)
        count = 0
        for count in record_stream(stream, recorder, stop, seconds):
            progress.update(task, count=count)
            disk.check()
    typer.echo(f"{output}: {count} frames of {stream.name}, {output.stat().st_size / 1e6:.1f} MB")


def record_stream(
    stream: Sensor, recorder: Recorder, stop: threading.Event, seconds: float | None = None
) -> Iterator[int]:
    """Write frames until the stream ends, ``stop`` is set, or ``seconds`` have passed; yields the count.

    What becomes of the sensor is written beside them. One that fails is read on, and a frame that cannot be
    used is left out; both are logged.
    """
    from enliven_edge.sensors import Diary, SensorFault, condition_of
    from enliven_edge.tracking.frame import flaw_of

    count, first_ns, diary = 0, None, Diary(recorder)
    while not stop.is_set():
        try:
            frame = stream.read(_PATIENCE)
        except TimeoutError:
            recorder.sync()
            continue
        except (SensorFault, InputError) as error:
            log.warning("%s", error)
            diary.failed(error)
            continue
        if frame is None:
            return
        if flaw := flaw_of(frame):
            log.warning("%s: a frame is left out: %s", stream.name, flaw)
            diary.failed(InputError(flaw, where=stream.name))
            continue
        first_ns = frame.time_ns if first_ns is None else first_ns
        if seconds is not None and frame.time_ns - first_ns >= seconds * 1e9:
            return
        try:
            diary.frame(frame, condition_of(stream))
        except InputError as error:
            log.warning("a frame is left out: %s", error)
            continue
        count += 1
        yield count


@contextlib.contextmanager
def stop_on_interrupt() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C sets, so that the file is completed; a second Ctrl-C interrupts at once."""
    stop = threading.Event()

    def interrupted(number: int, frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = signal.signal(signal.SIGINT, interrupted)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
