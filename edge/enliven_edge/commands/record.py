"""``enliven record``: writes the frames of a sensor to a file."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import make_plain_console, print_line
from enliven.errors import InputError
from enliven_edge.commands.progress import frame_progress, interruptible

if TYPE_CHECKING:
    from enliven.recording import Recorder
    from enliven_edge.recording.parts import PartedRecorder
    from enliven_edge.sensors import Sensor

log = logging.getLogger(__name__)

_FRAME_TIMEOUT_S = 0.25
"""Seconds to wait for a frame before checking for the end and flushing the written data to disk."""


def record(
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="Output recording. {time} in its name becomes the time, {number} a free number.",
        ),
    ],
    sensor: Annotated[str, typer.Option(help="Sensor type, such as synthetic.")] = "synthetic",
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="Sensor option, KEY=VALUE. Repeat for several options.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Duration in seconds, measured by the sensor's clock.")
    ] = None,
    level: Annotated[
        int, typer.Option(min=1, max=22, help="Compression level: 1 is fast, 19 makes small files.")
    ] = 1,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
    part_minutes: Annotated[
        float | None,
        typer.Option(help="Duration in minutes after which the recording continues in a new file."),
    ] = None,
    keep_free: Annotated[
        float | None,
        typer.Option(
            help="Disk space to keep free, in GB. To free space, the oldest recordings with the same name "
            "pattern are deleted."
        ),
    ] = None,
) -> None:
    """Record a sensor until its stream ends, the time is up, or Ctrl-C.

    \b
      enliven record --sensor synthetic --seconds 10 -o take.mcap
      enliven record --sensor replay --set path=LONG.mcap --set speed=0 --seconds 5 -o start.mcap
    """
    from enliven_edge.recording.parts import PartedRecorder
    from enliven_edge.recording.settings import RecordingSettings, settings_with_options
    from enliven_edge.sensors import open_reopening, sensor_opener, sensor_options

    console = make_plain_console()
    settings = settings_with_options(RecordingSettings(), part_minutes, keep_free)
    with (
        open_reopening(sensor_opener(sensor, every_frame=True, **sensor_options(setting or []))) as stream,
        PartedRecorder(output, compression_level=level, overwrite=overwrite, settings=settings) as recorder,
        interruptible() as stop,
        frame_progress(console) as progress,
    ):
        recorder.add_metadata("record", {"sensor": sensor, "options": " ".join(setting or [])})
        task = progress.add_task(f"Recording {stream.name}", total=None, count=0)
        count = 0
        for count in record_stream(stream, recorder, stop, seconds):
            progress.update(task, count=count)
    size = sum(path.stat().st_size for path in recorder.paths if path.exists())
    names = ", ".join(str(path) for path in recorder.paths)
    print_line(f"{names}: {count} frames of {stream.name}, {size / 1e6:.1f} MB")
    if recorder.lost:
        print_line(
            f"Note: {recorder.lost} messages are missing from the recording because the disk was full."
        )
    if recorder.failure is not None:
        raise recorder.failure


def record_stream(
    stream: Sensor, recorder: Recorder | PartedRecorder, stop: threading.Event, seconds: float | None = None
) -> Iterator[int]:
    """Writes frames until the stream ends, ``stop`` is set, or ``seconds`` have passed. Yields the count.

    The events of the sensor are recorded too. Reading continues after a failure of the sensor. Unusable
    frames are skipped. Failures and skipped frames are logged.
    """
    from enliven_edge.sensors import EventLog, SensorFault
    from enliven_edge.tracking.frame.frame_check import find_flaw

    count, first_ns, event_log = 0, None, EventLog(recorder)
    while not stop.is_set():
        try:
            frame = stream.read(_FRAME_TIMEOUT_S)
        except TimeoutError:
            recorder.sync()
            continue
        except (SensorFault, InputError) as error:
            log.warning("%s", error)
            event_log.write_error(error)
            continue
        if frame is None:
            return
        if flaw := find_flaw(frame):
            log.warning("%s: skipped a frame: %s", stream.name, flaw)
            event_log.write_error(InputError(flaw, where=stream.name))
            continue
        first_ns = frame.time_ns if first_ns is None else first_ns
        if seconds is not None and frame.time_ns - first_ns >= seconds * 1e9:
            return
        try:
            event_log.write_frame(frame, stream.condition())
        except InputError as error:
            log.warning("skipped a frame: %s", error)
            continue
        count += 1
        yield count
