"""enliven edge: the program beside the camera."""

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

from enliven.commands import known_parts
from enliven.errors import InputError
from enliven.files import need_folder
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
            callback=known_parts,
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
    """
    _one_thread_for_matrices()
    need_folder(record)
    from enliven_edge.network import open_access, raise_descriptor_limit
    from enliven_edge.physics import PhysicsSettings
    from enliven_edge.settings import characters_of

    chosen = _settings(
        settings, name=name, host=host, port=port, control_port=control_port, insecure=insecure
    )
    access = open_access(chosen.wire)
    raise_descriptor_limit()
    if up is not None:
        chosen = dataclasses.replace(chosen, up=up)
    if physics is not None:
        world = load_settings(PhysicsSettings, {"world": physics}, where="--physics").world
        chosen = dataclasses.replace(chosen, physics=dataclasses.replace(chosen.physics, world=world))
    characters = characters_of(mesh or [], drive or [], parts or [], chosen.characters)
    folder = settings.parent if settings else None
    source = _sources(sensor or [], recording or [], option or [], speed, loop, chosen, folder)
    if space is not None:
        chosen = dataclasses.replace(chosen, space=str(space))
    elif chosen.space and folder is not None:
        chosen = dataclasses.replace(chosen, space=str(folder / chosen.space))
    run = (characters, possess_at, record, overwrite, wait_for_viewer, seconds)
    serve(chosen, source, run, folder, once, wait_for_sensor, access)


def _one_thread_for_matrices() -> None:
    """NumPy's and SciPy's matrix library starts no threads: matrices here are small, and idle threads spin.

    Measured: 0.1 s of processor time a start. A number that the user has set stays.
    """
    if "numpy" not in sys.modules:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def serve(
    chosen: EdgeSettings,
    sources: list[Source],
    run: tuple[list[CharacterChoice], float | None, Path | None, bool, float, float | None],
    folder: Path | None = None,
    once: bool = False,
    wait_for_sensor: bool = False,
    access: Access | None = None,
) -> None:
    """Opens everything, runs the loop, and closes everything; heavy modules are imported only here."""
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.commands.preparation import prepared
    from enliven_edge.commands.progress import at_signals
    from enliven_edge.controls import open_controls
    from enliven_edge.extras import need
    from enliven_edge.network import Outlet, is_local, need_free
    from enliven_edge.physics import PhysicsSwitch
    from enliven_edge.scans import Scans
    from enliven_edge.service import Edge
    from enliven_edge.sources import opened
    from enliven_edge.stage import Stage
    from enliven_edge.tracking import Tracker, without_deadline
    from enliven_edge.tracking.health import HealthMonitor

    characters, possess_at, record, overwrite, wait, seconds = run
    if chosen.physics.world != "none":
        need("mujoco", "physics", "--physics")
    need_free(chosen.wire, access)
    with at_signals(_interrupt, signal.SIGTERM), contextlib.ExitStack() as stack:
        hides_talk = chosen.wire.insecure or not is_local(chosen.wire.host)
        controls = stack.enter_context(open_controls(chosen.controls, folder, hides_talk=hides_talk))
        sensors = opened(sources, stack, wait_for_sensor)
        live = any(source.sensor != "replay" for source in sources)
        if not live:
            chosen = dataclasses.replace(chosen, tracker=without_deadline(chosen.tracker))
        sensor = stack.enter_context(_one_of(sensors, sources, chosen, once))
        actors, parts = prepared(characters, chosen)
        playground = _playground(chosen.physics, [actor.character for actor in actors], live)
        outlet = stack.enter_context(
            Outlet(chosen.wire, sensor.name, record=record, overwrite=overwrite, access=access)
        )
        stage = Stage(actors, chosen.stage)
        service = Edge(
            sensor,
            Tracker(chosen.tracker, _colour_eye(chosen, stack)),
            stage,
            outlet,
            uploads=CharacterUploads(stage, chosen),
            scans=Scans(stage, chosen),
            possess_at=possess_at,
            parts=parts,
            stop_after=seconds,
            physics=PhysicsSwitch(chosen.physics, live=live, playground=playground),
            controls=controls,
            once=once,
            health=HealthMonitor(
                chosen.health, fps=getattr(sensor, "fps", None), far=chosen.tracker.scene.far
            ),
        )
        controls.forget()
        with at_signals(service.stop, signal.SIGINT, signal.SIGTERM):
            log.info("%s listens on %s for %s", chosen.wire.name, outlet.publisher.endpoint, sensor.name)
            if access is not None:
                access.begin()
            if wait:
                service.wait_for_viewer(wait)
            service.run()
        outlet.end(service.pace)
        log.info("%d frames, %.1f ms at the median", service.frames, service.pace.latency_ms(50))


def _interrupt() -> None:
    """Ends the preparation at SIGTERM as Ctrl-C does: what was opened is closed."""
    raise KeyboardInterrupt


def _colour_eye(chosen: EdgeSettings, stack: contextlib.ExitStack) -> ColourPoseEstimator | None:
    """Returns the source of colour landmarks, where the settings ask for one."""
    if not chosen.colour.use:
        return None
    from enliven_edge.landmarks import ColourPoseEstimator, MediaPipeSource

    return ColourPoseEstimator(
        stack.enter_context(MediaPipeSource(chosen.colour.mediapipe)), chosen.colour.lift
    )


def _playground(chosen: PhysicsSettings, characters: list[Character], live: bool) -> Playground | None:
    """Returns the physics, ready for the first frame, or None; a recording gives the same each time."""
    if chosen.world == "none":
        return None
    from enliven_edge.physics import Playground

    if not live:
        chosen = dataclasses.replace(chosen, engine=dataclasses.replace(chosen.engine, budget=0.0))
    playground = Playground(chosen, characters)
    playground.warm_up()
    return playground


def _settings(path: Path | None, **overrides: str | int | bool | None) -> EdgeSettings:
    """Returns the settings of the file, overridden by the command line's."""
    from enliven_edge.settings import EdgeSettings, WireSettings

    loaded = load_settings(EdgeSettings, path) if path else EdgeSettings()
    given = {key: value for key, value in overrides.items() if value is not None}
    port = given.get("port")
    if isinstance(port, int) and "control_port" not in given:
        given["control_port"] = port + 1 if port else 0
    wire = load_settings(WireSettings, {**vars(loaded.wire), **given}, where="command line")
    return dataclasses.replace(loaded, wire=wire)


def _sources(
    sensors: list[str],
    recordings: list[str],
    options: list[str],
    speed: float,
    loop: bool,
    chosen: EdgeSettings,
    folder: Path | None,
) -> list[Source]:
    """Returns the sources of the command line, else of the settings, else the shipped recording."""
    from enliven_edge.doctor import shipped_recording
    from enliven_edge.sensors import sensor_options
    from enliven_edge.sources import source_of, sources_of

    if len(sensors) == 1 and len(recordings) == 1:
        raise typer.BadParameter("give a sensor or a recording, not both")
    replay = {"speed": speed, "loop": loop}
    words = [*sensors, *recordings]
    if not words and chosen.sensors:
        return sources_of(chosen.sensors, folder)
    words = words or [str(shipped_recording())]
    return [source_of(word, sensor_options(options), replay) for word in words]


def _one_of(sensors: dict[str, Sensor], sources: list[Source], chosen: EdgeSettings, once: bool) -> Sensor:
    """Returns the one sensor; several are fused into one that delivers bodies."""
    if len(sensors) == 1:
        return next(iter(sensors.values()))
    if not chosen.space:
        raise InputError(
            "the places of several sensors must be known",
            where="edge",
            mend="Run enliven calibrate ... -o space.toml, and give --space space.toml.",
        )
    return _fused(sources, sensors, chosen, once)


def _fused(
    sources: list[Source], sensors: dict[str, Sensor], chosen: EdgeSettings, once: bool
) -> FusedSensors:
    """Returns several sensors as one."""
    from enliven_edge.fusion.live import FusedSensors, settings_before_fusion, warm_up_fusion
    from enliven_edge.fusion.placement import load_space
    from enliven_edge.tracking import Tracker
    from enliven_edge.tracking.health import HealthMonitor

    trackers, health = {}, {}
    for source, (name, sensor) in zip(sources, sensors.items(), strict=True):
        scene = source.scene or chosen.tracker.scene
        trackers[name] = Tracker(settings_before_fusion(dataclasses.replace(chosen.tracker, scene=scene)))
        fps = getattr(sensor, "fps", None)
        health[name] = HealthMonitor(chosen.health, fps=fps, far=scene.far, name=name)
    warm_up_fusion()
    space = load_space(Path(chosen.space))
    return FusedSensors(sensors, trackers, space, chosen.fusion, health, once)
