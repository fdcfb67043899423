"""Runs the mapping of the key poses at a constant rate, independent of the sensor's frame rate.

A performer's poses arrive unevenly, and some are missing. They are resampled to a constant rate. The mapping
has a delay of ``lag`` samples. The shown state is interpolated between its last two results. So it is always
``lag + 1`` samples behind the pose.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.examples.live import LiveExamples
from enliven.examples.mapping import ExampleMap
from enliven.examples.puppet_motion import PuppetState
from enliven_edge.stage.puppet.locomotion import Footing, Locomotion

_NS = 1_000_000_000
"""Nanoseconds in a second."""


@dataclass(frozen=True, eq=False)
class PerformerInput:
    """The performers' input at one moment.

    Attributes:
        pose: (P, 3) metres, the paired joints in the body frame.
        yaw: radians about +Y, the direction that the puppet should face.
        footing: foot contacts and jump height of the performer.
        lift_scale_m: rise of the puppet in metres for a lift of 1.
        path_position: the performer's path on the floor as x + iz in metres, scaled to the puppet's strides
            and rotated to its axes.
    """

    pose: Float
    yaw: float
    footing: Footing
    lift_scale_m: float
    path_position: complex


class LivePuppet:
    """A puppet's control points and its root in the world while performers move it.

    Args:
        rate: samples per second.
        lag: delay of the mapping in samples.

    Attributes:
        free_points: indices of the control points that no performer moves. They stay at ``rest``.
        rest: (P, 3) metres, all control points at rest.
    """

    def __init__(self, mapping: ExampleMap, locomotion: Locomotion, rate: float, lag: int) -> None:
        self._mapping, self._locomotion, self._lag = mapping, locomotion, lag
        self._step_ns = round(_NS / rate)
        self._live: LiveExamples | None = None
        self._waiting: deque[PerformerInput] = deque()
        self._last: tuple[int, PerformerInput] | None = None
        self._due_ns = 0
        self._before = self._after = PuppetState(np.zeros((0, 3)), 0.0, np.zeros(3))
        self.free_points: Int = np.zeros(0, np.int64)
        self.rest: Float = np.zeros((0, 3))

    def begin(self, time_ns: int, sample: PerformerInput, state: PuppetState) -> PuppetState:
        """Starts from a first sample, as if the performer had always had this pose.

        Returns the state to show.

        Args:
            state: the puppet's state until now. The puppet keeps its place.
        """
        self._live = LiveExamples(self._mapping, self._step_ns / _NS, self._lag)
        self._waiting.clear()
        self._locomotion.begin(state.root, sample.path_position)
        self._after = PuppetState(np.zeros((0, 3)), 0.0, state.root)
        self._last, self._due_ns = (time_ns, sample), time_ns + self._step_ns
        for _ in range(self._lag + 2):
            self._push_sample(sample)
        if self._locomotion.can_step:
            offset = self._locomotion.compute_feet_centre(state) - self._locomotion.compute_feet_centre(
                self._after
            )
            offset = offset * np.array([1.0, 0.0, 1.0])
            self._locomotion.shift(offset)
            self._after = replace(self._after, root=self._after.root + offset)
        self._before = self._after
        return self._after

    def advance(self, time_ns: int, sample: PerformerInput) -> PuppetState:
        """Adds the next sample and returns the current state to show."""
        assert self._last is not None
        old_ns, old_state = self._last
        while self._due_ns <= time_ns:
            fraction = (self._due_ns - old_ns) / max(time_ns - old_ns, 1)
            self._push_sample(_interpolate(old_state, sample, fraction))
            self._due_ns += self._step_ns
        self._last = time_ns, sample
        fraction = 1.0 - (self._due_ns - time_ns) / self._step_ns
        a, b = self._before, self._after
        return PuppetState(
            a.places + fraction * (b.places - a.places),
            a.yaw + fraction * (b.yaw - a.yaw),
            a.root + fraction * (b.root - a.root),
        )

    def _push_sample(self, sample: PerformerInput) -> None:
        assert self._live is not None
        places = self._live.push(sample.pose)
        self._waiting.append(sample)
        if places is None:
            return
        places[self.free_points] = self.rest[self.free_points]
        delayed = self._waiting.popleft()
        places, root = self._locomotion.step(
            places, delayed.yaw, delayed.footing, delayed.lift_scale_m, delayed.path_position
        )
        self._before, self._after = self._after, PuppetState(places, delayed.yaw, root)


def _interpolate(a: PerformerInput, b: PerformerInput, fraction: float) -> PerformerInput:
    lift = a.footing.lift + fraction * (b.footing.lift - a.footing.lift)
    return PerformerInput(
        a.pose + fraction * (b.pose - a.pose),
        a.yaw + fraction * (b.yaw - a.yaw),
        replace((a if fraction < 0.5 else b).footing, lift=lift),
        b.lift_scale_m,
        a.path_position + fraction * (b.path_position - a.path_position),
    )
