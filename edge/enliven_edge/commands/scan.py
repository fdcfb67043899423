"""``enliven scan``: carries a depth camera round a thing, and writes the thing as a mesh."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from enliven.errors import InputError, ResourceError
from enliven_edge.commands.progress import frame_progress, interruptible

if TYPE_CHECKING:
    from enliven.frames import DepthFrame
    from enliven.meshes import Mesh

log = logging.getLogger(__name__)

_PATIENCE = 0.25
"""Seconds to wait for a frame before an end is looked for."""

_LEAST_ALONE = 0.01
"""Share of an image that a thing fills at least where nothing else is in it: a hand's width at a metre."""


def scan(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The mesh to make: .glb, .ply, .obj, .stl; or .enliven.")
    ],
    recording: Annotated[Path | None, typer.Option(help="A recording of a carried depth camera.")] = None,
    sensor: Annotated[str | None, typer.Option(help="Instead of a recording, a sensor's name.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="An option of the sensor, KEY=VALUE; may be repeated.")
    ] = None,
    voxel: Annotated[float, typer.Option(min=1, max=50, help="Millimetres of a voxel's side.")] = 4.0,
    reach: Annotated[
        float, typer.Option(min=0.3, max=10, help="Metres up to which surfaces are kept.")
    ] = 2.2,
    within: Annotated[
        float | None,
        typer.Option(min=0.3, max=10, help="Metres; with what is farther left out, the thing may be turned."),
    ] = None,
    moved: Annotated[
        bool,
        typer.Option(help="The thing is turned and put down meanwhile; all its sides end in one mesh."),
    ] = False,
    thing: Annotated[
        int, typer.Option(min=1, help="Which of several things on the floor; 1 was looked at most.")
    ] = 1,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Stop after so many seconds of the sensor's clock.")
    ] = None,
    whole: Annotated[
        bool, typer.Option(help="Keep all that was scanned, not what stands on the floor.")
    ] = False,
    triangles: Annotated[
        int, typer.Option(min=0, help="Triangles of the mesh at most; 0 keeps all.")
    ] = 50_000,
    edge: Annotated[
        str | None, typer.Option(help="Put it on the stage of this running edge: HOST, or HOST:PORT.")
    ] = None,
    sheet: Annotated[Path | None, typer.Option(help="A PNG of six views to write beside it.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing mesh.")] = False,
) -> None:
    """Scan a thing: carry a depth camera round it, until the recording ends, the time is up, or Ctrl-C.

    What stands on the floor where the camera looked is cut out, put upright and written in metres. Where the
    camera is lost, nothing is added; look again at what was scanned already, and it goes on. With --within,
    the camera may stand still, and the thing or the person turn: only how they move to one another counts.
    With --moved, scan the thing as it stands, then lay it on its back or its side, and go on.

    \b
      enliven scan --sensor realsense -o chair.glb --sheet chair.png
      enliven scan --sensor realsense -o chair.glb --edge 192.168.1.20
      enliven scan --sensor realsense -o me.glb --within 1.5
      enliven scan --sensor realsense -o chair.glb --moved
      enliven scan --recording TAKE.mcap -o room.glb --whole --voxel 10 --reach 5
    """
    from enliven.scanning import CutOutSettings, Scanner, ScanSettings, ScanStep, VolumeSettings
    from enliven.scanning.objects import MovedScanner
    from enliven_edge.scanning import (
        ScanDiary,
        finished,
        put_on_stage,
        said_of_things,
        stage_command,
        write_scan,
    )  # fmt: skip

    _checked(output, recording, sensor, overwrite)
    if moved and (whole or within is not None):
        what = "--moved does not go with --whole or --within"
        raise InputError(what, where="scan", mend="Leave one of them out.")
    if edge is not None:
        stage_command()  # what is missing for it is said before the scan
    console, diary = Console(), ScanDiary()
    if within is None:
        volume, cut = VolumeSettings(voxel=voxel * 1e-3, reach=reach), CutOutSettings(number=thing)
        settings = ScanSettings(volume=volume, cut_out=cut)
        scanner = MovedScanner(settings) if moved else Scanner(settings)
    else:
        volume = VolumeSettings(voxel=voxel * 1e-3, reach=min(reach, within), far=within)
        scanner = Scanner(ScanSettings(volume=volume, least_depth=_LEAST_ALONE))
    where = str(recording or sensor)
    with interruptible() as stop, frame_progress(console) as progress:
        task = progress.add_task("Scanning", total=None, count=0)
        first_ns = None
        for frame in _frames(recording, sensor, setting or [], stop):
            first_ns = frame.time_ns if first_ns is None else first_ns
            if seconds is not None and frame.time_ns - first_ns >= seconds * 1e9:
                break
            step = scanner.add(frame)
            diary.add(step if isinstance(step, ScanStep) else step.told, frame.time_ns)
            progress.update(task, count=diary.frames, description=f"Scanning, {diary.now}")
    diary.refuse(where)
    kept = "all" if whole else "thing" if within is None else "alone"
    made = finished(scanner, kept, triangles, output.stem)
    write_scan(made, output)
    if sheet is not None:
        _write_sheet(made.mesh, sheet)
    low, high = made.mesh.bounds
    size = " x ".join(f"{100 * side:.0f}" for side in high - low)
    few = f" (within {1e3 * made.most:.1f} mm of the full scan)" if made.most else ""
    said = f"{len(made.mesh.faces)} triangles{few}, {size} cm, of {diary.frames} frames, {diary.now}"
    typer.echo(f"{output}: {said}")
    if edge is not None:
        put_on_stage(output, edge)
    things = said_of_things(scanner) if kept == "thing" else []
    for sentence in [*things, *diary.advice()]:
        typer.echo(f"Note: {sentence}")


def _checked(output: Path, recording: Path | None, sensor: str | None, overwrite: bool) -> None:
    """Refuses what cannot be, before the first frame."""
    from enliven_edge.scanning import ENDINGS

    if (recording is None) == (sensor is None):
        raise InputError("give a recording or a sensor", where="scan", mend="Add --recording or --sensor.")
    if output.suffix.lower() not in ENDINGS:
        known = ", ".join(ending[1:] for ending in ENDINGS)
        raise InputError(
            f"cannot write {output.suffix or 'no'} files", where=str(output), mend=f"Known: {known}."
        )
    if output.exists() and not overwrite:
        raise InputError("the file exists already", where=str(output), mend="Add --overwrite to replace it.")


def _frames(
    recording: Path | None, sensor: str | None, options: list[str], stop: threading.Event
) -> Iterator[DepthFrame]:
    """Yields the depth frames of a recording or a sensor, until ``stop`` is set."""
    from enliven.frames import DepthFrame
    from enliven.recording import DEPTH_TOPIC, Recording
    from enliven_edge.sensors import SensorFault, kept_open, sensor_opener, sensor_options
    from enliven_edge.tracking.frame import flaw_of

    if recording is not None:
        source = Recording(recording)
        if DEPTH_TOPIC not in source.info.topics:
            mend = "Give a recording of a depth camera."
            raise InputError("there are no depth images in it", where=str(recording), mend=mend)
        for frame in source.frames():
            if stop.is_set():
                return
            if isinstance(frame, DepthFrame):
                yield frame
        return
    with kept_open(sensor_opener(sensor or "", **sensor_options(options))) as stream:
        while not stop.is_set():
            try:
                frame = stream.read(_PATIENCE)
            except TimeoutError:
                continue
            except (SensorFault, InputError) as error:
                # It is opened again; what was scanned is kept.
                log.warning("%s", error)
                continue
            if frame is None:
                return
            if isinstance(frame, DepthFrame) and not flaw_of(frame):
                yield frame


def _write_sheet(mesh: Mesh, path: Path) -> None:
    from PIL import Image

    from enliven_edge.scanning import sheet_of

    try:
        Image.fromarray(sheet_of(mesh)).save(path, "png")
    except OSError as error:
        raise ResourceError(f"cannot write ({error.strerror})", where=str(path)) from None
