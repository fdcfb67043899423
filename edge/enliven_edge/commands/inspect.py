"""``enliven inspect``: what the tracker makes of a recording, as a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import track

from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.arrays import UInt8
    from enliven.recording import Recording

_USUAL_RATE = 30.0


def inspect(
    recording: Annotated[Path, typer.Argument(help="The recording.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The film to make, an .mp4 file.")],
    sheet: Annotated[
        Path | None, typer.Option(help="Also a picture of some of its frames, a .png file.")
    ] = None,
    width: Annotated[int, typer.Option(min=160, max=3840, help="Of the film, pixels.")] = 640,
    slow: Annotated[float, typer.Option(min=0.1, max=10.0, help="1 as recorded, 2 half as fast.")] = 1.0,
    frames: Annotated[int, typer.Option(min=0, help="Stop after so many frames; 0 for all.")] = 0,
) -> None:
    """Film what the tracker sees and says: skeletons over depth, coloured by confidence, and its health.

    \b
      enliven inspect TAKE.mcap -o take.mp4
      enliven inspect TAKE.mcap -o take.mp4 --sheet take.png --slow 4
    """
    import numpy as np
    from PIL import Image

    from enliven.frames import DepthFrame
    from enliven.recording import DEPTH_TOPIC, Recording
    from enliven_edge.inspection.film import Film
    from enliven_edge.inspection.inspector import Inspector
    from enliven_edge.inspection.picture import contact_sheet
    from enliven_edge.tracking.tracker import Tracker

    source = Recording(recording)
    count = source.info.topics[DEPTH_TOPIC].count if DEPTH_TOPIC in source.info.topics else 0
    if count == 0:
        raise InputError(
            "there are no depth frames in it", where=str(recording), mend="Skeletons alone cannot be tracked."
        )
    rate = _rate(source, count)
    inspector = Inspector(Tracker(), width, rate)
    count = min(count, frames or count)
    kept: list[UInt8] = []
    picked = set(np.linspace(0, count - 1, min(12, count)).round().astype(int))
    depth = (frame for frame in source.frames() if isinstance(frame, DepthFrame))
    with Film(output, rate / slow) as film:
        numbered = zip(range(count), inspector.pictures(depth), strict=False)
        for n, picture in track(numbered, "Filming", total=count, transient=True):
            film.add(picture)
            if n in picked:
                kept.append(picture)
    if sheet is not None:
        sheet.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(contact_sheet(kept, 4, 480)).save(sheet)
    typer.echo(f"{output}: {count} frames at {rate / slow:.3g} a second")


def _rate(source: Recording, count: int) -> float:
    """Frames a second of a recording, from its times."""
    seconds = source.info.duration
    return min(max((count - 1) / seconds, 1.0), 240.0) if seconds > 0 and count > 1 else _USUAL_RATE
