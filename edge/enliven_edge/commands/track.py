"""``enliven track``: makes takes of people out of a recording of depth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from enliven.errors import InputError
from enliven.settings import load_settings
from enliven_edge.commands.progress import write_recording

if TYPE_CHECKING:
    from enliven.frames import BodyFrame, Frame
    from enliven_edge.tracking import TrackerSettings


def track(
    recording: Annotated[Path, typer.Argument(help="A recording of depth.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The recording of bodies to make.")],
    settings: Annotated[
        Path | None, typer.Option(help="A TOML file of settings, as enliven edge takes it.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
    lines: Annotated[
        bool, typer.Option("--lines", help="Say how far it is line by line, for a program that waits.")
    ] = False,
) -> None:
    """Find the people in a recording of depth, and write where their joints were: a take for everything.

    Every image is tracked, however long that takes. What comes out is a take for the studio and for the
    commands that move a model by a motion, and is replayed like any recording.

    \b
      enliven track TAKE.mcap -o bodies.mcap
      enliven retarget bodies.mcap HORSE.glb -o horse.glb
    """
    from enliven.recording import DEPTH_TOPIC, Recording
    from enliven_edge.settings import EdgeSettings

    source = Recording(recording)
    if DEPTH_TOPIC not in source.info.topics:
        mend = "Give a recording of a depth camera; one of bodies is a take as it is."
        raise InputError("there are no depth images in it", where=str(recording), mend=mend)
    chosen = load_settings(EdgeSettings, settings) if settings else EdgeSettings()
    found_in = tracked(source.frames(), chosen.tracker)
    if lines:
        found_in = _counted(found_in, source.info.topics[DEPTH_TOPIC].count)
    found = write_recording(
        found_in,
        output,
        task="Tracking",
        facts=("track", {"recording": recording.name}),
        empty=InputError("no image of it can be read", where=str(recording), mend="Record it again."),
        console=Console(),
        overwrite=overwrite,
    )
    typer.echo(f"{output}: {found.summary}")
    if not found.seen:
        typer.echo("Note: no person was found; see what the tracker sees: enliven inspect, with -o film.mp4.")


def _counted(frames: Iterator[BodyFrame], total: int) -> Iterator[BodyFrame]:
    """Yields the same, and says each time how many of how many there were."""
    for number, frame in enumerate(frames, 1):
        print(f"{number} of {total}", flush=True)
        yield frame


def tracked(frames: Iterable[Frame], settings: TrackerSettings) -> Iterator[BodyFrame]:
    """Yields the bodies in each depth image, world frame; each sensor is tracked by itself.

    An image that cannot be used is left out, as the edge leaves it out.
    """
    from enliven.frames import BodyFrame, DepthFrame
    from enliven_edge.tracking import Tracker
    from enliven_edge.tracking.health import HealthMonitor

    trackers: dict[str, tuple[Tracker, HealthMonitor]] = {}
    for frame in frames:
        if not isinstance(frame, DepthFrame):
            continue
        if frame.sensor not in trackers:
            trackers[frame.sensor] = Tracker(settings), HealthMonitor(far=settings.scene.far)
        tracker, monitor = trackers[frame.sensor]
        if monitor.admit(frame):
            yield BodyFrame(tracker.track(frame), frame.time_ns, frame.sensor)
