"""Motions give a performer's figure at every moment; they can be placed, chained and held."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.rotation import from_matrix, slerp, to_matrix
from enliven_synthesis.body import Figure, Performer, about_y, on_grid
from enliven_synthesis.motion.dance import HOME_Z, Choreography
from enliven_synthesis.motion.tracks import ease


class Motion(Protocol):
    """A movement that begins at the world's origin, facing +Z.

    Attributes:
        duration: seconds.
    """

    duration: float

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds, clamped to the start and the end."""


class Danced:
    """A choreography of this project, performed by a performer.

    Args:
        repeat: whether it begins again at its end, or stands still there.
    """

    def __init__(self, performer: Performer, choreography: Choreography, repeat: bool = False) -> None:
        self._performer, self._choreography, self._repeat = performer, choreography, repeat
        self.duration = choreography.duration

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        at = time % self.duration if self._repeat else min(max(time, 0.0), self.duration)
        return placed(self._performer.pose(self._choreography.posture(at)), (0.0, -HOME_Z), 0.0)


def placed(figure: Figure, place: tuple[float, float], yaw: float) -> Figure:
    """Turns a figure by ``yaw`` radians about the world's +Y, then moves it by ``place``, (x, z) metres."""
    turn, offset = about_y(yaw), np.array([place[0], 0.0, place[1]])
    frames = np.empty_like(figure.frames)
    frames[:, :, :3] = turn @ figure.frames[:, :, :3]
    frames[:, :, 3] = figure.frames[:, :, 3] @ turn.T + offset
    return Figure(on_grid(figure.joints @ turn.T + offset), on_grid(frames))


@dataclass(frozen=True)
class MotionSegment:
    """A motion in a chain.

    Attributes:
        start: seconds at which it begins.
        motion: the motion.
        place: (x, z) metres where it begins.
        yaw: radians about +Y that it faces at the start.
    """

    start: float
    motion: Motion
    place: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0


class Chained:
    """A sequence of motions; each goes on until the next begins, with a cut or a blend between them.

    Args:
        segments: the motions, ordered by start.
        blend: seconds before each cut in which the performer blends into the next motion's beginning.
    """

    def __init__(self, performer: Performer, segments: tuple[MotionSegment, ...], blend: float = 0.0) -> None:
        self._performer, self._segments, self._blend = performer, segments, blend
        self.duration = segments[-1].start + segments[-1].motion.duration

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        k = max([n for n, segment in enumerate(self._segments) if segment.start <= time], default=0)
        here = self._at(self._segments[k], time)
        if self._blend == 0.0 or k + 1 == len(self._segments):
            return here
        after = self._segments[k + 1]
        part = ease(1.0 - (after.start - time) / self._blend)
        return here if part == 0.0 else mixed(here, self._at(after, time), self._performer, part)

    @staticmethod
    def _at(segment: MotionSegment, time: float) -> Figure:
        return placed(segment.motion.figure(time - segment.start), segment.place, segment.yaw)


def mixed(a: Figure, b: Figure, performer: Performer, part: float) -> Figure:
    """Interpolates two figures by ``part``: every limb by its shortest turn, the soles kept on the floor."""
    turned = slerp(from_matrix(a.frames[:, :, :3]), from_matrix(b.frames[:, :, :3]), np.full(16, part))
    pelvis = (1.0 - part) * a.joints[0] + part * b.joints[0]
    figure = performer.figure(to_matrix(turned), pelvis)
    low = (1.0 - part) * performer.soles(a).min() + part * performer.soles(b).min()
    pelvis = pelvis + np.array([0.0, low - performer.soles(figure).min(), 0.0])
    return performer.figure(to_matrix(turned), pelvis)


class HeldMotion:
    """A motion that holds the figure of another one at one moment, with a small sway.

    Args:
        at: seconds of that moment.
        sway: seconds of the other motion to either side, between which the figure sways.
    """

    duration = math.inf

    def __init__(self, motion: Motion, at: float, sway: float = 0.06) -> None:
        self._motion, self._at, self._sway = motion, at, sway

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        return self._motion.figure(self._at + self._sway * math.sin(2.0 * math.pi * time / 3.0))
