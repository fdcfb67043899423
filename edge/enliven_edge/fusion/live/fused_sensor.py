"""Several sensors in one space that are read like one sensor. Its frames are bodies."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping

from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame
from enliven.health import HealthKind, HealthState, Severity, sort_by_severity
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import ArrivalClocks, OutputSchedule, eyes
from enliven_edge.fusion.live.sensor_thread import SensorBodies, TrackingThread
from enliven_edge.fusion.live.sensor_view import SensorState, SensorWarning
from enliven_edge.fusion.placement import Space
from enliven_edge.fusion.settings import FusionSettings
from enliven_edge.sensors import Sensor, is_device
from enliven_edge.tracking import Tracker
from enliven_edge.tracking.health import HealthMonitor

log = logging.getLogger(__name__)

_SEVERITY = {
    SensorState.MOVED: (HealthKind.MOVED, Severity.WARNING, "Calibrate again: enliven calibrate."),
    SensorState.LOST: (HealthKind.NO_FRAMES, Severity.WARNING, "Start the edge again."),
    SensorState.SILENT: (HealthKind.NO_FRAMES, Severity.WARNING, "Check its cable."),
}
"""Kind, severity and remedy of the health message of each sensor state. None is worse than a warning, because
the other sensors continue."""


class FusedSensors(Sensor):
    """One sensor made of several. A thread for each reads and tracks it, and ``read`` fuses their bodies.

    Bodies of live sensors are fused as they arrive. Recordings wait for one another, so that they stay
    synchronised by the common clock at any pace. The stream ends when the last sensor ends.

    Args:
        sensors: the opened sensors by identity; they are closed with this one.
        trackers: the tracker of each sensor, by identity.
        space: the pose of each sensor.
        settings: the settings of the fusion.
        health: the health monitor of each sensor, by identity; None creates them.
        once: end at the first fault of any sensor; otherwise it is reopened while the others continue.

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
        self._devices = {name for name, sensor in sensors.items() if is_device(sensor)}
        for name, monitor in health.items():
            monitor.follow_device(name in self._devices)
        _known(sensors, space)
        self.name = " + ".join(sensors)
        self._once = once
        self._camera = next(iter(space.sensors[name].camera for name in sensors))
        self.fuser = Fuser({n: e for n, e in eyes(space).items() if n in sensors}, settings)
        self.warnings: list[SensorWarning] = []
        self._changed = threading.Condition()
        self._watchers = [
            TrackingThread(
                name, sensor, trackers[name], space.sensors[name], health[name], self._changed, once
            )
            for name, sensor in sensors.items()
        ]
        self._rhythm = OutputSchedule()
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
        health_states = [state for watcher in self._watchers for state in watcher.health_states]
        for warning in self._last.values():
            if warning.state in _SEVERITY:
                kind, gravity, mend = _SEVERITY[warning.state]
                if warning.sensor not in self._devices and warning.state is SensorState.SILENT:
                    mend = _SEVERITY[SensorState.LOST][2]
                health_states.append(HealthState(kind, gravity, warning.time_ns, f"{warning.what}.", mend))
        return sort_by_severity(health_states)

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        if not self._started:
            self._started = True
            for watcher in self._watchers:
                watcher.start()
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            seen = self._take(deadline)
            if seen is None:
                self._check_all_lost()
                return None
            frame = self._fused(seen)
            if frame is not None:
                return frame

    def close(self) -> None:
        for watcher in self._watchers:
            watcher.stop()

    def _take(self, deadline: float | None) -> SensorBodies | None:
        """Returns the next bodies of any sensor, or None when all have ended."""
        with self._changed:
            while True:
                self._report_ended()
                if len(self._gone) == len(self._watchers):
                    return None
                ready = self._ready()
                if ready is not None:
                    seen = ready.seen.popleft()
                    self._changed.notify_all()
                    return seen
                wait = None if deadline is None else deadline - time.monotonic()
                if wait is not None and wait <= 0:
                    raise TimeoutError("no sensor had a frame in time")
                self._changed.wait(wait)

    def _ready(self) -> TrackingThread | None:
        """Returns the sensor with the oldest bodies. Recordings count only when each of them has some."""
        live = [w for w in self._watchers if w.seen and not w.recorded]
        recordings = [w for w in self._watchers if w.recorded and w.name not in self._gone]
        turn = live + (recordings if all(w.seen for w in recordings) else [])
        return min(turn, key=lambda w: self._common(w.seen[0]), default=None)

    def _report_ended(self) -> None:
        """Reports sensors that have ended to the fuser, once all their bodies were fused."""
        for watcher in self._watchers:
            if watcher.ended and not watcher.seen and watcher.name not in self._gone:
                self._gone.add(watcher.name)
                state = SensorState.LOST if watcher.failure else SensorState.ENDED
                self.fuser.end(watcher.name, state, self._now_ns)
                self._tell(watcher.failure)
                if self._once and watcher.failure:
                    raise ResourceError(watcher.failure, where=self.name, mend="Fix it, or leave out --once.")

    def _fused(self, seen: SensorBodies) -> BodyFrame | None:
        """Passes a sensor's bodies to the fuser. Returns the fused bodies when they are due."""
        if not next(w.recorded for w in self._watchers if w.name == seen.sensor):
            self._clocks.note(seen.sensor, seen.time_ns, seen.read_ns)
        time_ns = self._common(seen)
        self.fuser.update(seen.sensor, seen.bodies, time_ns, frozen=seen.frozen)
        self._now_ns = max(self._now_ns, time_ns)
        due = self._rhythm.due(seen.sensor, time_ns)
        bodies = self.fuser.bodies(time_ns) if due else []
        self._tell()
        return BodyFrame(bodies, time_ns, self.name, self._camera, seen.read_ns) if due else None

    def _common(self, seen: SensorBodies) -> int:
        return seen.time_ns + self._clocks.shift(seen.sensor)

    def _tell(self, why: str = "") -> None:
        for warning in self.fuser.take_warnings():
            self.warnings = [*self.warnings[-99:], warning]
            self._last[warning.sensor] = warning
            quiet = warning.state in (SensorState.LIVE, SensorState.ENDED)
            text = f"{warning.what} ({why})" if why else warning.what
            log.log(logging.INFO if quiet else logging.WARNING, "%s", text)

    def _check_all_lost(self) -> None:
        failures = [w.failure for w in self._watchers if w.failure]
        if len(failures) == len(self._watchers):
            raise ResourceError("every sensor was lost", where=self.name, mend=failures[0])


def _known(sensors: Mapping[str, Sensor], space: Space) -> None:
    """Raises InputError unless the space has a pose for each sensor."""
    for name in sensors:
        if name not in space.sensors:
            raise InputError(
                f"the space does not know the sensor {name!r}",
                where="fusion",
                mend=f"Known: {', '.join(space.sensors)}. Calibrate them together: enliven calibrate.",
            )
