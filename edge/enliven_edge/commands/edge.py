"""``enliven edge``: the program on the computer with the camera."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands import check_parts
from enliven.errors import InputError
from enliven.files import require_folder
from enliven.settings import load_settings

if TYPE_CHECKING:
    from enliven.document import Character
    from enliven_edge.fusion.live import FusedSensors
    from enliven_edge.landmarks import ColourPoseEstimator
    from enliven_edge.network import Access
    from enliven_edge.physics import PhysicsSettings, Playground
    from enliven_edge.sensors import Sensor
    from enliven_edge.settings import CharacterChoice, EdgeSettings
    from enliven_edge.sources import Source

log = logging.getLogger(__name__)


def edge(
    sensor: Annotated[
        list[str] | None,
        typer.Option(help="A sensor by name, such as synthetic. For several, give NAME=SENSOR each."),
    ] = None,
    recording: Annotated[
        list[str] | None,
        typer.Option(help="Replay this recording instead of a sensor. For several, give NAME=FILE each."),
    ] = None,
    space: Annotated[
        Path | None, typer.Option(help="File with the places of several sensors, from enliven calibrate.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--set", help="An option of the sensor, KEY=VALUE or NAME.KEY=VALUE.")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.0, help="Pace of a replay: 1 as recorded, 0 no waiting.")
    ] = 1.0,
    loop: Annotated[bool, typer.Option(help="Begin the replay again at its end.")] = False,
    mesh: Annotated[
        list[str] | None,
        typer.Option(
            help="Character to move: a mesh, 'chair', 'lamp', or a puppet (its session, its project, or "
            "'cactus'). Repeat the option for several."
        ),
    ] = None,
    possess_at: Annotated[
        float | None, typer.Option(help="Possess the mesh this many seconds after the start.")
    ] = None,
    parts: Annotated[
        list[str] | None,
        typer.Option(
            help="Body parts that possess the mesh: all, legs, 'upper body', ...; for two performers: "
            "'legs / torso'. Give one for each --mesh.",
            callback=check_parts,
        ),
    ] = None,
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="The meshes' axis that points up; guessed by default."),
    ] = None,
    physics: Annotated[
        str | None, typer.Option(help="Loose objects to knock about: boxes, dodgeball, or none.")
    ] = None,
    drive: Annotated[
        list[str] | None,
        typer.Option(
            help="Rig that moves the mesh: graph, or skeleton (of a rigged glTF). Give one for each --mesh."
        ),
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="A TOML file of settings.")] = None,
    name: Annotated[str | None, typer.Option(help="The edge's name on the network.")] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on; 0.0.0.0 for all.")] = None,
    insecure: Annotated[
        bool | None,
        typer.Option(
            "--insecure",
            "--open",
            help="Use no keys: everyone that reaches --host watches and possesses characters.",
        ),
    ] = None,
    port: Annotated[int | None, typer.Option(help="Port of the poses, 0 for a free one.")] = None,
    control_port: Annotated[
        int | None, typer.Option(help="Port of the commands; by default the next one.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            help="Write the take (bodies, poses) to this file; {time} or {number} in its name is filled in."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing take.")] = False,
    out: Annotated[
        list[str] | None,
        typer.Option(
            help="Send the motion live to another program: vmc:HOST[:PORT], vrchat:, rokoko: or osc:. "
            "Repeat the option for several."
        ),
    ] = None,
    wait_for_viewer: Annotated[
        float, typer.Option(help="Seconds to wait for a viewer before starting.")
    ] = 0.0,
    seconds: Annotated[
        float | None, typer.Option(help="Stop after this long, by the sensor's clock.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End at the sensor's first fault.")] = False,
    wait_for_sensor: Annotated[bool, typer.Option("--wait-for-sensor", help="Wait for a camera.")] = False,
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
    from enliven_edge.network import open_access, raise_descriptor_limit
    from enliven_edge.outputs import outputs_of
    from enliven_edge.physics import PhysicsSettings
    from enliven_edge.settings import characters_from_options

    edge_settings = _load_edge_settings(
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
    edge_settings = dataclasses.replace(edge_settings, outputs=outputs_of(out or [], edge_settings.outputs))
    characters = characters_from_options(mesh or [], drive or [], parts or [], edge_settings.characters)
    folder = settings.parent if settings else None
    source = _select_sources(sensor or [], recording or [], option or [], speed, loop, edge_settings, folder)
    if space is not None:
        edge_settings = dataclasses.replace(edge_settings, space=str(space))
    elif edge_settings.space and folder is not None:
        edge_settings = dataclasses.replace(edge_settings, space=str(folder / edge_settings.space))
    run_options = (characters, possess_at, record, overwrite, wait_for_viewer, seconds)
    serve(edge_settings, source, run_options, folder, once, wait_for_sensor, access)


def _limit_blas_threads() -> None:
    """Limits the matrix library of NumPy and SciPy to one thread, because matrices here are small and idle
    threads spin.

    This saves 0.1 s of processor time at each start (measured). A number of threads that the user has set is
        kept.
    """
    if "numpy" not in sys.modules:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def serve(
    edge_settings: EdgeSettings,
    sources: list[Source],
    run_options: tuple[list[CharacterChoice], float | None, Path | None, bool, float, float | None],
    folder: Path | None = None,
    once: bool = False,
    wait_for_sensor: bool = False,
    access: Access | None = None,
) -> None:
    """Opens the sensors and the stage, runs the loop, and closes everything. Imports heavy modules only
    here."""
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.commands.preparation import prepare_actors
    from enliven_edge.commands.progress import handle_signals
    from enliven_edge.controls import open_controls
    from enliven_edge.extras import need
    from enliven_edge.network import Outlet, check_free, is_local
    from enliven_edge.outputs import open_outputs
    from enliven_edge.physics import PhysicsSwitch
    from enliven_edge.scans import Scans
    from enliven_edge.service import Edge
    from enliven_edge.sources import open_sources
    from enliven_edge.stage import Stage
    from enliven_edge.tracking import Tracker, without_deadline
    from enliven_edge.tracking.health import HealthMonitor

    characters, possess_at, record, overwrite, viewer_timeout, seconds = run_options
    if edge_settings.physics.world != "none":
        need("mujoco", "physics", "--physics")
    check_free(edge_settings.wire, access)
    outputs = open_outputs(edge_settings.outputs, folder)
    with outputs, handle_signals(_raise_interrupt, signal.SIGTERM), contextlib.ExitStack() as stack:
        hides_talk = edge_settings.wire.insecure or not is_local(edge_settings.wire.host)
        controls = stack.enter_context(open_controls(edge_settings.controls, folder, hides_talk=hides_talk))
        sensors = open_sources(sources, stack, wait_for_sensor)
        is_live = any(source.sensor != "replay" for source in sources)
        if not is_live:
            edge_settings = dataclasses.replace(
                edge_settings, tracker=without_deadline(edge_settings.tracker)
            )
        sensor = stack.enter_context(_combine_sensors(sensors, sources, edge_settings, once))
        actors, parts = prepare_actors(characters, edge_settings)
        playground = _create_playground(edge_settings.physics, [actor.character for actor in actors], is_live)
        outlet = stack.enter_context(
            Outlet(edge_settings.wire, sensor.name, record=record, overwrite=overwrite, access=access)
        )
        stage = Stage(actors, edge_settings.stage)
        outputs.check(stage)
        service = Edge(
            sensor,
            Tracker(edge_settings.tracker, _open_colour_estimator(edge_settings, stack)),
            stage,
            outlet,
            uploads=CharacterUploads(stage, edge_settings),
            scans=Scans(stage, edge_settings),
            possess_at=possess_at,
            parts=parts,
            stop_after=seconds,
            physics=PhysicsSwitch(edge_settings.physics, live=is_live, playground=playground),
            controls=controls,
            outputs=outputs,
            once=once,
            health=HealthMonitor(
                edge_settings.health, fps=getattr(sensor, "fps", None), far=edge_settings.tracker.scene.far
            ),
        )
        controls.forget()
        with handle_signals(service.stop, signal.SIGINT, signal.SIGTERM):
            log.info(
                "%s listens on %s for %s", edge_settings.wire.name, outlet.publisher.endpoint, sensor.name
            )
            if access is not None:
                access.begin()
            if viewer_timeout:
                service.wait_for_viewer(viewer_timeout)
            service.run()
        outlet.end(service.pace)
        log.info("%d frames, %.1f ms at the median", service.frames, service.pace.latency_ms(50))


def _raise_interrupt() -> None:
    """Raises KeyboardInterrupt, so that SIGTERM ends the preparation like Ctrl-C and everything opened is
    closed."""
    raise KeyboardInterrupt


def _open_colour_estimator(
    edge_settings: EdgeSettings, stack: contextlib.ExitStack
) -> ColourPoseEstimator | None:
    """Returns the estimator of bodies from colour images, or None if the settings do not use it."""
    if not edge_settings.colour.use:
        return None
    from enliven_edge.landmarks import ColourPoseEstimator, MediaPipeSource

    return ColourPoseEstimator(
        stack.enter_context(MediaPipeSource(edge_settings.colour.mediapipe)), edge_settings.colour.lift
    )


def _create_playground(
    physics_settings: PhysicsSettings, characters: list[Character], is_live: bool
) -> Playground | None:
    """Returns the physics world, ready for the first frame, or None. With a recording it is deterministic."""
    if physics_settings.world == "none":
        return None
    from enliven_edge.physics import Playground

    if not is_live:
        physics_settings = dataclasses.replace(
            physics_settings, engine=dataclasses.replace(physics_settings.engine, budget=0.0)
        )
    playground = Playground(physics_settings, characters)
    playground.warm_up()
    return playground


def _load_edge_settings(path: Path | None, **overrides: str | int | bool | None) -> EdgeSettings:
    """Returns the settings of the file, with the values of the command line in their place."""
    from enliven_edge.settings import EdgeSettings, WireSettings

    loaded = load_settings(EdgeSettings, path) if path else EdgeSettings()
    wire_values = {key: value for key, value in overrides.items() if value is not None}
    port = wire_values.get("port")
    if isinstance(port, int) and "control_port" not in wire_values:
        wire_values["control_port"] = port + 1 if port else 0
    wire = load_settings(WireSettings, {**vars(loaded.wire), **wire_values}, where="command line")
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
    """Returns the sources of the command line. Without any: those of the settings, or else the shipped
    recording."""
    from enliven_edge.doctor import shipped_recording
    from enliven_edge.sensors import sensor_options
    from enliven_edge.sources import parse_source, sources_from_settings

    if len(sensors) == 1 and len(recordings) == 1:
        raise typer.BadParameter("give a sensor or a recording, not both")
    replay = {"speed": speed, "loop": loop}
    names = [*sensors, *recordings]
    if not names and edge_settings.sensors:
        return sources_from_settings(edge_settings.sensors, folder)
    names = names or [str(shipped_recording())]
    return [parse_source(name, sensor_options(options), replay) for name in names]


def _combine_sensors(
    sensors: dict[str, Sensor], sources: list[Source], edge_settings: EdgeSettings, once: bool
) -> Sensor:
    """Returns the only sensor, or several sensors fused into one that delivers bodies."""
    if len(sensors) == 1:
        return next(iter(sensors.values()))
    if not edge_settings.space:
        raise InputError(
            "the places of several sensors must be known",
            where="edge",
            mend="Run enliven calibrate ... -o space.toml, and give --space space.toml.",
        )
    return _fuse_sensors(sources, sensors, edge_settings, once)


def _fuse_sensors(
    sources: list[Source], sensors: dict[str, Sensor], edge_settings: EdgeSettings, once: bool
) -> FusedSensors:
    """Returns several sensors fused into one that delivers bodies."""
    from enliven_edge.fusion.live import FusedSensors, settings_before_fusion, warm_up_fusion
    from enliven_edge.fusion.placement import load_space
    from enliven_edge.tracking import Tracker
    from enliven_edge.tracking.health import HealthMonitor

    trackers, health = {}, {}
    for source, (name, sensor) in zip(sources, sensors.items(), strict=True):
        scene = source.scene or edge_settings.tracker.scene
        trackers[name] = Tracker(
            settings_before_fusion(dataclasses.replace(edge_settings.tracker, scene=scene))
        )
        fps = getattr(sensor, "fps", None)
        health[name] = HealthMonitor(edge_settings.health, fps=fps, far=scene.far, name=name)
    warm_up_fusion()
    space = load_space(Path(edge_settings.space))
    return FusedSensors(sensors, trackers, space, edge_settings.fusion, health, once)
