"""Follow-through: soft parts of a possessed mesh lag behind the motion and then overshoot."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.stiffness import compute_painted_stiffness, stiffness_at
from enliven.document import Character

FULL_SWING_STIFFNESS = 1.0 / 16.0
"""Stiffness factor at which a part swings fully. From 1 down to this factor, softness increases with the
logarithm of the stiffness."""
_ANGULAR_FREQUENCY = 2.0 * np.pi * 2.0
"""Natural angular frequency, radians per second (2 Hz). It is typical of a cheek or a belly. Performers
rarely move a hand or foot back and forth faster."""
_DAMPING_RATIO = 0.25
"""Damping ratio. A sudden stop overshoots by 44 %, and the swing has decayed after one second."""
_MAX_OFFSET_M = 0.35
"""Maximum offset of a node, metres of the rest space, in which a person is about 1.75 m tall. It prevents
jumps after lost tracking from tearing the mesh."""


def node_stiffness(
    character: Character, nodes: Float, spots: tuple[tuple[float, float, float, float, float], ...]
) -> Float | None:
    """Returns the stiffness factors (N,) of nodes at rest positions (N, 3), or None if all are 1. A factor is
    the painted stiffness times that of the spheres ``spots`` in the settings.
    """
    painted, spotted = compute_painted_stiffness(character), stiffness_at(nodes, spots)
    return painted if spotted is None else spotted if painted is None else painted * spotted


class FollowThrough:
    """A mass-spring model of soft nodes. At an exaggeration of 1, the softest node moves like a mass on a
    spring attached to its computed position.

    The computed position x moves linearly between two frames. The offset u of the mass then obeys u'' + 2 d w
    u' + w^2 u = -x'', with damping ratio d and natural frequency w. The equation is solved in closed form.
    The shown position is x + e s u, with the exaggeration e and the softness s from 0 to 1. So a node at rest
    or at constant speed is shown at its computed position. A stiff node is always shown at its computed
    position.

    Args:
        stiffness: (N,) factors; nodes below 1 are soft. None means that no node is soft.
        exaggeration: e. 0 disables the swing.
    """

    def __init__(self, stiffness: Float | None, exaggeration: float) -> None:
        self._softness: Float = np.zeros((0, 1))
        if stiffness is not None:
            self._softness = np.clip(np.log(stiffness) / np.log(FULL_SWING_STIFFNESS), 0.0, 1.0)[:, None]
        self._exaggeration = exaggeration
        self.restart()

    def set_exaggeration(self, exaggeration: float) -> None:
        """Changes the exaggeration. A swing in progress continues. If the exaggeration was 0, the model
        restarts.
        """
        had_swing, self._exaggeration = self._has_swing, exaggeration
        if not had_swing:
            self.restart()

    @property
    def _has_swing(self) -> bool:
        return bool(self._exaggeration and self._softness.any())

    def restart(self) -> None:
        """Restarts at the next computed positions, without offsets."""
        self._places: Float | None = None
        self._pace: Float | None = None
        self._offset: Float = np.zeros((len(self._softness), 3))
        self._speed = self._offset
        self._time_ns = 0

    def __call__(self, positions: Float, time_ns: int) -> Float:
        """Returns the displayed positions (N, 3) of nodes with the computed ``positions`` (N, 3), metres."""
        if not self._has_swing:
            return positions
        seconds = (time_ns - self._time_ns) * 1e-9
        if self._places is not None and seconds > 0:
            pace = (positions - self._places) / seconds
            kick = 0.0 if self._pace is None else pace - self._pace
            self._offset, self._speed = advance_oscillators(self._offset, self._speed - kick, seconds)
            self._pace = pace
        if self._places is None or seconds > 0:
            self._places, self._time_ns = np.array(positions), time_ns
        displacement = self._exaggeration * self._softness * self._offset
        length = np.linalg.norm(displacement, axis=1, keepdims=True)
        return np.asarray(
            positions + displacement * np.minimum(1.0, _MAX_OFFSET_M / np.maximum(length, _MAX_OFFSET_M))
        )


def advance_oscillators(offset: Float, speed: Float, seconds: float) -> tuple[Float, Float]:
    """Returns the exact offset (metres) and velocity (metres per second) of damped oscillators after
    ``seconds``.
    """
    swing = _ANGULAR_FREQUENCY * np.sqrt(1.0 - _DAMPING_RATIO**2)
    fading = np.exp(-_DAMPING_RATIO * _ANGULAR_FREQUENCY * seconds)
    cosine, sine = np.cos(swing * seconds), np.sin(swing * seconds) / swing
    drag = _DAMPING_RATIO * _ANGULAR_FREQUENCY
    return (
        fading * (offset * (cosine + drag * sine) + speed * sine),
        fading * (speed * (cosine - drag * sine) - offset * _ANGULAR_FREQUENCY**2 * sine),
    )
