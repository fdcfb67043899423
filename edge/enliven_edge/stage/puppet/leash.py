"""A puppet that its own steps lead astray is drawn back to its performer's way, frame by frame.

The same as ``enliven.examples.spacetime.following`` does to a whole take, of what is known by now.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float

_SLOWLY = 1.0
"""Seconds in which it is drawn back: a stride, so that no single step is seen to slide."""
_STRIDES = (0.5, 1.5)
"""A puppet's strides, in the performer's in its own size: less and more is no stride but a drift."""


class Leash:
    """How far a puppet's root may be from where the performer went, in the puppet's own size.

    Args:
        size: metres of the puppet for a way as long as the performer is high.
        length: metres that it may be away.
        step: seconds between frames.
    """

    def __init__(self, size: float, length: float, step: float) -> None:
        self._size, self._length, self._share = size, length, step / _SLOWLY
        self._way = self._root = np.zeros(2)
        self._off: Float | None = None

    def begin(self) -> None:
        """Count from the next frame on."""
        self._off = None

    def shift(self, by: Float) -> None:
        """Takes note that the puppet was moved by (3,) metres."""
        self._root = self._root + by[[0, 2]]

    def pull(self, root: Float, way: Float) -> Float:
        """Returns (3,) metres by which the puppet is drawn back in this frame.

        Args:
            root: (3,) metres, where its steps have led it.
            way: (2,) beside and ahead, the performer's hips in their own heights, in the puppet's axes.
        """
        if self._off is None:
            self._way, self._root, self._off = way, root[[0, 2]], np.zeros(2)
        wanted, own = self._size * (way - self._way), root[[0, 2]] - self._root
        square = float(wanted @ wanted)
        stride = float(np.clip(own @ wanted / square, *_STRIDES)) if square > 1e-9 else 1.0
        self._off = self._off + self._share * (stride * wanted - own - self._off)
        far = float(np.linalg.norm(self._off))
        drawn = self._share * max(far - self._length, 0.0) / max(far, 1e-12) * self._off
        return np.array([drawn[0], 0.0, drawn[1]])
