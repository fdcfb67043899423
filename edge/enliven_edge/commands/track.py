"""``enliven track``: tracks people in a depth recording or in depth images, and writes a take."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import make_plain_console, print_line
from enliven.errors import InputError
from enliven.settings import load_settings
from enliven_edge.commands.image_options import LensOption, UnitsOption
from enliven_edge.commands.progress import write_recording

if TYPE_CHECKING:
    from enliven.frames import BodyFrame, Frame
    from enliven_edge.tracking.settings import TrackerSettings


def track(
    recording: Annotated[
        Path, typer.Argument(help="A depth recording, a depth image, or a folder of depth images.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Output recording of bodies.")],
    settings: Annotated[Path | None, typer.Option(help="Settings file (TOML), as for enliven edge.")] = None,
    lens: LensOption = None,
    units_per_metre: UnitsOption = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
    lines: Annotated[
        bool, typer.Option("--lines", help="Print the progress line by line, for another program.")
    ] = False,
) -> None:
    """Track the people in a depth recording and write their joints as a take.

    Every image is tracked, even if that is slower than real time. The studio can open the take, and enliven
    retarget can move a model with it. The take replays like any recording. A single 16-bit image is enough.
    All layouts of enliven import are accepted.

    \b
      enliven track TAKE.mcap -o bodies.mcap
      enliven track IMAGE.png -o bodies.mcap
      enliven track IMAGE.png --lens 615,615,320,180 -o bodies.mcap
      enliven retarget bodies.mcap HORSE.glb -o horse.glb
    """
    from enliven_edge.settings import EdgeSettings

    chosen = load_settings(EdgeSettings, settings) if settings else EdgeSettings()
    if _is_recording(recording):
        frames, count = _open_recording(recording)
    else:
        frames, count = _open_images(recording, lens, units_per_metre)
    body_frames = track_frames(frames, chosen.tracker)
    if lines:
        body_frames = _report_progress(body_frames, count)
    contents = write_recording(
        body_frames,
        output,
        task="Tracking",
        facts=("track", {"recording": recording.name}),
        empty=InputError("none of the images can be read", where=str(recording), remedy="Record again."),
        console=make_plain_console(),
        overwrite=overwrite,
    )
    print_line(f"{output}: {contents.summary}")
    if not contents.seen:
        print_line(
            "Note: no person was found. To see the tracking as a film, use enliven inspect with -o film.mp4."
        )


def _is_recording(path: Path) -> bool:
    """Returns True if a path is a recording: a file that is MCAP by its name or its content."""
    from enliven.recording import MAGIC
    from enliven_edge.importing.base import read_head

    return not path.is_dir() and (path.suffix == ".mcap" or read_head(path, len(MAGIC)) == MAGIC)


def _open_recording(path: Path) -> tuple[Iterable[Frame], int]:
    """Returns the frames of a recording, and the number of depth images among them.

    Raises:
        InputError: if it is not a recording, or contains no depth.
    """
    from enliven.recording import DEPTH_TOPIC, Recording

    source = Recording(path)
    if DEPTH_TOPIC not in source.info.topics:
        raise _make_no_depth_error(path)
    return source.frames(), source.info.topics[DEPTH_TOPIC].count


def _open_images(path: Path, lens: str | None, units_per_metre: float | None) -> tuple[Iterable[Frame], int]:
    """Returns the frames in files of other programs, read like ``enliven import``, and the number of files.

    Prints the camera and the assumptions about the files.

    Raises:
        InputError: if no reader recognises the files, or they contain no depth.
    """
    from enliven.frames import DepthFrame
    from enliven_edge.importing.base import ImportOptions, parse_lens
    from enliven_edge.importing.registry import find_files, find_reader

    paths = find_files([str(path)])
    reader = find_reader(paths)

    def note(sentence: str) -> None:
        print_line(f"Note: {sentence}.")

    options = ImportOptions(lens=parse_lens(lens), units_per_metre=units_per_metre, note=note)
    frames = iter(reader.read(paths, options))
    first = next(frames, None)
    if not isinstance(first, DepthFrame):
        raise _make_no_depth_error(path)
    camera = first.intrinsics
    print_line(
        f"Read as {reader.name}, sensor {first.sensor}: fx {camera.fx:.1f}, fy {camera.fy:.1f}, "
        f"cx {camera.cx:.1f}, cy {camera.cy:.1f} pixels at {camera.width}x{camera.height}."
    )
    if reader.note:
        print_line(f"Note: {reader.note}.")
    return chain([first], frames), len(paths)


def _make_no_depth_error(path: Path) -> InputError:
    remedy = "Choose a recording of a depth camera. A recording of bodies is already a take."
    return InputError("the recording has no depth images", where=str(path), remedy=remedy)


def _report_progress(frames: Iterator[BodyFrame], total: int) -> Iterator[BodyFrame]:
    """Yields the same frames, and prints for each its number and the total."""
    for number, frame in enumerate(frames, 1):
        print(f"{number} of {max(number, total)}", flush=True)
        yield frame


def track_frames(frames: Iterable[Frame], settings: TrackerSettings) -> Iterator[BodyFrame]:
    """Yields the bodies in each depth image, in the world frame. Each sensor has its own tracker.

    Unlike in a live edge, searches are not spread over frames, so people in the first image are detected at
    once. Unusable images are left out, as in a live edge.
    """
    from enliven.frames import BodyFrame, DepthFrame
    from enliven_edge.tracking.health.health import HealthMonitor
    from enliven_edge.tracking.settings import without_deadline
    from enliven_edge.tracking.tracker import Tracker

    trackers: dict[str, tuple[Tracker, HealthMonitor]] = {}
    for frame in frames:
        if not isinstance(frame, DepthFrame):
            continue
        if frame.sensor not in trackers:
            tracker = Tracker(without_deadline(settings))
            trackers[frame.sensor] = tracker, HealthMonitor(far=settings.scene.far)
        tracker, monitor = trackers[frame.sensor]
        if monitor.admit(frame):
            yield BodyFrame(tracker.track(frame), frame.time_ns, frame.sensor)
