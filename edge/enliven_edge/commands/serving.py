"""Opens everything that an edge needs, runs its loop, and closes everything.

This module imports heavy modules. The command imports it only after it has read its options.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from enliven.doctor import need
from enliven.document import Character
from enliven.errors import InputError
from enliven.outputs.opening import open_outputs
from enliven.possession import Actor
from enliven.supervision.notify import Notifier
from enliven_edge.camera_preview import PRIVACY_NOTE
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.commands.preparation import prepare_actors
from enliven_edge.commands.progress import handle_signals
from enliven_edge.controls.control_set import Controls, open_controls
from enliven_edge.kept_stage.folder import StageFolder
from enliven_edge.kept_stage.keeper import StageKeeper
from enliven_edge.live_outputs import LiveOutputs
from enliven_edge.liveness import MAX_OPENING_S, MAX_PREPARATION_S, ProgressReporter, extend_start_timeout
from enliven_edge.network.access import Access
from enliven_edge.network.announcing import announce
from enliven_edge.network.outlet import Outlet, check_free
from enliven_edge.network.tcp_listener import is_local
from enliven_edge.physics.settings import PhysicsSettings
from enliven_edge.physics.switch import PhysicsSwitch
from enliven_edge.scans import Scans
from enliven_edge.sensors import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import CharacterChoice, EdgeSettings
from enliven_edge.sources import Source, open_sources
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.settings import without_deadline
from enliven_edge.tracking.tracker import Tracker

if TYPE_CHECKING:
    from enliven_edge.fusion.live.fused_sensor import FusedSensors
    from enliven_edge.landmarks.colour_pose import ColourPoseEstimator
    from enliven_edge.physics.playground import Playground

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class EdgeJob:
    """The task of an edge.

    Attributes:
        settings: its settings.
        sources: its sensors or recordings.
        characters: the characters on the stage at the start.
        access: keys and roles of viewers; None without encryption.
        folder: folder of the settings file, to which paths in it are relative.
        stage_folder: folder in which the stage is kept; None to keep nothing.
        record: file of the take; None to record none.
        overwrite: whether the take may replace an existing file.
        possess_at: seconds after the start at which the first character is possessed.
        viewer_timeout: maximum number of seconds to wait for a viewer before the start.
        stop_after: seconds after which the edge ends, by the sensor's clock.
        once: whether the edge ends at the first fault of a sensor.
        wait_for_sensor: whether to wait for a camera that is not connected.
    """

    settings: EdgeSettings
    sources: list[Source]
    characters: list[CharacterChoice]
    access: Access | None
    folder: Path | None = None
    stage_folder: Path | None = None
    record: Path | None = None
    overwrite: bool = False
    possess_at: float | None = None
    viewer_timeout: float = 0.0
    stop_after: float | None = None
    once: bool = False
    wait_for_sensor: bool = False

    @property
    def is_live(self) -> bool:
        """Returns True if a source is a camera, which does not wait for the edge."""
        return any(source.sensor != "replay" for source in self.sources)


def serve(job: EdgeJob) -> None:
    """Opens the sensors and the stage, runs the loop, and closes everything."""
    wire = job.settings.wire
    if job.settings.physics.world != "none":
        need("mujoco", "physics", "--physics")
    check_free(wire, job.access)
    outputs = LiveOutputs(open_outputs(job.settings.outputs, job.folder, insecure=wire.insecure))
    notifier = Notifier()
    with outputs, handle_signals(_raise_interrupt, signal.SIGTERM), contextlib.ExitStack() as stack:
        controls = stack.enter_context(
            open_controls(
                job.settings.controls, job.folder, hides_talk=wire.insecure or not is_local(wire.host)
            )
        )
        service, outlet = _open_service(job, outputs, controls, notifier, stack)
        controls.forget()
        with handle_signals(service.stop, signal.SIGINT, signal.SIGTERM):
            _announce(job, service, outlet)
            if job.viewer_timeout:
                with extend_start_timeout(notifier, job.viewer_timeout + 1.0):
                    service.wait_for_viewer(job.viewer_timeout)
            service.run()
        outlet.end(service.pace)
        log.info("%d frames, %.1f ms at the median", service.frames, service.pace.latency_ms(50))


def _open_service(
    job: EdgeJob,
    outputs: LiveOutputs,
    controls: Controls,
    notifier: Notifier,
    stack: contextlib.ExitStack,
) -> tuple[Edge, Outlet]:
    """Opens sensors, characters and network. Returns the loop and its outlet. ``stack`` closes them."""
    with extend_start_timeout(notifier, MAX_OPENING_S):
        power_cycle = job.settings.sensor.power_cycle
        sensors = open_sources(job.sources, stack, job.wait_for_sensor, power_cycle)
    if not job.is_live:
        tracker = without_deadline(job.settings.tracker)
        job = dataclasses.replace(job, settings=dataclasses.replace(job.settings, tracker=tracker))
    settings = job.settings
    with extend_start_timeout(notifier, MAX_PREPARATION_S):
        sensor = stack.enter_context(_combine_sensors(sensors, job))
        actors, parts = prepare_actors(job.characters, settings)
        keeper = _open_keeper(job, actors, stack)
        if keeper is not None:
            actors = [actor for actor in actors if not keeper.is_removed(actor.character.id)]
        playground = _create_playground(settings.physics, [actor.character for actor in actors], job.is_live)
    outlet = stack.enter_context(
        Outlet(
            settings.wire,
            sensor.name,
            record=job.record,
            overwrite=job.overwrite,
            access=job.access,
            recording=settings.recording,
            # An operator is told immediately that the disk is full. An unattended edge must continue to
            # perform.
            waits_for_space=notifier.is_supervised,
        )
    )
    progress = stack.enter_context(
        ProgressReporter(notifier, settings.wire.name, lambda: outlet.publisher.status)
    )
    stage = Stage(actors, settings.stage)
    outputs.check(stage)
    service = Edge(
        sensor,
        Tracker(settings.tracker, _open_colour_estimator(settings, stack)),
        stage,
        outlet,
        uploads=CharacterUploads(stage, settings),
        scans=Scans(stage, settings),
        possess_at=job.possess_at,
        parts=parts,
        stop_after=job.stop_after,
        physics=PhysicsSwitch(settings.physics, live=job.is_live, playground=playground),
        controls=controls,
        outputs=outputs,
        once=job.once,
        progress=progress,
        keeper=keeper,
        health=HealthMonitor(settings.health, fps=sensor.fps, far=settings.tracker.scene.far),
    )
    if keeper is not None:
        with extend_start_timeout(notifier, MAX_PREPARATION_S):
            keeper.restore(service)
    return service, outlet


def _announce(job: EdgeJob, service: Edge, outlet: Outlet) -> None:
    """Reports that the edge listens, in the log and on the network."""
    wire, endpoint = job.settings.wire, outlet.publisher.endpoint
    log.info("%s listens on %s for %s", wire.name, endpoint, service.sensor.name)
    if outlet.tells_picture:
        log.info("%s", PRIVACY_NOTE)
    outlet.announcer = announce(
        wire, endpoint, has_keys=job.access is not None, characters=len(service.stage.actors)
    )
    if job.access is not None:
        job.access.open_pairing()


def _open_keeper(job: EdgeJob, actors: list[Actor], stack: contextlib.ExitStack) -> StageKeeper | None:
    """Returns the keeper that saves the stage to disk, or None if nothing is kept. ``stack`` closes it.

    Args:
        actors: the initial actors, in the order of the job's characters.
    """
    if job.stage_folder is None:
        return None
    choices = zip(actors, job.characters, strict=True)
    meshes = {actor.character.id: choice.mesh for actor, (_, choice) in choices}
    return stack.enter_context(StageKeeper(StageFolder(job.stage_folder), meshes, job.settings))


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


def _combine_sensors(sensors: dict[str, Sensor], job: EdgeJob) -> Sensor:
    """Returns the single sensor, or one sensor that fuses several sensors and delivers bodies."""
    if len(sensors) == 1:
        return next(iter(sensors.values()))
    if not job.settings.space:
        raise InputError(
            "several sensors need a file with their poses",
            where="edge",
            remedy="Run enliven calibrate ... -o space.toml. Then start the edge with --space space.toml.",
        )
    return _fuse_sensors(sensors, job)


def _fuse_sensors(sensors: dict[str, Sensor], job: EdgeJob) -> FusedSensors:
    """Returns a sensor that fuses several sensors and delivers bodies."""
    from enliven.space.space_file import load_space
    from enliven_edge.fusion.live.fused_sensor import FusedSensors
    from enliven_edge.fusion.live.fuser import warm_up_fusion
    from enliven_edge.fusion.live.merge import settings_before_fusion

    settings = job.settings
    trackers, health = {}, {}
    for source, (name, sensor) in zip(job.sources, sensors.items(), strict=True):
        scene = source.scene or settings.tracker.scene
        trackers[name] = Tracker(settings_before_fusion(dataclasses.replace(settings.tracker, scene=scene)))
        health[name] = HealthMonitor(settings.health, fps=sensor.fps, far=scene.far, name=name)
    warm_up_fusion()
    space = load_space(Path(settings.space))
    return FusedSensors(sensors, trackers, space, settings.fusion, health, job.once)
