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

from enliven.commands.part_names import check_parts
from enliven.errors import InputError
from enliven.files import require_folder
from enliven.settings import load_settings
from enliven.supervision.notify import Notifier

if TYPE_CHECKING:
    from enliven.document import Character
    from enliven.possession import Actor
    from enliven_edge.fusion.live.fused_sensor import FusedSensors
    from enliven_edge.kept_stage.keeper import StageKeeper
    from enliven_edge.landmarks.colour_pose import ColourPoseEstimator
    from enliven_edge.network.access import Access
    from enliven_edge.physics.playground import Playground
    from enliven_edge.physics.settings import PhysicsSettings
    from enliven_edge.sensors import Sensor
    from enliven_edge.settings import CharacterChoice, EdgeSettings
    from enliven_edge.sources import Source

log = logging.getLogger(__name__)


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
    from enliven_edge.kept_stage.folder import stage_folder
    from enliven_edge.network.access import open_access
    from enliven_edge.network.tcp_listener import raise_descriptor_limit
    from enliven_edge.physics.settings import PhysicsSettings
    from enliven_edge.recording.settings import settings_with_options
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
    run_options = (characters, possess_at, record, overwrite, wait_for_viewer, seconds)
    stage_path = stage_folder(keep_stage, edge_settings.stage.keep, folder, edge_settings.wire.name)
    serve(edge_settings, source, run_options, folder, once, wait_for_sensor, access, stage_path)


def _limit_blas_threads() -> None:
    """Limits the matrix library of NumPy and SciPy to one thread, because the matrices are small.

    Idle threads of the library would busy-wait. The limit saves 0.1 s of processor time at each start
    (measured). A number of threads that the user has set is kept.
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
    kept: Path | None = None,
) -> None:
    """Opens the sensors and the stage, runs the loop, and closes everything.

    Heavy modules are imported only in this function.
    """
    from enliven.doctor import need
    from enliven.outputs.opening import open_outputs
    from enliven_edge.camera_preview import PRIVACY_NOTE
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.commands.preparation import prepare_actors
    from enliven_edge.commands.progress import handle_signals
    from enliven_edge.controls.control_set import open_controls
    from enliven_edge.live_outputs import LiveOutputs
    from enliven_edge.liveness import MAX_OPENING_S, MAX_PREPARATION_S, ProgressReporter, extend_start_timeout
    from enliven_edge.network.announcing import announce
    from enliven_edge.network.outlet import Outlet, check_free
    from enliven_edge.network.tcp_listener import is_local
    from enliven_edge.physics.switch import PhysicsSwitch
    from enliven_edge.scans import Scans
    from enliven_edge.service import Edge
    from enliven_edge.sources import open_sources
    from enliven_edge.stage.stage import Stage
    from enliven_edge.tracking.health.health import HealthMonitor
    from enliven_edge.tracking.settings import without_deadline
    from enliven_edge.tracking.tracker import Tracker

    characters, possess_at, record, overwrite, viewer_timeout, seconds = run_options
    if edge_settings.physics.world != "none":
        need("mujoco", "physics", "--physics")
    check_free(edge_settings.wire, access)
    outputs = LiveOutputs(open_outputs(edge_settings.outputs, folder, insecure=edge_settings.wire.insecure))
    notifier = Notifier()
    with outputs, handle_signals(_raise_interrupt, signal.SIGTERM), contextlib.ExitStack() as stack:
        hides_talk = edge_settings.wire.insecure or not is_local(edge_settings.wire.host)
        controls = stack.enter_context(open_controls(edge_settings.controls, folder, hides_talk=hides_talk))
        with extend_start_timeout(notifier, MAX_OPENING_S):
            sensors = open_sources(sources, stack, wait_for_sensor, edge_settings.sensor.power_cycle)
        is_live = any(source.sensor != "replay" for source in sources)
        if not is_live:
            edge_settings = dataclasses.replace(
                edge_settings, tracker=without_deadline(edge_settings.tracker)
            )
        with extend_start_timeout(notifier, MAX_PREPARATION_S):
            sensor = stack.enter_context(_combine_sensors(sensors, sources, edge_settings, once))
            actors, parts = prepare_actors(characters, edge_settings)
            keeper = None if kept is None else _open_keeper(kept, characters, actors, edge_settings, stack)
            if keeper is not None:
                actors = [actor for actor in actors if not keeper.is_removed(actor.character.id)]
            shapes = [actor.character for actor in actors]
            playground = _create_playground(edge_settings.physics, shapes, is_live)
        outlet = stack.enter_context(
            Outlet(
                edge_settings.wire,
                sensor.name,
                record=record,
                overwrite=overwrite,
                access=access,
                recording=edge_settings.recording,
                # An operator is told immediately that the disk is full. An unattended edge must continue to
                # perform.
                waits_for_space=notifier.is_supervised,
            )
        )
        progress = stack.enter_context(
            ProgressReporter(notifier, edge_settings.wire.name, lambda: outlet.publisher.status)
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
            progress=progress,
            keeper=keeper,
            health=HealthMonitor(edge_settings.health, fps=sensor.fps, far=edge_settings.tracker.scene.far),
        )
        if keeper is not None:
            with extend_start_timeout(notifier, MAX_PREPARATION_S):
                keeper.restore(service)
        controls.forget()
        with handle_signals(service.stop, signal.SIGINT, signal.SIGTERM):
            log.info(
                "%s listens on %s for %s", edge_settings.wire.name, outlet.publisher.endpoint, sensor.name
            )
            if outlet.tells_picture:
                log.info("%s", PRIVACY_NOTE)
            outlet.announcer = announce(
                *(edge_settings.wire, outlet.publisher.endpoint),
                has_keys=access is not None,
                characters=len(actors),
            )
            if access is not None:
                access.open_pairing()
            if viewer_timeout:
                with extend_start_timeout(notifier, viewer_timeout + 1.0):
                    service.wait_for_viewer(viewer_timeout)
            service.run()
        outlet.end(service.pace)
        log.info("%d frames, %.1f ms at the median", service.frames, service.pace.latency_ms(50))


def _open_keeper(
    folder: Path,
    choices: list[CharacterChoice],
    actors: list[Actor],
    edge_settings: EdgeSettings,
    stack: contextlib.ExitStack,
) -> StageKeeper:
    """Returns the keeper that saves the stage to disk. ``stack`` closes it.

    Args:
        actors: the initial actors, in the order of ``choices``.
    """
    from enliven_edge.kept_stage.folder import StageFolder
    from enliven_edge.kept_stage.keeper import StageKeeper

    meshes = {actor.character.id: choice.mesh for actor, (_, choice) in zip(actors, choices, strict=True)}
    return stack.enter_context(StageKeeper(StageFolder(folder), meshes, edge_settings))


def _raise_interrupt() -> None:
    """Raises KeyboardInterrupt. SIGTERM during the preparation then closes everything that was opened, like
    Ctrl-C.
    """
    raise KeyboardInterrupt


def _open_colour_estimator(
    edge_settings: EdgeSettings, stack: contextlib.ExitStack
) -> ColourPoseEstimator | None:
    """Returns the estimator of bodies from colour images, or None if the settings do not use it."""
    if not edge_settings.colour.use:
        return None
    from enliven_edge.landmarks.colour_pose import ColourPoseEstimator
    from enliven_edge.landmarks.source import MediaPipeSource

    return ColourPoseEstimator(
        stack.enter_context(MediaPipeSource(edge_settings.colour.mediapipe)), edge_settings.colour.lift
    )


def _create_playground(
    physics_settings: PhysicsSettings, characters: list[Character], is_live: bool
) -> Playground | None:
    """Returns the physics world, ready for the first frame, or None. It is deterministic for recordings."""
    if physics_settings.world == "none":
        return None
    from enliven_edge.physics.playground import Playground

    if not is_live:
        physics_settings = dataclasses.replace(
            physics_settings, engine=dataclasses.replace(physics_settings.engine, budget=0.0)
        )
    playground = Playground(physics_settings, characters)
    playground.warm_up()
    return playground


def _load_edge_settings(path: Path | None, **overrides: str | int | bool | None) -> EdgeSettings:
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


def _combine_sensors(
    sensors: dict[str, Sensor], sources: list[Source], edge_settings: EdgeSettings, once: bool
) -> Sensor:
    """Returns the single sensor, or one sensor that fuses several sensors and delivers bodies."""
    if len(sensors) == 1:
        return next(iter(sensors.values()))
    if not edge_settings.space:
        raise InputError(
            "several sensors need a file with their poses",
            where="edge",
            remedy="Run enliven calibrate ... -o space.toml. Then start the edge with --space space.toml.",
        )
    return _fuse_sensors(sources, sensors, edge_settings, once)


def _fuse_sensors(
    sources: list[Source], sensors: dict[str, Sensor], edge_settings: EdgeSettings, once: bool
) -> FusedSensors:
    """Returns a sensor that fuses several sensors and delivers bodies."""
    from enliven.space.space_file import load_space
    from enliven_edge.fusion.live.fused_sensor import FusedSensors
    from enliven_edge.fusion.live.fuser import warm_up_fusion
    from enliven_edge.fusion.live.merge import settings_before_fusion
    from enliven_edge.tracking.health.health import HealthMonitor
    from enliven_edge.tracking.tracker import Tracker

    trackers, health = {}, {}
    for source, (name, sensor) in zip(sources, sensors.items(), strict=True):
        scene = source.scene or edge_settings.tracker.scene
        trackers[name] = Tracker(
            settings_before_fusion(dataclasses.replace(edge_settings.tracker, scene=scene))
        )
        fps = sensor.fps
        health[name] = HealthMonitor(edge_settings.health, fps=fps, far=scene.far, name=name)
    warm_up_fusion()
    space = load_space(Path(edge_settings.space))
    return FusedSensors(sensors, trackers, space, edge_settings.fusion, health, once)
