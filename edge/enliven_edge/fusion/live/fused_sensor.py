"""Several sensors in one space that are read like one sensor. Its frames are bodies."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping

from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame
from enliven.health import HealthKind, HealthState, Severity, sort_by_severity
from enliven.space.space_file import Space
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import ArrivalClocks, OutputSchedule, sensor_positions
from enliven_edge.fusion.live.sensor_thread import SensorBodies, TrackingThread
from enliven_edge.fusion.live.sensor_view import SensorState, SensorWarning
from enliven_edge.fusion.settings import FusionSettings
from enliven_edge.sensors import Sensor
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker

log = logging.getLogger(__name__)

_SEVERITY = {
    SensorState.MOVED: (
        HealthKind.MOVED,
        Severity.WARNING,
        "Calibrate the sensors again: enliven calibrate.",
    ),
    SensorState.LOST: (HealthKind.NO_FRAMES, Severity.WARNING, "Start the edge again."),
    SensorState.SILENT: (HealthKind.NO_FRAMES, Severity.WARNING, "Check the cable of the sensor."),
}
"""Kind, severity and remedy of the health message of each sensor state. No severity is above a warning,
because the other sensors continue."""


class FusedSensors(Sensor):
    """One sensor that combines several. A thread per sensor reads and tracks it, and ``read`` fuses the
    bodies.

    Bodies of live sensors are fused as they arrive. Recordings wait for one another, so that they stay
    synchronised at any playback speed. The stream ends when the last sensor ends.

    Args:
        sensors: the opened sensors by identity. They are closed together with this one.
        trackers: the tracker of each sensor, by identity.
        space: the pose of each sensor.
        settings: the settings of the fusion.
        health: the health monitor of each sensor, by identity. If None, they are created.
        once: whether to end at the first fault of any sensor. If False, a faulty sensor is reopened while the
            others continue.

    Raises:
        InputError: if the space does not contain a sensor.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        trackers: Mapping[str, Tracker],
        space: Space,
        settings: FusionSettings | None = None,
        health: Mapping[str, HealthMonitor] | None = None,
        once: bool = False,
    ) -> None:
        health = health or {name: HealthMonitor(name=name) for name in sensors}
        self._devices = {name for name, sensor in sensors.items() if sensor.is_device}
        for name, monitor in health.items():
            monitor.follow_device(name in self._devices)
        _check_space(sensors, space)
        self.name = " + ".join(sensors)
        self._once = once
        self._camera = next(iter(space.sensors[name].camera for name in sensors))
        self.fuser = Fuser({n: e for n, e in sensor_positions(space).items() if n in sensors}, settings)
        self.warnings: list[SensorWarning] = []
        self._changed = threading.Condition()
        self._threads = [
            TrackingThread(
                name, sensor, trackers[name], space.sensors[name], health[name], self._changed, once
            )
            for name, sensor in sensors.items()
        ]
        self._schedule_retry = OutputSchedule()
        self._clocks = ArrivalClocks()
        self._gone: set[str] = set()
        self._last: dict[str, SensorWarning] = {}
        self._now_ns = 0
        self._started = False

    @property
    def states(self) -> dict[str, SensorState]:
        """Returns the state of every sensor."""
        return {view.name: view.state for view in self.fuser.views}

    @property
    def health_states(self) -> list[HealthState]:
        """Returns the health states of all sensors and of their poses, the most severe first."""
        health_states = [state for thread in self._threads for state in thread.health_states]
        for warning in self._last.values():
            if warning.state in _SEVERITY:
                kind, gravity, remedy = _SEVERITY[warning.state]
                if warning.sensor not in self._devices and warning.state is SensorState.SILENT:
                    remedy = _SEVERITY[SensorState.LOST][2]
                health_states.append(HealthState(kind, gravity, warning.time_ns, f"{warning.what}.", remedy))
        return sort_by_severity(health_states)

    @property
    def is_waiting(self) -> bool:
        """Returns True if each sensor is waiting or has ended."""
        return all(thread.ended or thread.sensor.is_waiting for thread in self._threads)

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next fused bodies when they are due. The first call starts the threads.

        Returns None if all sensors have ended.

        Raises:
            TimeoutError: if no sensor sent a frame in time.
            ResourceError: if all sensors were lost, or one of them with ``once``.
        """
        if not self._started:
            self._started = True
            for thread in self._threads:
                thread.start()
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            sensor_bodies = self._wait_for_bodies(deadline)
            if sensor_bodies is None:
                self._check_all_lost()
                return None
            frame = self._fuse(sensor_bodies)
            if frame is not None:
                return frame

    def learn_room(self) -> None:
        """Makes all sensors that measure depth learn the room again. Does not wait for the result."""
        for thread in self._threads:
            thread.learn_room()

    def close(self) -> None:
        """Stops the thread of each sensor and closes the sensor."""
        for thread in self._threads:
            thread.stop()

    def _wait_for_bodies(self, deadline: float | None) -> SensorBodies | None:
        """Returns the next bodies of any sensor, or None when all sensors have ended."""
        with self._changed:
            while True:
                self._report_ended()
                if len(self._gone) == len(self._threads):
                    return None
                thread = self._next_thread()
                if thread is not None:
                    sensor_bodies = thread.seen.popleft()
                    self._changed.notify_all()
                    return sensor_bodies
                wait = None if deadline is None else deadline - time.monotonic()
                if wait is not None and wait <= 0:
                    raise TimeoutError("no sensor sent a frame in time")
                self._changed.wait(wait)

    def _next_thread(self) -> TrackingThread | None:
        """Returns the sensor with the oldest bodies. Recordings are considered only when each of them has
        bodies.
        """
        live_threads = [w for w in self._threads if w.seen and not w.recorded]
        recordings = [w for w in self._threads if w.recorded and w.name not in self._gone]
        candidates = live_threads + (recordings if all(w.seen for w in recordings) else [])
        return min(candidates, key=lambda w: self._convert_to_common_clock(w.seen[0]), default=None)

    def _report_ended(self) -> None:
        """Reports sensors that have ended to the fuser, once all their bodies have been fused."""
        for thread in self._threads:
            if thread.ended and not thread.seen and thread.name not in self._gone:
                self._gone.add(thread.name)
                state = SensorState.LOST if thread.failure else SensorState.ENDED
                self.fuser.end(thread.name, state, self._now_ns)
                self._log_warnings(thread.failure)
                if self._once and thread.failure:
                    raise ResourceError(
                        thread.failure, where=self.name, remedy="Fix the sensor, or start without --once."
                    )

    def _fuse(self, sensor_bodies: SensorBodies) -> BodyFrame | None:
        """Passes a sensor's bodies to the fuser. Returns the fused bodies when they are due."""
        if not next(w.recorded for w in self._threads if w.name == sensor_bodies.sensor):
            self._clocks.record_arrival(sensor_bodies.sensor, sensor_bodies.time_ns, sensor_bodies.read_ns)
        time_ns = self._convert_to_common_clock(sensor_bodies)
        self.fuser.update(sensor_bodies.sensor, sensor_bodies.bodies, time_ns, frozen=sensor_bodies.frozen)
        self._now_ns = max(self._now_ns, time_ns)
        is_due = self._schedule_retry.is_due(sensor_bodies.sensor, time_ns)
        bodies = self.fuser.bodies(time_ns) if is_due else []
        self._log_warnings()
        return BodyFrame(bodies, time_ns, self.name, self._camera, sensor_bodies.read_ns) if is_due else None

    def _convert_to_common_clock(self, sensor_bodies: SensorBodies) -> int:
        return sensor_bodies.time_ns + self._clocks.shift(sensor_bodies.sensor)

    def _log_warnings(self, reason: str = "") -> None:
        for warning in self.fuser.take_warnings():
            self.warnings = [*self.warnings[-99:], warning]
            self._last[warning.sensor] = warning
            level = warning.state in (SensorState.LIVE, SensorState.ENDED)
            text = f"{warning.what} ({reason})" if reason else warning.what
            log.log(logging.INFO if level else logging.WARNING, "%s", text)

    def _check_all_lost(self) -> None:
        failures = [w.failure for w in self._threads if w.failure]
        if len(failures) == len(self._threads):
            raise ResourceError(
                "the connections to all sensors were lost", where=self.name, remedy=failures[0]
            )


def _check_space(sensors: Mapping[str, Sensor], space: Space) -> None:
    """Raises InputError unless the space has a pose for each sensor."""
    for name in sensors:
        if name not in space.sensors:
            raise InputError(
                f"the space file contains no pose of the sensor {name!r}",
                where="fusion",
                remedy=f"Sensors in the file: {', '.join(space.sensors)}. Calibrate all sensors together: "
                "enliven calibrate.",
            )
