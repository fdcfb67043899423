"""One of several sensors in its own thread: reads frames, tracks people and queues the bodies."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass

from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame, Frame
from enliven.health import HealthKind, HealthState
from enliven.person import Body
from enliven.space.space_file import Place
from enliven_edge.fusion.live.merge import transform_bodies
from enliven_edge.sensors import Sensor, SensorFault
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker

log = logging.getLogger(__name__)

READ_TIMEOUT_S = 0.1
"""Seconds to wait for a frame before checking whether to stop."""


class SensorThread(ABC):
    """A worker thread that runs :meth:`_read` for one sensor.

    A failure is stored for the user, and the other sensors continue.

    Attributes:
        ended: whether no more frames will arrive.
        failure: the reason of the end, if it was a failure.
        recorded: whether it is a recording. If so, its frames may wait for the frames of other sensors.
    """

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.name, self.sensor = name, sensor
        self.ended, self.failure = False, ""
        self.recorded = sensor.recorded
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sensor {name}", daemon=True)

    def start(self) -> None:
        """Starts to read."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        try:
            self._read()
        except Exception as error:
            self.failure = str(error) or "the reason is unknown"
            log.debug("sensor %s failed", self.name, exc_info=True)
        self._end()

    @abstractmethod
    def _read(self) -> None:
        """Reads until the end, or until :attr:`_stopped` is set."""

    def _end(self) -> None:
        self.ended = True


_MAX_QUEUED = 2
"""Maximum number of queued sets of bodies. So the sensor is read no faster than its bodies are fused."""


@dataclass(frozen=True)
class SensorBodies:
    """The bodies of one sensor at one moment.

    Attributes:
        bodies: the bodies in the world frame.
        time_ns: time of the bodies on the common clock.
        read_ns: time of the monotonic clock at which the frame was read.
        frozen: whether the sensor's frames have been bitwise identical for a while.
    """

    sensor: str
    bodies: list[Body]
    time_ns: int
    read_ns: int
    frozen: bool


class TrackingThread(SensorThread):
    """Reads and tracks one sensor until it ends, fails, or is stopped.

    Args:
        name: the sensor's identity in the space.
        sensor: the sensor.
        tracker: its tracker.
        place: the sensor's pose.
        health: the health monitor of the sensor.
        changed: the condition that is notified after every change.
        once: whether to end at the sensor's first fault. If False, it continues with the next good frame.

    Attributes:
        health_states: the sensor's current health states, the most severe first.
        seen: the queued bodies, the oldest first; guarded by ``changed``.
    """

    def __init__(
        self,
        name: str,
        sensor: Sensor,
        tracker: Tracker,
        place: Place,
        health: HealthMonitor,
        changed: threading.Condition,
        once: bool = False,
    ) -> None:
        super().__init__(name, sensor)
        self.place = place
        self.seen: deque[SensorBodies] = deque()
        self.health_states: list[HealthState] = []
        self._tracker, self._health, self._changed = tracker, health, changed
        self._once = once
        self._learns_room = threading.Event()

    def learn_room(self) -> None:
        """Makes the tracker learn the room again from the next frame on. Does not wait for the result."""
        self._learns_room.set()

    def stop(self) -> None:
        """Ends the thread, also while it waits for space in its queue, and closes the sensor.

        A thread that hangs in a driver is abandoned after five seconds.
        """
        self._stopped.set()
        with self._changed:
            self._changed.notify_all()
        super().stop()
        self.sensor.close()

    def _end(self) -> None:
        with self._changed:
            self.ended = True
            self._changed.notify_all()

    def _read(self) -> None:
        last_frame_at = time.monotonic()
        while not self._stopped.is_set():
            try:
                frame = self.sensor.read(READ_TIMEOUT_S)
            except TimeoutError:
                self._health.record_silence(time.monotonic() - last_frame_at)
                self.health_states = self._health.states
                continue
            except (SensorFault, InputError) as error:
                self._health.record_read_error(error)
                self._health.record_silence(time.monotonic() - last_frame_at)
                self._end_at_fault()
                self.health_states = self._health.states
                continue
            if frame is None:
                return
            last_frame_at, read_ns = time.monotonic(), time.monotonic_ns()
            accepted = self._health.admit(frame, self.sensor.fps)
            self._end_at_fault()
            if accepted:
                bodies = self._bodies(frame)
                frozen = any(state.kind == HealthKind.FROZEN for state in self._health.states)
                time_ns = frame.time_ns + self.place.clock_offset_ns
                self._queue_bodies(SensorBodies(self.name, bodies, time_ns, read_ns, frozen))
            self.health_states = self._health.states

    def _end_at_fault(self) -> None:
        """Raises ResourceError after a fault if ``once`` is set."""
        if self._once and self._health.fault:
            raise ResourceError(self._health.fault, where=f"sensor {self.name}")

    def _queue_bodies(self, sensor_bodies: SensorBodies) -> None:
        """Queues bodies after waiting for room, so that a recording is not read faster than it is used."""
        with self._changed:
            while len(self.seen) >= _MAX_QUEUED and not self._stopped.is_set():
                self._changed.wait(READ_TIMEOUT_S)
            self.seen.append(sensor_bodies)
            self._changed.notify_all()

    def _bodies(self, frame: Frame) -> list[Body]:
        """Returns the people of a frame in the world frame."""
        if isinstance(frame, BodyFrame):
            self._health.check_result(frame, frame.bodies)
            return transform_bodies(frame.bodies, self.place.level)
        camera = self.place.camera
        if camera is None:
            raise InputError(
                "the sensor sends depth images, but was calibrated with bodies",
                where=f"sensor {self.name}",
                remedy="Calibrate again with this sensor: enliven calibrate.",
            )
        if self._learns_room.is_set():
            self._learns_room.clear()
            self._tracker.learn_room()
        bodies = self._tracker.track(dataclasses.replace(frame, world_from_camera=camera))
        self._health.check_result(frame, bodies, camera, self._tracker.state)
        self._health.check_device(self.sensor.condition(), camera, floor_known=True)
        return bodies
