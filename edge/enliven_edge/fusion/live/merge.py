"""Merges several sensors' body frames into one stream on the common clock, at the fastest sensor's rate."""

from __future__ import annotations

import dataclasses

import numpy as np

from enliven.arrays import Float
from enliven.person import Body
from enliven.rotation import from_matrix, multiply
from enliven_edge.fusion.placement import Space, moved
from enliven_edge.tracking import TrackerSettings

_MISSED = 1.7
"""Frame intervals by which the leading sensor may be late before another one leads."""
_FASTER = 0.8
"""Share of the leading sensor's frame interval below which another sensor's interval makes it lead."""


class OutputSchedule:
    """Decides when fused bodies are sent: with the frames of the fastest sensor, as long as it has some."""

    def __init__(self) -> None:
        self._steps: dict[str, float] = {}
        self._last: dict[str, int] = {}
        self._lead: str | None = None
        self._told_ns: int | None = None

    def due(self, sensor: str, time_ns: int) -> bool:
        """Returns whether fused bodies are sent with this frame of a sensor, on the common clock."""
        before = self._last.get(sensor, time_ns)
        if time_ns > before:
            step = (time_ns - before) * 1e-9
            self._steps[sensor] = step + 0.9 * (self._steps.get(sensor, step) - step)
        self._last[sensor] = max(time_ns, before)
        if self._lead is None or self._leads_better(sensor, time_ns):
            self._lead = sensor
        if sensor != self._lead or (self._told_ns is not None and time_ns <= self._told_ns):
            return False
        self._told_ns = time_ns
        return True

    def _leads_better(self, sensor: str, time_ns: int) -> bool:
        """Returns whether a sensor is faster than the leading one, or the leading one is late."""
        assert self._lead is not None
        if self._lead not in self._steps:
            return time_ns - self._last[self._lead] > 1e8
        step = self._steps[self._lead]
        late = (time_ns - self._last[self._lead]) * 1e-9 > _MISSED * step
        return late or self._steps.get(sensor, np.inf) < _FASTER * step


def settings_before_fusion(settings: TrackerSettings) -> TrackerSettings:
    """Settings for a tracker with bodies that go to the fuser: smoothing, mirroring and prediction are off;
    they are applied after fusion."""
    smoothing = dataclasses.replace(settings.smoothing, amount=0.0, amounts=())
    output = dataclasses.replace(settings.output, mirror=False, predict=0.0)
    return dataclasses.replace(settings, smoothing=smoothing, output=output)


def in_world(bodies: list[Body], world_from_sensor: Float) -> list[Body]:
    """Returns bodies of a sensor's own level frame, in the world."""
    turn = from_matrix(world_from_sensor[:3, :3])
    return [
        dataclasses.replace(
            body,
            joints=moved(world_from_sensor, body.joints),
            orientations=None if body.orientations is None else multiply(turn, body.orientations),
        )
        for body in bodies
    ]


def eyes(space: Space) -> dict[str, Float]:
    """Returns by sensor (3,) metres: its optical centre in the world."""
    return {name: place.eye for name, place in space.sensors.items()}
