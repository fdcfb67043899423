"""Drift correction: keeps a mesh that walks with its own steps near its performer's scaled path over the
floor.

    following = PathFollower(size, settings, step, feet=2)
    pull = following.compute_correction(off, stands, moved)   # frame by frame, in a take and live
    following.held                                            # how far its standing feet are displaced

The feet of a mesh slip slightly at every step, so the mesh would drift away from a performer who stays in
place. If its distance from the path exceeds a maximum (the leash), the mesh is slowly pulled back. Meanwhile,
a standing foot stays in place on the floor. It returns to its position in the mesh when it is lifted.

A mesh also drifts within one step. If it turns about a foot that is far from its centre, its centre moves on
an arc. If it jumps, it keeps the speed of its last steps. Such drift is faster than any slow pull. So beyond
the leash, only a part of the mesh's drift moves the mesh, and the rest displaces its standing feet. The part
decreases to 0 at twice the leash, which is the maximum distance from the path. This split is elastic: when
the drift reverses, the feet return to their positions.

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
_MAX_FOOT_DISPLACEMENT = 0.15
"""Maximum displacement of a standing foot, as a fraction of the mesh's size. A smaller value lets feet slide
in turns and jumps. A larger value would visibly stretch legs."""
_MAX_PATH_LEASHES = 2.0
"""Maximum distance from the path, as a multiple of the leash. It is kept even if standing feet slide."""
_SLIDING_PULL_S = 0.2
"""Time constant, in seconds, of the correction of distances above :data:`_MAX_PATH_LEASHES`. Only a path that
jumps causes such distances. The time is short, but long enough to avoid a jump of the mesh."""
_MAX_PATH_SPEED = 3.0
"""Maximum speed of a path that the mesh follows without delay, in mesh sizes per second. A fast runner has
this speed. A faster path is an error of the tracker, and would make the mesh jump."""


class PathFollower:
    """The pull of a mesh towards its path, frame by frame.

    Args:
        size: size of the mesh, metres.
        settings: the length of the leash, and the time in which a foot returns to its position.
        step: seconds between frames.
        feet: number of feet with which the mesh steps, 0 if it does not step.

    Attributes:
        held: for each foot, its displacement on the floor from its position in the mesh, metres.
        farthest: maximum distance from the path of a mesh that steps, metres.
    """

    def __init__(self, size: float, settings: LocomotionSettings, step: float, feet: int = 0) -> None:
        self._leash, self._most = settings.leash * size, _MAX_FOOT_DISPLACEMENT * size
        self.farthest, self._max_path_move = _MAX_PATH_LEASHES * self._leash, _MAX_PATH_SPEED * size * step
        self._share = _decay_fraction(step, _STEPPING_PULL_S if feet else _GLIDING_PULL_S)
        self._slide = _decay_fraction(step, _SLIDING_PULL_S)
        self._back = _decay_fraction(step, settings.contact.blend / 2.0)
        self._remaining: complex | None = None
        self.held = [0j] * feet

    def compute_correction(self, off: complex, stands: Sequence[bool] = (), moved: complex = 0j) -> complex:
        """Returns the correction x + iz of the root in one frame, metres, and updates ``held``.

        Args:
            off: displacement x + iz from the mesh's position to its position on the path, metres.
            stands: for each foot, True if it stands.
            moved: movement x + iz of the root in this frame by the mesh's own steps, metres.
        """
        if not self.held:
            return self._share * _part_beyond_circle(off, self._leash)
        before = self._find_earlier_distance(off, moved)
        pull = self._compute_elastic_pull(off, before, stands)
        if any(
            down and abs(held - pull) > max(self._most, abs(held))
            for held, down in zip(self.held, stands, strict=True)
        ):
            # A standing foot has already reached its maximum displacement. So the pull waits until the foot
            # is lifted, or until the mesh reaches its maximum distance.
            pull = 0j
        pull += self._compute_sliding_pull(off - pull, before)
        for k, down in enumerate(stands):
            self.held[k] = (
                limit_length(self.held[k] - pull, self._most) if down else self.held[k] * (1.0 - self._back)
            )
        self._remaining = off - pull
        return pull

    def _find_earlier_distance(self, off: complex, moved: complex) -> complex:
        """Returns the displacement from the mesh to its path in the previous frame. If the path jumps, the
        jump counts as an earlier displacement, so that the mesh does not jump, too.
        """
        if self._remaining is None:
            return off
        path_move = off - self._remaining + moved
        return self._remaining + path_move - limit_length(path_move, self._max_path_move)

    def _compute_elastic_pull(self, off: complex, before: complex, stands: Sequence[bool]) -> complex:
        """Returns the pull that standing feet can compensate: an elastic part, and a slow part."""
        held = max((held for held, down in zip(self.held, stands, strict=True) if down), key=abs, default=0j)
        # ``off - held`` is the distance that the mesh would have from the path if the foot were not
        # displaced.
        target = before + self._reduce_distance(off - held) - self._reduce_distance(before - held)
        near = limit_length(target, self.farthest)
        return off - target + self._share * _part_beyond_circle(near, self._leash)

    def _reduce_distance(self, off: complex) -> complex:
        """Returns the displacement ``off``, with a length that increases ever more slowly beyond the leash
        and stays below the maximum distance."""
        distance, width = abs(off), self.farthest - self._leash
        if distance <= self._leash:
            return off
        if width <= 0.0:
            return self.farthest / distance * off
        return (self.farthest - width * math.exp((self._leash - distance) / width)) / distance * off

    def _compute_sliding_pull(self, off: complex, before: complex) -> complex:
        """Returns the pull that keeps the mesh within the maximum distance from its path.

        If it already was farther away, the distance does not increase, and decreases quickly.
        """
        kept = limit_length(off, max(abs(before), self.farthest))
        return off - kept + self._slide * _part_beyond_circle(kept, self.farthest)


def limit_length(displacement: complex, longest: float) -> complex:
    """Returns the displacement, shortened to at most ``longest``."""
    length = abs(displacement)
    return displacement * (longest / length) if length > longest else displacement


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
