"""Drift correction: keeps a mesh that walks with its own steps near its performer's scaled path over the
floor.

    following = PathFollower(size, settings, step, feet=2)
    pull, held = following.next(off, stands)         # frame by frame, in a take and live

The feet of a mesh slip slightly at every step, so the mesh would drift away from a performer who stays in
place. If its distance from the path exceeds a maximum (the leash), the mesh is slowly pulled back. Meanwhile,
a standing foot stays in place on the floor. It returns to its position in the mesh when it is lifted.

A position on the floor is a complex number here: x + iz, metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from enliven.arrays import Complex, Float
from enliven.document import LocomotionSettings

_STEPPING_PULL_S = 0.5
"""Time constant, in seconds, of the pull on a mesh that steps. It is about a stride, so that the pull is not
visible."""
_GLIDING_PULL_S = 0.02
"""Time constant, in seconds, of the pull on a mesh that does not step. It is short, so that the mesh does not
lag behind."""
_MAX_FOOT_DISPLACEMENT = 0.1
"""Maximum displacement of a standing foot, as a fraction of the mesh's size. More would visibly stretch its
leg."""
_MAX_PATH_LEASHES = 2.0
"""Maximum distance from the path, as a multiple of the leash. Larger distances are corrected even if standing
feet slide."""
_SLIDING_PULL_S = 0.2
"""Time constant, in seconds, of the correction of distances above :data:`_MAX_PATH_LEASHES`. It is short, but
long enough to avoid a jump."""


class PathFollower:
    """The pull of a mesh towards its path, frame by frame.

    Args:
        size: size of the mesh, metres.
        settings: the length of the leash, and the time in which a foot returns to its position.
        step: seconds between frames.
        feet: number of feet with which the mesh steps, 0 if it does not step.

    Attributes:
        held: for each foot, its displacement on the floor from its position in the mesh, metres.
    """

    def __init__(self, size: float, settings: LocomotionSettings, step: float, feet: int = 0) -> None:
        self._leash, self._most = settings.leash * size, _MAX_FOOT_DISPLACEMENT * size
        self._share = _decay_fraction(step, _STEPPING_PULL_S if feet else _GLIDING_PULL_S)
        self._slide = _decay_fraction(step, _SLIDING_PULL_S)
        self._back = _decay_fraction(step, settings.contact.blend / 2.0)
        self.held = [0j] * feet

    def compute_correction(self, off: complex, stands: Sequence[bool] = ()) -> complex:
        """Returns the correction x + iz of the root in one frame, metres, and updates ``held``.

        Args:
            off: displacement x + iz from the mesh's position to its position on the path, metres.
            stands: for each foot, True if it stands.
        """
        slowly = self._share * _part_beyond_circle(off, self._leash)
        at_once = self._slide * _part_beyond_circle(off, _MAX_PATH_LEASHES * self._leash)
        pull = max(slowly, at_once, key=abs)
        if any(
            down and abs(held - pull) > max(self._most, abs(held))
            for held, down in zip(self.held, stands, strict=True)
        ):
            # A standing foot has already reached its maximum displacement. So the slow part of the correction
            # waits until the foot is lifted.
            pull = at_once
        for k, down in enumerate(stands):
            self.held[k] = (
                self._limit_held(self.held[k] - pull) if down else self.held[k] * (1.0 - self._back)
            )
        return pull

    def _limit_held(self, held: complex) -> complex:
        distance = abs(held)
        return held * (self._most / distance) if distance > self._most else held


def _part_beyond_circle(off: complex, radius: float) -> complex:
    """Returns the part of the displacement ``off`` beyond a circle of ``radius`` about 0, or 0 inside it."""
    distance = abs(off)
    return (distance - radius) / distance * off if distance > radius else 0j


def complex_from_floor(places: Float) -> Complex:
    """Converts positions (..., 3) to complex numbers on the floor (...,), metres."""
    return np.asarray(places[..., 0] + 1j * places[..., 2])


def floor_from_complex(places: Complex | complex) -> Float:
    """Converts complex numbers on the floor (...,) to positions (..., 3) at height 0, metres."""
    positions = np.asarray(places)
    return np.stack([positions.real, np.zeros(positions.shape), positions.imag], axis=-1)


def _decay_fraction(step: float, constant: float) -> float:
    """Returns the fraction of a difference that decays in ``step`` seconds, for a time constant in
    seconds."""
    return 1.0 - math.exp(-step / constant) if constant > 0.0 else 1.0
