"""Motions return a performer's figure at every moment. They can be placed, concatenated and frozen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.rotation import from_matrix, slerp, to_matrix
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.rotations import rotation_about_y, round_to_grid
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.tracks import ease


class Motion(Protocol):
    """A movement that begins at the world's origin, facing +Z.

    Attributes:
        duration: duration in seconds.
    """

    duration: float

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds, clamped to the start and the end."""


class DanceMotion:
    """A choreography performed by a performer.

    Args:
        repeat: True to repeat the choreography; False to stand still at its end.
    """

    def __init__(self, performer: Performer, choreography: Choreography, repeat: bool = False) -> None:
        self._performer, self._choreography, self._repeat = performer, choreography, repeat
        self.duration = choreography.duration

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds."""
        motion_time = time % self.duration if self._repeat else min(max(time, 0.0), self.duration)
        return place_figure(
            self._performer.pose(self._choreography.posture(motion_time)), (0.0, -START_Z_M), 0.0
        )


def place_figure(figure: Figure, place: tuple[float, float], yaw: float) -> Figure:
    """Rotates a figure by ``yaw`` radians about the world's +Y, then moves it by ``place``, (x, z) in
    metres.
    """
    turn, offset = rotation_about_y(yaw), np.array([place[0], 0.0, place[1]])
    frames = np.empty_like(figure.frames)
    frames[:, :, :3] = turn @ figure.frames[:, :, :3]
    frames[:, :, 3] = figure.frames[:, :, 3] @ turn.T + offset
    return Figure(round_to_grid(figure.joints @ turn.T + offset), round_to_grid(frames))


@dataclass(frozen=True)
class MotionSegment:
    """One motion of a sequence.

    Attributes:
        start: time in seconds at which it begins.
        motion: the motion.
        place: (x, z) position in metres where it begins.
        yaw: direction that it faces at the start, in radians about +Y.
    """

    start: float
    motion: Motion
    place: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0


class MotionSequence:
    """A sequence of motions. Each continues until the next begins, with a cut or a blend between them.

    Args:
        segments: the motions, ordered by start time.
        blend: duration in seconds of the blend into the next motion, before each cut.
    """

    def __init__(self, performer: Performer, segments: tuple[MotionSegment, ...], blend: float = 0.0) -> None:
        self._performer, self._segments, self._blend = performer, segments, blend
        self.duration = segments[-1].start + segments[-1].motion.duration

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds."""
        k = max([n for n, segment in enumerate(self._segments) if segment.start <= time], default=0)
        current = self._at(self._segments[k], time)
        if self._blend == 0.0 or k + 1 == len(self._segments):
            return current
        after = self._segments[k + 1]
        part = ease(1.0 - (after.start - time) / self._blend)
        return (
            current
            if part == 0.0
            else interpolate_figures(current, self._at(after, time), self._performer, part)
        )

    @staticmethod
    def _at(segment: MotionSegment, time: float) -> Figure:
        return place_figure(segment.motion.figure(time - segment.start), segment.place, segment.yaw)


def interpolate_figures(a: Figure, b: Figure, performer: Performer, part: float) -> Figure:
    """Interpolates two figures by ``part``.

    Every limb takes the shortest rotation, and the soles stay on the floor.
    """
    turned = slerp(from_matrix(a.frames[:, :, :3]), from_matrix(b.frames[:, :, :3]), np.full(16, part))
    pelvis = (1.0 - part) * a.joints[0] + part * b.joints[0]
    figure = performer.figure(to_matrix(turned), pelvis)
    low = (1.0 - part) * performer.soles(a).min() + part * performer.soles(b).min()
    pelvis = pelvis + np.array([0.0, low - performer.soles(figure).min(), 0.0])
    return performer.figure(to_matrix(turned), pelvis)


class FrozenMotion:
    """A motion that freezes a moment of another motion, with a small sway.

    Args:
        at: the moment in seconds.
        sway: the figure sways over the part of the other motion that is within this many seconds before and
            after that moment.
    """

    duration = math.inf

    def __init__(self, motion: Motion, at: float, sway: float = 0.06) -> None:
        self._motion, self._at, self._sway = motion, at, sway

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds."""
        return self._motion.figure(self._at + self._sway * math.sin(2.0 * math.pi * time / 3.0))
