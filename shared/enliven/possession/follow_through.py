"""Follow-through: the soft parts of a possessed mesh swing after its performers' motion, and past it."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph import painted_stiffness, stiffness_at
from enliven.document import Character

SOFTEST = 1.0 / 16.0
"""Factor of stiffness at which a part swings in full; between it and 1 by the logarithm."""
_FREQUENCY = 2.0 * np.pi * 2.0
"""Radians a second, 2 Hz: as a cheek or a belly swings; performers seldom move an end faster to and fro."""
_DAMPING = 0.25
"""Part of the critical damping: a stop is overshot by 44 %, and after a second nothing is seen of it."""
_FARTHEST = 0.35
"""Metres of the rest space, in which a person is about 1.75 m: what lost tracking throws does not tear."""


def stiffness_of(
    character: Character, nodes: Float, spots: tuple[tuple[float, float, float, float, float], ...]
) -> Float | None:
    """(N,) the factor of each node (N, 3) at rest: its paint times the spots; None for 1 everywhere."""
    painted, told = painted_stiffness(character), stiffness_at(nodes, spots)
    return painted if told is None else told if painted is None else painted * told


class FollowThrough:
    """Swings soft nodes: at an exaggeration of 1 the softest is a mass on a spring at its place.

    Where the place x moves straight between two frames, the offset u of the mass obeys, in closed form,
    u'' + 2 d w u' + w^2 u = -x''. What is shown is x + e s u, with the exaggeration e and the softness s from
    0 to 1. So a place at rest or at an even speed is shown where it is, and a stiff node always is.

    Args:
        stiffness: (N,) factors, of which those below 1 are soft; None: none is.
        exaggeration: e; 0 turns it off.
    """

    def __init__(self, stiffness: Float | None, exaggeration: float) -> None:
        self._softness: Float = np.zeros((0, 1))
        if stiffness is not None:
            self._softness = np.clip(np.log(stiffness) / np.log(SOFTEST), 0.0, 1.0)[:, None]
        self._exaggeration = exaggeration
        self.restart()

    def exaggerate(self, exaggeration: float) -> None:
        """Swings so far from now on; what swings already goes on, unless nothing did."""
        moved, self._exaggeration = self._moves, exaggeration
        if not moved:
            self.restart()

    @property
    def _moves(self) -> bool:
        return bool(self._exaggeration and self._softness.any())

    def restart(self) -> None:
        """Begins anew with the next places, without any offset."""
        self._places: Float | None = None
        self._pace: Float | None = None
        self._offset: Float = np.zeros((len(self._softness), 3))
        self._speed = self._offset
        self._time_ns = 0

    def __call__(self, positions: Float, time_ns: int) -> Float:
        """(N, 3) metres, where the nodes are shown that are computed at ``positions`` (N, 3)."""
        if not self._moves:
            return positions
        seconds = (time_ns - self._time_ns) * 1e-9
        if self._places is not None and seconds > 0:
            pace = (positions - self._places) / seconds
            kick = 0.0 if self._pace is None else pace - self._pace
            self._offset, self._speed = _swung(self._offset, self._speed - kick, seconds)
            self._pace = pace
        if self._places is None or seconds > 0:
            self._places, self._time_ns = np.array(positions), time_ns
        shown = self._exaggeration * self._softness * self._offset
        length = np.linalg.norm(shown, axis=1, keepdims=True)
        return np.asarray(positions + shown * np.minimum(1.0, _FARTHEST / np.maximum(length, _FARTHEST)))


def _swung(offset: Float, speed: Float, seconds: float) -> tuple[Float, Float]:
    """Offset (metres) and speed (metres a second) of damped oscillators after so many seconds, exactly."""
    swing = _FREQUENCY * np.sqrt(1.0 - _DAMPING**2)
    fading = np.exp(-_DAMPING * _FREQUENCY * seconds)
    along, across = np.cos(swing * seconds), np.sin(swing * seconds) / swing
    drag = _DAMPING * _FREQUENCY
    return (
        fading * (offset * (along + drag * across) + speed * across),
        fading * (speed * (along - drag * across) - offset * _FREQUENCY**2 * across),
    )
