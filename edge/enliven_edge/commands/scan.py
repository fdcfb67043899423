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
    camera is lost, nothing is added; look again at what was scanned already, and it goes on.

    \b
      enliven scan --sensor realsense -o chair.glb --sheet chair.png
      enliven scan --sensor realsense -o chair.glb --edge 192.168.1.20
      enliven scan --recording TAKE.mcap -o room.glb --whole --voxel 10 --reach 5
    """
    from enliven.scanning import Scanner, ScanSettings, VolumeSettings
    from enliven_edge.scanning import ScanDiary, finished, put_on_stage, stage_command, write_scan

    _checked(output, recording, sensor, overwrite)
    if edge is not None:
        stage_command()  # what is missing for it is said before the scan
    console, diary = Console(), ScanDiary()
    scanner = Scanner(ScanSettings(volume=VolumeSettings(voxel=voxel * 1e-3, reach=reach)))
    where = str(recording or sensor)
    with interruptible() as stop, frame_progress(console) as progress:
        task = progress.add_task("Scanning", total=None, count=0)
        first_ns = None
        for frame in _frames(recording, sensor, setting or [], stop):
            first_ns = frame.time_ns if first_ns is None else first_ns
            if seconds is not None and frame.time_ns - first_ns >= seconds * 1e9:
                break
            diary.add(scanner.add(frame), frame.time_ns)
            progress.update(task, count=diary.frames, description=f"Scanning, {diary.now}")
    diary.refuse(where)
    made = finished(scanner, whole, triangles, output.stem)
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
    for sentence in diary.advice():
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
