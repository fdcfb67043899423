"""The performers as their camera sees them, in a corner of the picture that covers the characters least."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import BONES, Body
from enliven.wire import CameraMessage

EYE = 1.1
"""Metres over the floor from which performers are seen, a camera's on a table: messages do not say."""
_VIEW = np.tan(np.radians(29.0))
"""Tangent of half the height of the view: depth cameras see 56 to 60 degrees."""
WIDER = 1.2
"""Width of the view over its height: what depth cameras have, a little cropped."""
_NEAREST = 0.6
"""Metres: nearer than this no depth camera sees; other performers are looked at from before them."""
_BEFORE = 2.5
"""Metres before performers who do not stand before the world's origin: the usual distance."""
_SHARE = 0.3
"""Share of the picture's height: the character stays what is looked at."""
_LEAST = 104.0
"""Pixels of the height at least: a pose is told apart from so many on."""
_MOST = 400.0
"""Pixels of the height at most: more shows no more."""
_WIDEST = 0.45
"""Share of the picture's width for all views side by side."""
_MARGIN = 14.0
"""Pixels to the border of the picture."""
_BELOW = 62.0
"""Pixels at the bottom that the live timeline has in Play, and messages elsewhere."""
_BETTER = 0.25
"""Share of the inset by which another corner has to cover less, so that it does not leap about."""
_LOOKED = 20
"""Pictures after which it is looked again which corner is free, since that costs the characters' vertices."""

Rectangle = tuple[float, float, float, float]
"""Left, top, width and height, pixels."""


@dataclass(frozen=True, eq=False)
class SeenBody:
    """A performer in the view of a camera.

    Attributes:
        id: as the window numbers performers.
        places: (20, 2) of the view: 0 to its width over its height to the right, 0 to 1 down; NaN behind it.
        depth: (20,) metres before the camera.
        confidence: (20,) in [0, 1].
        focal: heights of the view that a metre has at a distance of one.
    """

    id: int
    places: Float
    depth: Float
    confidence: Float
    focal: float = float(0.5 / _VIEW)

    @property
    def bones(self) -> list[tuple[int, int]]:
        """Returns the bones, the farthest first."""
        return sorted(BONES, key=lambda bone: -float(self.depth[list(bone)].sum()))

    def pixels(self, metres: float, joint: int) -> float:
        """Shares of the view's height that a length at a joint has."""
        return float(metres * self.focal / max(self.depth[joint], _NEAREST))


def width_of(camera: CameraMessage | None) -> float:
    """Returns the width over the height of a camera's view; of one that tells no picture :data:`WIDER`."""
    return WIDER if camera is None or not camera.height else camera.width / camera.height


def seen(bodies: Sequence[Body], camera: CameraMessage | None = None) -> tuple[SeenBody, ...]:
    """Performers as their camera sees them; of one that does not tell, as a level one before them does."""
    if not bodies:
        return ()
    if camera is not None:
        return tuple(_through(camera, body) for body in bodies)
    nearest = max(float(body.joints[:, 2].max()) for body in bodies)
    eye = np.array([0.0, EYE, 0.0])
    if nearest > -_NEAREST:
        middle = np.mean([body.joints.mean(0) for body in bodies], axis=0)
        eye = np.array([middle[0], EYE, nearest + _BEFORE])
    made = []
    for body in bodies:
        way = body.joints - eye
        depth = -way[:, 2]
        half = np.where(depth > 0.0, depth, np.nan) * _VIEW
        places = np.stack([0.5 * (WIDER + way[:, 0] / half), 0.5 * (1.0 - way[:, 1] / half)], 1)
        made.append(SeenBody(body.id, places, depth, body.confidence))
    return tuple(made)


def _through(camera: CameraMessage, body: Body) -> SeenBody:
    """Returns a performer as a camera sees them that said where it stands."""
    rows, (across, down, right, low) = np.reshape(camera.place, (3, 4)), camera.lens
    ahead = (body.joints - rows[:, 3]) @ rows[:, :3]
    depth = np.where(ahead[:, 2] > 0.0, ahead[:, 2], np.nan)
    places = np.stack([across * ahead[:, 0] / depth + right, down * ahead[:, 1] / depth + low], 1)
    return SeenBody(body.id, places, ahead[:, 2], body.confidence, down)


class PerformerInset:
    """Where the inset is; it stays in a corner until another one covers much less."""

    def __init__(self) -> None:
        self._corner, self._drawn = 0, 0

    def place(
        self, width: float, height: float, views: float, covered: Callable[[], Sequence[Rectangle]]
    ) -> Rectangle:
        """Returns the rectangle in a picture of a width and height in pixels, for some views side by side.

        Args:
            views: how many, by their widths: one of :data:`WIDER` is one.
            covered: returns where characters are seen, in pixels of the picture; asked once in a while.
        """
        fits = min(_MOST, _WIDEST * width / (WIDER * views), height - _BELOW - _MARGIN)
        tall = max(min(max(_SHARE * height, _LEAST), fits), 1.0)
        wide = tall * WIDER * views
        right, low = width - wide - _MARGIN, height - tall - _BELOW
        corners = [(x, y, wide, tall) for x, y in ((right, low), (right, _MARGIN), (_MARGIN, low))]
        if self._drawn % _LOOKED == 0:
            known = covered()
            costs = [sum(_common(corner, one) for one in known) / (wide * tall) for corner in corners]
            best = int(np.argmin(costs))
            if costs[best] + _BETTER < costs[self._corner]:
                self._corner = best
        self._drawn += 1
        return corners[self._corner]


def rectangle_of(pixels: Float) -> Rectangle | None:
    """Returns the rectangle around places (N, 2) in pixels; None if one is behind the camera."""
    if not len(pixels) or not np.isfinite(pixels).all():
        return None
    low, high = pixels.min(0), pixels.max(0)
    return float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])


def _common(one: Rectangle, other: Rectangle) -> float:
    """Returns pixels squared that two rectangles share."""
    wide = min(one[0] + one[2], other[0] + other[2]) - max(one[0], other[0])
    high = min(one[1] + one[3], other[1] + other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)
