"""Which feet stand on the floor: low, slow, and for long enough to be believed."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.body import Joint
from enliven_edge.tracking.settings import ContactSettings

_POINTS = np.array([[Joint.FOOT_LEFT, Joint.ANKLE_LEFT], [Joint.FOOT_RIGHT, Joint.ANKLE_RIGHT]])
"""(2, 2) ball and ankle of each foot: a foot stands on either."""
_ABOVE = np.array([0.0, 0.06])
"""Metres that an ankle is above the ball of a foot that stands."""
_FORGETS = 0.03
"""Metres a second by which the place where a foot stands is forgotten, so that one low frame is not final."""
_SPEED_CUTOFF = 6.0
_STEEP = 5.0
_LONGEST_GAP = 1.0
_SEEN = 0.1


class Contacts:
    """The probability that each foot of one person stands on the floor.

    A foot's height is taken from where it stood before, because the fit puts soles a few centimetres too high
    or too low. Hysteresis: what stands must be clearly lifted or moved to leave.
    """

    def __init__(self, settings: ContactSettings) -> None:
        self._settings = settings
        self._last: Float | None = None
        self._speed = np.zeros((2, 2))
        self._ground = np.zeros((2, 2))
        self._stands = np.zeros(2, bool)
        self._time_ns = 0

    def __call__(self, joints: Float, confidence: Float, time_ns: int) -> Float:
        """(2,) left and right, in [0, 1]; 0 for a foot that is not seen.

        Args:
            joints: (20, 3) metres, world frame, the floor at y = 0.
            confidence: (20,) of the joints.
        """
        settings, places = self._settings, joints[_POINTS]
        height = places[..., 1]
        highest = settings.floor + _ABOVE
        seconds = (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        if self._last is None or not 0.0 < seconds < _LONGEST_GAP:
            self._ground = np.minimum(height, highest)
            self._speed[:] = 0.0
            self._stands = (height < 0.6 * highest).any(1)
        else:
            moved = np.linalg.norm(places - self._last, axis=-1) / seconds
            self._speed += (moved - self._speed) / (1.0 + 1.0 / (2 * np.pi * _SPEED_CUTOFF * seconds))
            self._ground = np.minimum(np.minimum(height, self._ground + _FORGETS * seconds), highest)
        self._last = places
        stiff = np.where(self._stands, settings.hysteresis, 1.0)[:, None]
        excess = np.maximum((height - self._ground) / settings.lift, self._speed / settings.speed) / stiff
        excess = np.maximum(excess, height / highest).min(1)
        likely = 1.0 / (1.0 + np.exp(np.minimum(_STEEP * (excess - 1.0), 50.0)))
        self._stands = likely > 0.5
        seen = np.clip(confidence[_POINTS].max(1) / _SEEN, 0.0, 1.0)
        return np.asarray(likely * seen)
