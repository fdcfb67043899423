"""``enliven inspect``: reports the faults of a recorded sensor, and draws the tracker's result as a film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import track

from enliven.commands.terminal import facts_table, make_plain_console, print_line
from enliven.errors import InputError
from enliven.files import require_folder, write_picture

if TYPE_CHECKING:
    from enliven.arrays import UInt8
    from enliven.recording import Recording
    from enliven_edge.inspection.inspector import Inspector
    from enliven_edge.inspection.log import SensorLog

_BIT_RATE = 6.0
"""Bit rate of a film in Mbit/s if the encoder has no quality setting. It equals the viewer's bit rate."""
_USUAL_RATE = 30.0
"""Assumed frame rate in frames per second of a recording with too few frames to measure it. It is typical of
depth cameras."""


def inspect(
    recording: Annotated[Path, typer.Argument(help="Recording to inspect.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Output film, an .mp4 file.")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Also write a picture of some frames to this .png file.")
    ] = None,
    width: Annotated[int, typer.Option(min=160, max=3840, help="Width of the film in pixels.")] = 640,
    slow: Annotated[
        float, typer.Option(min=0.1, max=10.0, help="Slow motion: 1 is the recorded speed, 2 is half speed.")
    ] = 1.0,
    frames: Annotated[int, typer.Option(min=0, help="Number of frames of the film. 0 shows all.")] = 0,
) -> None:
    """Report the faults of a recorded sensor. With -o, also write a film of the tracking.

    The report lists missing images, the link and the temperature of the sensor, and lost connections.
    The film shows skeletons over depth, coloured by confidence, and the faults of the sensor.

    \b
      enliven inspect TAKE.mcap
      enliven inspect TAKE.mcap -o take.mp4
      enliven inspect TAKE.mcap -o take.mp4 --sheet take.png --slow 4
    """
    from enliven.recording import DEPTH_TOPIC, Recording
    from enliven_edge.inspection.log import SensorLog
    from enliven_edge.sensors import LogReader

    require_folder(output, sheet)
    source, log = Recording(recording), SensorLog()
    count = source.info.topics[DEPTH_TOPIC].count if DEPTH_TOPIC in source.info.topics else 0
    if output is None:
        for moment in LogReader(source):
            log.add(moment)
    elif count == 0:
        raise InputError(
            "the recording has no depth frames",
            where=str(recording),
            remedy="Choose a recording with depth images, because skeletons alone cannot be tracked.",
        )
    else:
        rate, count = _measure_rate(source, count), min(count, frames or count)
        _write_film(source, log, output, sheet, width, (rate, rate / slow), count)
        print_line(f"{output}: {count} frames at {rate / slow:.3g} frames per second")
    make_plain_console().print(facts_table(log.facts()))


def _write_film(
    source: Recording,
    log: SensorLog,
    output: Path,
    sheet: Path | None,
    width: int,
    rates: tuple[float, float],
    count: int,
) -> None:
    """Writes the film, and the contact sheet if requested. ``rates`` are the frame rates of recording and
    film in Hz.
    """
    import numpy as np
    from PIL import Image

    from enliven.film.writer import FilmWriter
    from enliven_edge.inspection.inspector import Inspector
    from enliven_edge.inspection.picture import contact_sheet
    from enliven_edge.tracking.settings import TrackerSettings, without_deadline
    from enliven_edge.tracking.tracker import Tracker

    inspector = Inspector(Tracker(without_deadline(TrackerSettings())), width, rates[0])
    sheet_pictures: list[UInt8] = []
    picked = set(np.linspace(0, count - 1, min(12, count)).round().astype(int))
    with FilmWriter(output, None, rates[1], _BIT_RATE) as film:
        numbered = zip(range(count), _draw_pictures(source, log, inspector), strict=False)
        for n, picture in track(numbered, "Filming", total=count, transient=True):
            film.add(picture)
            if n in picked:
                sheet_pictures.append(picture)
    if sheet is not None:
        write_picture(sheet, Image.fromarray(contact_sheet(sheet_pictures, 4, 480)))


def _draw_pictures(source: Recording, log: SensorLog, inspector: Inspector) -> Iterator[UInt8]:
    """Draws and yields a picture for every depth frame."""
    from enliven.frames import DepthFrame
    from enliven_edge.sensors import LogReader

    for moment in LogReader(source):
        log.add(moment)
        if isinstance(moment.content, Exception):
            inspector.record_error(moment.content)
        elif isinstance(moment.content, DepthFrame):
            yield inspector.draw_frame(moment.content, moment.condition)


def _measure_rate(source: Recording, count: int) -> float:
    """Returns the frame rate of a recording in frames per second, computed from its times."""
    seconds = source.info.duration
    return min(max((count - 1) / seconds, 1.0), 240.0) if seconds > 0 and count > 1 else _USUAL_RATE
