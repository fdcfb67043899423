"""The bodies of one sensor by person: joints over time, interpolated between the frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.frames import BodyFrame

_SLOWEST = 0.35
"""Seconds between frames over which linear interpolation of a walking person still holds."""


@dataclass(frozen=True)
class BodyTrack:
    """One person as one sensor saw them.

    Attributes:
        id: the sensor's number of the person.
        times: (F,) seconds of the stream, rising.
        joints: (F, 20, 3) metres, the sensor's own level frame.
        confidence: (F, 20) in [0, 1].
    """

    id: int
    times: Float
    joints: Float
    confidence: Float

    def at(self, times: Float, longest_gap: float) -> tuple[Float, Float, Float]:
        """Returns joints (N, 20, 3), velocities (N, 20, 3) m/s and confidence (N, 20) at times (N,).

        Linear between neighbouring frames; confidence 0 where they are farther apart than ``longest_gap``
        seconds (or what is usual for a slow sensor), or where there is none on one side.
        """
        longest_gap = max(longest_gap, min(1.6 * self.step, _SLOWEST))
        if len(self.times) < 2:
            zeros = np.zeros((len(times), 20, 3))
            return zeros, zeros, zeros[..., 0]
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self.times) - 1)
        before = after - 1
        step = self.times[after] - self.times[before]
        share = (times - self.times[before]) / step
        inside = (share >= -1e-9) & (share <= 1 + 1e-9) & (step <= longest_gap)
        share = np.clip(share, 0.0, 1.0)[:, None, None]
        start, change = self.joints[before], self.joints[after] - self.joints[before]
        seen = np.minimum(self.confidence[before], self.confidence[after]) * inside[:, None]
        return start + share * change, self._velocities[before], seen

    @cached_property
    def step(self) -> float:
        """The median seconds between two frames."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0

    @cached_property
    def _velocities(self) -> Float:
        """(F - 1, 20, 3) m/s between two frames, from the frames around the two.

        The two's own difference would share their noise, and a fit of the clocks by it would come to rest
        where interpolation hides most noise: halfway between frames.
        """
        before = np.arange(len(self.times) - 1)
        early, late = np.maximum(before - 1, 0), np.minimum(before + 2, len(self.times) - 1)
        seconds = self.times[late] - self.times[early]
        return np.asarray((self.joints[late] - self.joints[early]) / seconds[:, None, None])


@dataclass(frozen=True)
class BodyStream:
    """All people that one sensor saw.

    Attributes:
        sensor: its identity.
        first_ns: the sensor's clock at time 0 of the tracks.
        tracks: by person, longest first.
    """

    sensor: str
    first_ns: int
    tracks: tuple[BodyTrack, ...]

    @property
    def duration(self) -> float:
        """Seconds from the first body to the last."""
        return max((float(t.times[-1]) for t in self.tracks), default=0.0)


def stream_of(sensor: str, frames: Iterable[BodyFrame]) -> BodyStream:
    """Returns the tracks of a sensor's body frames; frames out of order and frames of equal time are left
    out."""
    kept: list[BodyFrame] = []
    for frame in frames:
        if not kept or frame.time_ns > kept[-1].time_ns:
            kept.append(frame)
    first = kept[0].time_ns if kept else 0
    people: dict[int, list[tuple[float, AnyArray, AnyArray]]] = {}
    for frame in kept:
        seconds = (frame.time_ns - first) * 1e-9
        for body in frame.bodies:
            people.setdefault(body.id, []).append((seconds, body.joints, body.confidence))
    tracks = [
        BodyTrack(person, *(np.array(column, float) for column in zip(*rows, strict=True)))
        for person, rows in people.items()
    ]
    return BodyStream(sensor, first, tuple(sorted(tracks, key=lambda t: -len(t.times))))
