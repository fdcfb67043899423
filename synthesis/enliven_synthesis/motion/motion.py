"""What a performer can be made to do: anything that gives a figure at every moment, and where it is put."""

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
        """The figure at a time in seconds; before the start and after the end, that of the nearer one."""


class Danced:
    """A choreography of this project, danced by a performer.

    Args:
        repeat: begin again at its end, or stand still there.
    """

    def __init__(self, performer: Performer, choreography: Choreography, repeat: bool = False) -> None:
        self._performer, self._choreography, self._repeat = performer, choreography, repeat
        self.duration = choreography.duration

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        at = time % self.duration if self._repeat else min(max(time, 0.0), self.duration)
        return placed(self._performer.pose(self._choreography.posture(at)), (0.0, -HOME_Z), 0.0)


def placed(figure: Figure, place: tuple[float, float], yaw: float) -> Figure:
    """A figure turned by ``yaw`` radians about the world's +Y, then moved by ``place``, (x, z) metres."""
    turn, offset = about_y(yaw), np.array([place[0], 0.0, place[1]])
    frames = np.empty_like(figure.frames)
    frames[:, :, :3] = turn @ figure.frames[:, :, :3]
    frames[:, :, 3] = figure.frames[:, :, 3] @ turn.T + offset
    return Figure(on_grid(figure.joints @ turn.T + offset), on_grid(frames))


@dataclass(frozen=True)
class Leg:
    """A part of a longer way: a motion that begins at ``start`` seconds, at a place and facing a way."""

    start: float
    motion: Motion
    place: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0


class Chained:
    """One motion after the other; each goes on until the next begins. Where they do not meet, it is a cut.

    Args:
        legs: in the order of their start.
        blend: seconds before each cut in which the performer goes over to the next motion's beginning.
    """

    def __init__(self, performer: Performer, legs: tuple[Leg, ...], blend: float = 0.0) -> None:
        self._performer, self._legs, self._blend = performer, legs, blend
        self.duration = legs[-1].start + legs[-1].motion.duration

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        k = max([n for n, leg in enumerate(self._legs) if leg.start <= time], default=0)
        here = self._at(self._legs[k], time)
        if self._blend == 0.0 or k + 1 == len(self._legs):
            return here
        part = ease(1.0 - (self._legs[k + 1].start - time) / self._blend)
        return here if part == 0.0 else mixed(here, self._at(self._legs[k + 1], time), self._performer, part)

    @staticmethod
    def _at(leg: Leg, time: float) -> Figure:
        return placed(leg.motion.figure(time - leg.start), leg.place, leg.yaw)


def mixed(a: Figure, b: Figure, performer: Performer, part: float) -> Figure:
    """The figure ``part`` of the way from ``a`` to ``b``: every limb by its shortest turn, no sole sunk."""
    turned = slerp(from_matrix(a.frames[:, :, :3]), from_matrix(b.frames[:, :, :3]), np.full(16, part))
    pelvis = (1.0 - part) * a.joints[0] + part * b.joints[0]
    figure = performer.figure(to_matrix(turned), pelvis)
    low = (1.0 - part) * performer.soles(a).min() + part * performer.soles(b).min()
    pelvis = pelvis + np.array([0.0, low - performer.soles(figure).min(), 0.0])
    return performer.figure(to_matrix(turned), pelvis)


class Held:
    """A motion that stays about where another one is at one moment.

    Args:
        at: seconds of that moment.
        sway: seconds to either side of it that the performer drifts to and fro.
    """

    duration = math.inf

    def __init__(self, motion: Motion, at: float, sway: float = 0.06) -> None:
        self._motion, self._at, self._sway = motion, at, sway

    def figure(self, time: float) -> Figure:
        """The figure at a time in seconds."""
        return self._motion.figure(self._at + self._sway * math.sin(2.0 * math.pi * time / 3.0))
