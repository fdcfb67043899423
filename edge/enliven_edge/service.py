"""The edge's main loop: reads the sensor, tracks, animates and publishes until it ends or is stopped."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from enliven.arrays import Float
from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame, Frame
from enliven.health import HealthState, Severity, sort_by_severity
from enliven.supervision.lifetime import parent_is_gone
from enliven.wire import CallMessage, Order, round_to_wire
from enliven_edge.camera_preview import CameraPreview
from enliven_edge.character_upload import CharacterUploads
from enliven_edge.controls.base import Call
from enliven_edge.controls.control_set import Controls
from enliven_edge.controls.panel_protocol import Lamps, lamps_from_state
from enliven_edge.live_outputs import LiveOutputs
from enliven_edge.liveness import ProgressReporter
from enliven_edge.network.frame_rate import FrameRate
from enliven_edge.network.handlers import Handler
from enliven_edge.network.outlet import Outlet
from enliven_edge.orders import create_handlers
from enliven_edge.physics.switch import PhysicsSwitch
from enliven_edge.scans import Scans
from enliven_edge.sensors import Sensor, SensorFault
from enliven_edge.stage.initial_possession import InitialPossession
from enliven_edge.stage.sizing import HandSizing
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.tick import Tick
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker

if TYPE_CHECKING:
    from enliven_edge.kept_stage.keeper import StageKeeper

log = logging.getLogger(__name__)

_FRAME_TIMEOUT_S = 0.1
"""Seconds to wait for a frame before polling viewers and controls."""


class Edge:
    """The edge: one sensor, one tracker, one stage and one output to viewers.

    Args:
        possess_at: seconds after the first frame at which the first performer possesses a character, or None.
        parts: the body parts of that possession. Parts of several performers are separated by "/". It is one
            string for all characters, or a mapping from character id to string.
        stop_after: seconds of the sensor's clock after which the edge ends, or None.
        health: monitors the sensor and the tracking. If None, it is created.
        physics: rigid bodies among the characters, which viewers can switch on and off. If None, it is
            created.
        controls: pedals and other hardware, in addition to the viewers. The caller closes them.
        uploads: puts the characters that clients send on the stage. If None, it is created.
        scans: scans that viewers request with the sensor. If None, it is created.
        outputs: other programs that receive every frame, or None. The caller closes them.
        once: whether to end at the first fault of the sensor instead of continuing with its next good frame.
        progress: reports progress to a supervisor, or None. The caller closes it.
        keeper: saves the stage to disk. If None, it is not saved. The caller restores and closes the keeper.

    Attributes:
        handlers: the handler of each kind of order.
    """

    def __init__(
        self,
        sensor: Sensor,
        tracker: Tracker,
        stage: Stage,
        outlet: Outlet,
        *,
        possess_at: float | None = None,
        parts: str | Mapping[str, str] = "all",
        stop_after: float | None = None,
        health: HealthMonitor | None = None,
        physics: PhysicsSwitch | None = None,
        controls: Controls | None = None,
        uploads: CharacterUploads | None = None,
        scans: Scans | None = None,
        outputs: LiveOutputs | None = None,
        once: bool = False,
        progress: ProgressReporter | None = None,
        keeper: StageKeeper | None = None,
    ) -> None:
        self._keeper = keeper
        self.progress = progress or ProgressReporter()
        self.sensor, self.tracker, self.stage, self.outlet = sensor, tracker, stage, outlet
        self.health, self.physics = health or HealthMonitor(), physics or PhysicsSwitch()
        self.health.follow_device(sensor.is_device)
        self.controls = controls or Controls([])
        self.uploads, self.scans = uploads or CharacterUploads(stage), scans or Scans(stage)
        self.uploads.last_revision = outlet.publisher.last_revision
        self.sizing, self.outputs = HandSizing(stage), outputs or LiveOutputs()
        self.camera_preview = CameraPreview()
        self.pace = FrameRate()
        self.frames = 0
        self._last_frame_at = time.monotonic()
        self._initial_possession, self._stop_after = InitialPossession(stage, possess_at, parts), stop_after
        self._first_ns: int | None = None
        self._stopped, self._once = False, once
        self.handlers: dict[type[Order], Handler] = create_handlers(self)
        self._show_characters()

    def run(self) -> None:
        """Runs until the sensor's stream ends, :meth:`stop` is called, or the parent program has ended.

        Raises:
            ResourceError: at the sensor's first fault if ``once`` is set, or if the sensor was lost
                permanently.
        """
        for frame in self._frames():
            if frame is not None:
                self.step(frame)
            else:
                self._wait()
            self.poll_requests()
            self._end_iteration()
        self.scans.close()

    def _end_iteration(self) -> None:
        """Reports the end of a loop iteration, and saves changes of the stage."""
        self.progress.end_iteration()
        if self._keeper is not None:
            self._keeper.follow(self.stage.performer_count)

    def stop(self) -> None:
        """Ends :meth:`run` after the current frame. Safe to call from a signal handler."""
        self._stopped = True

    def wait_for_viewer(self, seconds: float) -> None:
        """Waits until a viewer is connected, which then receives everything. Gives up after ``seconds``."""
        deadline = time.monotonic() + seconds
        while not self.outlet.viewers and not self._stopped and not parent_is_gone():
            if time.monotonic() > deadline:
                log.warning("no viewer connected within %.0f s, so the edge starts without a viewer", seconds)
                return
            self.poll_requests()
            time.sleep(0.02)

    def step(self, frame: Frame) -> None:
        """Processes one frame: tracks, animates and publishes it. Drops a frame that is out of order."""
        read_ns, self._last_frame_at = time.monotonic_ns(), time.monotonic()
        if not self.health.admit(frame, self.sensor.fps):
            self._end_at_fault()
            self._report_health()
            return
        if self._is_over(frame):
            self.stop()
            return
        self._show_characters()
        self.tracker.output.latency = self.pace.latency_ms(50) * 1e-3
        bodies = [] if self.scans.is_active else round_to_wire(self.tracker.track(frame))
        while not self.scans.offer_frame(frame, waits=self.sensor.recorded):
            self.poll_requests()
        self.sizing.follow(bodies, frame.time_ns)
        poses = self.stage.perform(bodies, frame.time_ns, self.tracker.surfaces)
        tick = self._add_props(self.stage.tick(frame, poses, frame.read_ns or read_ns))
        self.outlet.publish(tick)
        for change in self.sizing.changes():
            self.outlet.send(change, frame.time_ns)
        self._send_preview(frame)
        self._check_health(tick)
        # Publish to live outputs last, so that their threads compute while this one waits for the next frame.
        self._publish_live(tick)

    def _publish_live(self, tick: Tick) -> None:
        """Passes the frame to the live outputs."""
        place, mirrored = self._camera_pose(tick.frame), self.tracker.settings.output.mirror
        self.outputs.publish(tick, self.stage, place, mirrored=mirrored)

    def _camera_pose(self, frame: Frame) -> Float | None:
        """Returns the (4, 4) world_from_camera of a frame, or None if it is unknown."""
        return frame.world_from_camera if isinstance(frame, BodyFrame) else self.tracker.world_from_camera

    def _send_preview(self, frame: Frame) -> None:
        """Sends viewers the camera's pose and preview image, with a limited rate."""
        place = self._camera_pose(frame)
        mirrored = self.tracker.settings.output.mirror
        if self.outlet.tells_picture and (
            message := self.camera_preview.create_message(frame, place, mirrored=mirrored)
        ):
            self.outlet.send(message, frame.time_ns)

    def _show_characters(self) -> None:
        """Puts uploaded characters on the stage.

        Informs viewers, take and physics of new, changed and removed characters.
        """
        self.uploads.poll()
        self.scans.poll(self.outlet)
        characters = self.stage.characters
        self.outlet.show(characters, self.uploads.revisions)
        self.physics.show(characters)
        if (change := self.physics.take_changed_state()) is not None:
            self.outlet.send(change, 0)

    def _add_props(self, tick: Tick) -> Tick:
        return replace(tick, props=self.physics.step(tick))

    def _check_health(self, tick: Tick) -> None:
        """Measures and checks a published frame, and reports the result in the heartbeat."""
        frame, bodies, tracker = tick.frame, tick.bodies, self.tracker
        self.pace.add_frame(tick.read_ns, time.monotonic_ns())
        self.frames += 1
        place, state = tracker.world_from_camera, tracker.state
        self.health.check_result(frame, bodies, place, state)
        condition = self.sensor.condition()
        if place is not None and state is not None:
            self.health.check_device(condition, place, state.floor_known)
            tracker.down = None if condition is None else condition.down
        self._report_health()
        self.outlet.report(self.pace, "tracking" if bodies else "watching", len(bodies), self.sensor.name)
        first = frame.time_ns if self._first_ns is None else self._first_ns
        self.progress.publish_frame(None if condition is None else condition.temperature)
        self._initial_possession.possess_if_due((frame.time_ns - first) * 1e-9)

    def _frames(self) -> Iterator[Frame | None]:
        """Yields the sensor's frames, and None if no frame arrives within the timeout."""
        while not self._stopped and not parent_is_gone():
            try:
                frame = self.sensor.read(_FRAME_TIMEOUT_S)
            except TimeoutError:
                yield None
                continue
            except (SensorFault, InputError) as error:
                self.health.record_read_error(error)
                self._end_at_fault()
                yield None
                continue
            if frame is None:
                return
            yield frame

    def _end_at_fault(self) -> None:
        """Raises the sensor's fault if ``once`` is set."""
        if self._once and self.health.fault:
            remedy = "Fix the sensor, or start without --once to continue with the next good frame."
            raise ResourceError(self.health.fault, where=self.sensor.name, remedy=remedy)

    def _is_over(self, frame: Frame) -> bool:
        """Returns True if ``stop_after`` has passed, by the sensor's clock."""
        if self._first_ns is None:
            self._first_ns = frame.time_ns
        return self._stop_after is not None and frame.time_ns - self._first_ns >= self._stop_after * 1e9

    def _wait(self) -> None:
        """Handles a wait without frames: reports a sensor that sends none."""
        self._show_characters()
        if self.sensor.is_waiting:
            self.progress.wait(self.sensor.name)
        self.health.record_silence(time.monotonic() - self._last_frame_at)
        self._report_health()

    def _report_health(self) -> None:
        """Sends the health states to viewers and live outputs."""
        states = self._health_states()
        self.outlet.set_health(states)
        self.outputs.report_health(states)

    def _health_states(self) -> list[HealthState]:
        """Returns the health states, including those that the sensor and the live outputs report."""
        return sort_by_severity(
            [*self.health.states, *self.sensor.health_states, *self.outputs.health_states]
        )

    def poll_requests(self) -> None:
        """Carries out the requests of viewers and controls. Answers a failed request with the reason."""
        self.controls.apply_commands(
            self.stage, self.carry_out, self._send_call, lambda message: self.outlet.send(message, 0)
        )
        self.controls.show(self._lamp_patterns())
        self.outlet.poll_requests(self.handlers)

    def carry_out(self, order: Order) -> None:
        """Carries out an order as if a viewer had sent it.

        Raises:
            EnlivenError: if the order is refused.
        """
        self.handlers[type(order)].apply(order)

    def _send_call(self, word: Call, control: str) -> None:
        """Sends a control's command to the windows."""
        self.outlet.send(CallMessage(word, control[:64]), 0)

    def _lamp_patterns(self) -> Lamps:
        """Returns the patterns of the controls' lamps, from the state of the stage and the health states."""
        health_states = self.outlet.publisher.status.health
        return lamps_from_state(
            is_performer_present=self.stage.has_performer,
            is_character_held=bool(self.stage.holders),
            locked=self.tracker.is_locked,
            highest_severity=max((state.severity for state in health_states), default=Severity.NOTE),
        )
