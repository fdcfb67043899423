"""``enliven edge``: the program on the computer with the camera."""

from __future__ import annotations

import dataclasses
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands.part_names import check_parts
from enliven.files import require_folder
from enliven.settings import load_settings

if TYPE_CHECKING:
    from enliven_edge.settings import EdgeSettings
    from enliven_edge.sources import Source


def edge(
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="Sensor type, such as synthetic. For several sensors, repeat the option with NAME=SENSOR."
        ),
    ] = None,
    recording: Annotated[
        list[str] | None,
        typer.Option(
            help="Recording to replay instead of a sensor. For several, repeat the option with NAME=FILE."
        ),
    ] = None,
    space: Annotated[
        Path | None, typer.Option(help="File with the poses of several sensors, from enliven calibrate.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--set", help="Option of all sensors (KEY=VALUE) or of one sensor (NAME.KEY=VALUE)."),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.0, help="Speed of a replay: 1 as recorded, 0 as fast as possible.")
    ] = 1.0,
    loop: Annotated[bool, typer.Option(help="Restart the replay at its end.")] = False,
    mesh: Annotated[
        list[str] | None,
        typer.Option(
            help="Character to move: a mesh file, 'chair', 'lamp', or a puppet (a session file, a project "
            "file, or 'cactus'). NAME=MESH gives the character a name. Repeat the option for several "
            "characters."
        ),
    ] = None,
    possess_at: Annotated[
        float | None, typer.Option(help="Time in seconds after the start at which the mesh is possessed.")
    ] = None,
    parts: Annotated[
        list[str] | None,
        typer.Option(
            help="Body parts that possess the mesh, such as all, legs or 'upper body'. For two "
            "performers: 'legs / torso'. For several meshes, repeat the option in the order of --mesh.",
            callback=check_parts,
        ),
    ] = None,
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="Axis of the meshes that points up. By default it is detected."),
    ] = None,
    physics: Annotated[
        str | None, typer.Option(help="Physics objects that characters can push: boxes, dodgeball, or none.")
    ] = None,
    drive: Annotated[
        list[str] | None,
        typer.Option(
            help="Rig that moves the mesh: graph (any mesh) or skeleton (of a rigged glTF). For several "
            "meshes, repeat the option in the order of --mesh."
        ),
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="Settings file (TOML).")] = None,
    name: Annotated[str | None, typer.Option(help="The edge's name on the network.")] = None,
    host: Annotated[
        str | None, typer.Option(help="Address to listen on. 0.0.0.0 listens on all addresses.")
    ] = None,
    insecure: Annotated[
        bool | None,
        typer.Option(
            "--insecure",
            "--open",
            help="Use no keys. Everyone who can reach --host can then watch, and possess characters.",
        ),
    ] = None,
    port: Annotated[int | None, typer.Option(help="Network port of the poses. 0 picks a free port.")] = None,
    control_port: Annotated[
        int | None, typer.Option(help="Network port of the commands. By default, the port after --port.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            help="Write the take (bodies and poses) to this file. {time} in its name is replaced by the "
            "start time, {number} by a free number."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing take.")] = False,
    part_minutes: Annotated[
        float | None, typer.Option(help="Duration in minutes after which the take continues in a new file.")
    ] = None,
    keep_free: Annotated[
        float | None,
        typer.Option(
            help="Disk space to keep free, in GB. To free space, the oldest takes with the same name "
            "pattern are deleted."
        ),
    ] = None,
    keep_stage: Annotated[
        Path | None,
        typer.Option(help="Folder in which the stage is saved, so that it is restored after a restart."),
    ] = None,
    out: Annotated[
        list[str] | None,
        typer.Option(
            help="Send the motion live to another program: vmc:HOST[:PORT], vrchat:, rokoko: or osc:. For "
            "programs that connect to the edge: foxglove:127.0.0.1. Repeat the option for several programs."
        ),
    ] = None,
    wait_for_viewer: Annotated[
        float, typer.Option(help="Maximum time in seconds to wait for a viewer before the start.")
    ] = 0.0,
    seconds: Annotated[
        float | None,
        typer.Option(help="Duration in seconds after which the edge stops, by the sensor's clock."),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Exit at the first fault of the sensor.")] = False,
    wait_for_sensor: Annotated[
        bool, typer.Option("--wait-for-sensor", help="Wait for a camera that is not connected.")
    ] = False,
) -> None:
    """Track people with one sensor or more, let them possess a mesh, and publish the poses.

    \b
      enliven edge --sensor synthetic
      enliven edge --recording TAKE.mcap --mesh HORSE.obj --possess-at 2
      enliven edge --sensor synthetic --host 0.0.0.0 --settings EDGE.toml
      enliven edge --recording TAKE.mcap --record performance.mcap --possess-at 1
      enliven edge --recording LEFT.mcap --recording RIGHT.mcap --space SPACE.toml
      enliven edge --sensor synthetic --physics boxes
      enliven edge --sensor synthetic --mesh SPIDER.glb --drive skeleton
      enliven edge --sensor synthetic --mesh CACTUS.toml
      enliven edge --sensor synthetic --mesh chair --mesh HORSE.obj
      enliven edge --sensor synthetic --out vmc:127.0.0.1 --out osc:192.168.1.20:7000
    """
    _limit_blas_threads()
    require_folder(record)
    from enliven.outputs.settings import collect_output_settings
    from enliven_edge.commands.serving import EdgeJob, serve
    from enliven_edge.kept_stage.folder import stage_folder
    from enliven_edge.network.access import open_access
    from enliven_edge.network.tcp_listener import raise_descriptor_limit
    from enliven_edge.physics.settings import PhysicsSettings
    from enliven_edge.recording.settings import settings_with_options
    from enliven_edge.settings import characters_from_options

    edge_settings = load_edge_settings(
        settings, name=name, host=host, port=port, control_port=control_port, insecure=insecure
    )
    access = open_access(edge_settings.wire)
    raise_descriptor_limit()
    if up is not None:
        edge_settings = dataclasses.replace(edge_settings, up=up)
    if physics is not None:
        world = load_settings(PhysicsSettings, {"world": physics}, where="--physics").world
        edge_settings = dataclasses.replace(
            edge_settings, physics=dataclasses.replace(edge_settings.physics, world=world)
        )
    recording_settings = settings_with_options(edge_settings.recording, part_minutes, keep_free)
    edge_settings = dataclasses.replace(edge_settings, recording=recording_settings)
    edge_settings = dataclasses.replace(
        edge_settings, outputs=collect_output_settings(out or [], edge_settings.outputs)
    )
    characters = characters_from_options(mesh or [], drive or [], parts or [], edge_settings.characters)
    folder = settings.parent if settings else None
    source = _select_sources(sensor or [], recording or [], option or [], speed, loop, edge_settings, folder)
    if space is not None:
        edge_settings = dataclasses.replace(edge_settings, space=str(space))
    elif edge_settings.space and folder is not None:
        edge_settings = dataclasses.replace(edge_settings, space=str(folder / edge_settings.space))
    stage_path = stage_folder(keep_stage, edge_settings.stage.keep, folder, edge_settings.wire.name)
    serve(
        EdgeJob(
            settings=edge_settings,
            sources=source,
            characters=characters,
            access=access,
            folder=folder,
            stage_folder=stage_path,
            record=record,
            overwrite=overwrite,
            possess_at=possess_at,
            viewer_timeout=wait_for_viewer,
            stop_after=seconds,
            once=once,
            wait_for_sensor=wait_for_sensor,
        )
    )


def _limit_blas_threads() -> None:
    """Limits the matrix library of NumPy and SciPy to one thread, because the matrices are small.

    Idle threads of the library would busy-wait. The limit saves 0.1 s of processor time at each start
    (measured). A number of threads that the user has set is kept.
    """
    if "numpy" not in sys.modules:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def load_edge_settings(path: Path | None, **overrides: str | int | bool | None) -> EdgeSettings:
    """Returns the settings of the file, overridden by the values of the command line."""
    from enliven_edge.settings import EdgeSettings, WireSettings

    loaded = load_settings(EdgeSettings, path) if path else EdgeSettings()
    wire_values = {key: value for key, value in overrides.items() if value is not None}
    port = wire_values.get("port")
    if isinstance(port, int) and "control_port" not in wire_values:
        wire_values["control_port"] = port + 1 if port else 0
    wire = load_settings(
        WireSettings, {**vars(loaded.wire), **wire_values}, where="command line", own_file=True
    )
    return dataclasses.replace(loaded, wire=wire)


def _select_sources(
    sensors: list[str],
    recordings: list[str],
    options: list[str],
    speed: float,
    loop: bool,
    edge_settings: EdgeSettings,
    folder: Path | None,
) -> list[Source]:
    """Returns the sources of the command line.

    Without any, returns the sources of the settings, or else the shipped recording.
    """
    from enliven_edge.doctor import find_shipped_recording
    from enliven_edge.sensors import sensor_options
    from enliven_edge.sources import parse_source, sources_from_settings

    if len(sensors) == 1 and len(recordings) == 1:
        raise typer.BadParameter("use either --sensor or --recording, not both")
    replay = {"speed": speed, "loop": loop}
    names = [*sensors, *recordings]
    if not names and edge_settings.sensors:
        return sources_from_settings(edge_settings.sensors, folder)
    names = names or [str(find_shipped_recording())]
    return [parse_source(name, sensor_options(options), replay) for name in names]
