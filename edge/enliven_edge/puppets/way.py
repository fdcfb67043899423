"""Where a puppet is in the world, as somebody performs: :mod:`enliven.examples.locomotion` frame by frame.

In contact the anchor, its lowest foot until another is clearly lower, does not move over the floor. In the
air the puppet keeps the velocity it left with. How high it is then is the performer's own height over the
floor at the puppet's size: when they will land nobody knows yet, but they fall as they fall.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.body import Body, Joint
from enliven.examples.locomotion import LocomotionSettings
from enliven.examples.performer import turned_about_y
from enliven.examples.puppet_motion import State

_SOLES = (Joint.FOOT_LEFT, Joint.FOOT_RIGHT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT)
_CREEP = 0.01
"""Metres a second by which what is taken for the floor may rise: nobody is in the air for long."""
_DEAD = 0.025
"""Share of a person's height below which feet are not in the air: heels come off, joints are not exact."""
_SURE = 0.5


@dataclass(frozen=True)
class Footing:
    """How the performer stands.

    Attributes:
        touches: whether the floor is touched.
        lift: shares of their height that the feet are in the air.
    """

    touches: bool = True
    lift: float = 0.0


class Soles:
    """Tells whether a performer is in the air: both feet must be seen to be off the floor."""

    def __init__(self) -> None:
        self._floor: Float | None = None

    def see(self, body: Body, seconds: float) -> Footing:
        """How they stand now, ``seconds`` after the last time."""
        soles = list(_SOLES)
        heights = body.joints[soles, 1]
        seen = (body.confidence[soles] > 0) & np.isfinite(heights)
        if self._floor is None:
            self._floor = np.where(seen, heights, np.inf)
        self._floor = np.where(seen, np.minimum(self._floor + _CREEP * seconds, heights), self._floor)
        if not (seen[:2] | seen[2:]).all():
            return Footing()
        above = float((heights - self._floor)[seen].min()) / body.height
        stands = body.contacts is not None and bool((body.contacts >= _SURE).any())
        if stands or above <= _DEAD:
            return Footing()
        return Footing(False, above - _DEAD)


class Way:
    """The root of a puppet, frame by frame.

    Args:
        rest: (P, 3) metres, the control points at rest.
        feet: numbers of those that it can stand on; without any it stays on its spot.
        step: seconds between frames.
    """

    def __init__(self, rest: Float, feet: Sequence[int], step: float, settings: LocomotionSettings) -> None:
        self._feet: Int = np.asarray(feet, np.int64)
        self._step = step
        self._sole = float(rest[self._feet, 1].min()) if len(self._feet) else 0.0
        self._grip = settings.grip * (float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0)
        self._roots: deque[Float] = deque(maxlen=max(round(settings.throw / step), 1) + 1)
        self._velocity = np.zeros(3)
        self._before: Float | None = None
        self.anchor = -1
        self.root = np.zeros(3)

    def begin(self, root: Float) -> None:
        """From a root (3,) on, as if nothing had been before."""
        self.root = np.array(root, np.float64)
        self._before, self.anchor = None, -1
        self._roots.clear()

    def stands(self, state: State) -> Float:
        """(3,) metres, the middle of the feet, before the puppet's own place and turn."""
        feet = turned_about_y(state.places[self._feet], np.asarray(state.yaw))
        return np.asarray(feet.mean(0) + state.root)

    def shift(self, by: Float) -> None:
        """Everything, also what was before, by (3,) metres."""
        self.root = self.root + by
        self._roots = deque((root + by for root in self._roots), self._roots.maxlen)

    @property
    def goes(self) -> bool:
        """Whether it has feet to go on."""
        return len(self._feet) > 0

    def go(self, places: Float, yaw: float, footing: Footing, size: float) -> Float:
        """(3,) the root of the next frame.

        Args:
            places: (P, 3) metres in the puppet's frame.
            yaw: radians.
            size: metres that it rises for a lift of 1.
        """
        if len(self._feet) == 0:
            return self.root
        turned = turned_about_y(places, np.asarray(yaw))
        root = self.root.copy()
        if footing.touches:
            self._stand(turned, root)
        else:
            self._fly(root)
        root[1] = self._sole - turned[self._feet, 1].min() + footing.lift * size
        self._before, self.root = turned, root
        return root

    def _stand(self, turned: Float, root: Float) -> None:
        heights = turned[self._feet, 1]
        if self.anchor < 0 or turned[self.anchor, 1] > heights.min() + self._grip:
            self.anchor = int(self._feet[heights.argmin()])
        if self._before is not None:
            # The new anchor has not moved since the frame before, whoever was the anchor then.
            root += self._before[self.anchor] - turned[self.anchor]
        self._roots.append(root.copy())

    def _fly(self, root: Float) -> None:
        if self.anchor >= 0:
            frames = len(self._roots) - 1
            self._velocity = (self._roots[-1] - self._roots[0]) / max(frames * self._step, 1e-9)
            self.anchor = -1
            self._roots.clear()
        root += self._velocity * self._step
