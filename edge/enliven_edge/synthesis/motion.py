"""What a performer can be made to do: anything that gives a figure at every moment, and where it is put."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from enliven_edge.synthesis.choreography import HOME_Z, Choreography
from enliven_edge.synthesis.performer import Figure, Performer
from enliven_edge.synthesis.rotations import about_y, on_grid


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
