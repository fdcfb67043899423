"""Locomotion of a puppet frame by frame: its root in the world while performers move it.

In contact the anchor does not move over the floor. The anchor is a foot that the performer stands on until
they lift it, or, where that is not known, the lowest foot until another is clearly lower. In the air the
puppet keeps the velocity with which it left the floor, and its height is the performer's lift at the puppet's
size, as the time of landing is not known yet.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import LocomotionSettings
from enliven.examples import State
from enliven.examples.spacetime import stand
from enliven.mapping import turned_about_y
from enliven_edge.stage.puppet.feet import EITHER, Footing


class Locomotion:
    """Moves the root of a puppet frame by frame.

    Args:
        rest: (P, 3) metres, the control points at rest.
        feet: numbers of the control points that it can stand on; without any it stays on its spot.
        step: seconds between frames.
        sides: (F,) the performer's foot for each, see :func:`side_of_foot`; None: either foot for all.
    """

    def __init__(
        self,
        rest: Float,
        feet: Sequence[int],
        step: float,
        settings: LocomotionSettings,
        sides: Sequence[int] | None = None,
    ) -> None:
        self._feet: Int = np.asarray(feet, np.int64)
        self._sides: Int = np.asarray([EITHER] * len(feet) if sides is None else sides, np.int64)
        self._step = step
        self._sole = float(rest[self._feet, 1].min()) if len(self._feet) else 0.0
        self._grip = settings.grip * (float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0)
        self._roots: deque[Float] = deque(maxlen=max(round(settings.throw / step), 1) + 1)
        self._velocity = np.zeros(3)
        self._before: Float | None = None
        self.anchor = -1
        self.root = np.zeros(3)

    def begin(self, root: Float) -> None:
        """Starts anew at a root (3,), metres."""
        self.root = np.array(root, np.float64)
        self._before, self.anchor = None, -1
        self._roots.clear()

    def stands(self, state: State) -> Float:
        """Returns (3,) metres, the middle of the feet, before the puppet's own place and rotation."""
        feet = turned_about_y(state.places[self._feet], np.asarray(state.yaw))
        return np.asarray(feet.mean(0) + state.root)

    def shift(self, by: Float) -> None:
        """Moves the root, the past ones included, by (3,) metres."""
        self.root = self.root + by
        self._roots = deque((root + by for root in self._roots), self._roots.maxlen)

    @property
    def goes(self) -> bool:
        """Whether the puppet has feet to walk on."""
        return len(self._feet) > 0

    def go(self, places: Float, yaw: float, footing: Footing, size: float) -> Float:
        """Returns the root (3,) of the next frame, metres.

        Args:
            places: (P, 3) metres in the puppet's frame.
            yaw: radians.
            size: metres that the puppet rises for a lift of 1.
        """
        if len(self._feet) == 0:
            return self.root
        turned = turned_about_y(places, np.asarray(yaw))
        root = self.root.copy()
        if footing.touches:
            self._stand(turned, root, footing.stands)
        else:
            self._fly(root)
        root[1] = self._sole - turned[self._feet, 1].min() + footing.lift * size
        self._before, self.root = turned, root
        return root

    def _stand(self, turned: Float, root: Float, stands: tuple[bool, bool]) -> None:
        """Moves the root in contact, as in a take; the first anchor is the lowest foot."""
        known = np.array([*stands, any(stands)])[self._sides]
        before = turned if self._before is None else self._before
        roots, anchors = np.stack([root, root]), np.array([self.anchor, -1])
        stand(
            np.stack([before, turned]), self._feet, np.stack([known, known]), self._grip, 1, 1, roots, anchors
        )
        self.anchor = int(anchors[1])
        root[:] = roots[1]
        self._roots.append(root.copy())

    def _fly(self, root: Float) -> None:
        if self.anchor >= 0:
            frames = len(self._roots) - 1
            self._velocity = (self._roots[-1] - self._roots[0]) / max(frames * self._step, 1e-9)
            self.anchor = -1
            self._roots.clear()
        root += self._velocity * self._step
