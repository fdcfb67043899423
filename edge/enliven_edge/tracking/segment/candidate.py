"""One candidate: a group of pixels that may be a new person, watched until it has proven it."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import BEFORE, UNLIKELY
from enliven_edge.tracking.segment.person_shape import BlobShape, shape_of
from enliven_edge.tracking.segment.segmentation import LooseGroup

YOUNG = 1.0
"""Seconds of a room's age up to which no person can prove to have come in: all of it is new."""
_TALL = 1.05
"""Metres above the floor from which a crown is high enough for a person who walks in: a small child's."""
_FRAMES = 3
"""Frames for which a candidate must be seen with a steady crown to be proven: one may be noise."""
_LONG = 10
"""Frames after which a shape that is human, but not upright, is proven too."""
_STEADY = 0.15
"""Metres by which the crown may vary in the meantime: groups that merge or part vary by more."""
_LARGE = 0.33
"""Square metres seen from which a candidate with a low crown may be a person who is bent or kneels."""
_LEAST = 0.14
"""Square metres that must be seen of a person to be believed: smaller groups are mostly things."""
_STOUT = 0.1
"""Square metres seen at the least of a person a metre tall, from the side; they grow as its square."""
_BULKY = 0.5
"""Square metres seen at the most of a person a metre tall; they grow with the height squared."""
STANDS = 1.3
"""Metres above the floor from which a crown is that of a standing person: most seated people's are lower."""
_CHECK_NS = 250_000_000
"""Nanoseconds between two looks at a thing that does not change: measuring a shape and asking the network are
the dear parts."""
_BEHIND = 0.25
"""Share of the outline behind something nearer from which a person is still coming out from there."""
_PATIENCE_NS = 800_000_000
"""Nanoseconds for which such a candidate is waited for: time to come out, and to be known again."""
_BACK_OFF_NS = 150_000_000
"""Nanoseconds to the next try after a first try that found no body; each later wait is twice as long."""
_CAME_OFF = 0.7
"""Share of the area that was searched in vain below which what is left is another group, searched at once."""
_LONGEST_NS = 2_000_000_000
"""Nanoseconds between two tries at most: a real person must not wait for longer."""


class Candidate:
    """A group of pixels of a person's size.

    Attributes:
        pixels: (h, w).
        centre: (3,) metres, world frame.
        shape: what it looks like.
        area: square metres that are seen.
        crowns: metres above the floor of its top, frame by frame.
        bystander: whether it is out of the zone, or locked out.
        awaited: whether a person was lost about here; the candidate may then be in any posture.
        recognised: whether the network takes it for a person.
        parts: [(h, w)] itself and the parts that it was separated from; [] where it was whole.
    """

    def __init__(self, centre: Float, time_ns: int) -> None:
        self.centre = centre
        self.crowns: list[float] = []
        self.frames, self.area = 0, 0.0
        self.bystander = self.awaited = self.refused = self.recognised = False
        self.seen_ns = self.first_ns = time_ns
        self.before = self.plain = 0.0
        self.group: LooseGroup | None = None
        self.parts: list[Bool] = []
        self.checked_ns = time_ns
        self.shape: BlobShape
        self.pixels: Bool
        self._next_ns, self._wait_ns = time_ns, _BACK_OFF_NS
        self._vain_area = 0.0
        self._asked_ns: int | None = None

    def update(
        self,
        pixels: Bool,
        centre: Float,
        shape: BlobShape,
        area: float,
        shares: tuple[float, float],
        time_ns: int,
    ) -> None:
        """Takes the group in a new frame, and its shares before the known room and before any room."""
        self.area, (self.before, self.plain) = area, shares
        self.pixels, self.centre, self.shape = pixels, centre, shape
        self.frames, self.seen_ns, self.checked_ns = self.frames + 1, time_ns, time_ns
        self.crowns = [*self.crowns[-_LONG:], shape.crown]

    def grow(self, view: FrameView, pixels: Bool) -> None:
        """Extends the candidate to these (h, w) pixels."""
        self.pixels = pixels
        self.centre, self.area, _ = measured(view, pixels, np.zeros(pixels.shape, np.uint8))
        self.shape = shape_of(view, pixels, self.area)

    @property
    def proven(self) -> bool:
        """Whether it came into a known room with a person's shape, or may be the person lost here."""
        steady = self.frames >= _FRAMES and float(np.ptp(self.crowns[-_FRAMES:])) < _STEADY
        if not steady or self.refused:
            return False
        if self.awaited and self.shape.possible and self.area > _LEAST and self.plain > 0.5:
            return True
        tall = (self.shape.crown > _TALL or self.shape.cut) and self.area > _LEAST
        return (
            tall and self.before > 0.5 and (self.shape.upright or (self.shape.human and self.frames >= _LONG))
        )

    @property
    def unions(self) -> list[Bool]:
        """[(h, w)] unions of it with the parts that it was separated from, the largest first.

        Seen from above, raised arms look like people of their own.
        """
        return _unions(self.pixels, self.parts)

    def unchanged(self, group: LooseGroup, time_ns: int) -> bool:
        """Whether a group is this candidate, unconvincing and unmoved: a thing that stands there."""
        if self.group is None or self.frames < _LONG or not 0 <= time_ns - self.checked_ns < _CHECK_NS:
            return False
        if self.proven or self.convincing or self.seen_ns == time_ns:
            return False
        moved = float(np.linalg.norm(group.centre - self.group.centre))
        return moved < 0.05 and abs(group.area - self.group.area) < 0.1 * self.group.area

    @property
    def convincing(self) -> bool:
        """Whether it looks so much like a standing person that it need not be seen to come in."""
        stout = self.area > _STOUT * self.shape.crown**2
        whole = self.shape.cut or (self.shape.crown > _TALL and stout)
        slim = self.shape.cut or self.area < _BULKY * self.shape.crown**2
        stands = self.shape.upright and whole and slim
        known = self.recognised and self._knowable
        return (stands or known) and self.area > _LEAST and not self.refused

    @property
    def _knowable(self) -> bool:
        """Whether it convinces once the network takes it for a person: a panel never does."""
        return self.shape.possible and (self.shape.cut or self.shape.crown > _TALL)

    def needs_recognition(self, time_ns: int) -> bool:
        """Whether the network is to be asked: the shape alone does not convince, the last answer is old."""
        if self.area < _LEAST or self.refused or (self.convincing and not self.recognised):
            return False
        if not self._knowable:  # no answer would change anything
            return False
        if self._asked_ns is not None and 0 <= time_ns - self._asked_ns < _CHECK_NS:
            return False
        self._asked_ns = time_ns
        return True

    @property
    def tall(self) -> bool:
        """Whether it is as tall as a standing person, or runs out of the image below."""
        return self.shape.crown > STANDS or self.shape.cut

    @property
    def _stands(self) -> bool:
        """Whether it is as tall as a standing person, and enough of it is seen."""
        return self.shape.crown > STANDS and self.area > _LEAST

    @property
    def imaginable(self) -> bool:
        """Whether it may be a person in any posture, such as bent or kneeling, where no other person is."""
        large = self.shape.crown > _TALL or self.shape.cut or self.area > _LARGE
        return self.shape.human and large and not self.refused

    def due(self, time_ns: int, room_age: float, *, alone: bool, missing: bool) -> bool:
        """Whether a body should be looked for in it now.

        Args:
            room_age: seconds since the room is learnt; no person can prove to have come into a new one.
            alone: whether no other person is followed; any possible person is then better than none.
            missing: whether a person is hidden or away, who may be this one.
        """
        there = self.convincing or (self.imaginable and (alone or self.awaited or self._stands))
        late = self.convincing and self._stands and self.plain > 0.5
        if not (self.proven or late or (room_age < YOUNG and there)):
            return False
        # A person who comes out from behind something is waited for until recognition is possible.
        if missing and self.shape.behind > _BEHIND and 0 <= time_ns - self.first_ns < _PATIENCE_NS:
            return False
        return self._otherwise or not 0 < self._next_ns - time_ns < 2 * _LONGEST_NS

    @property
    def _otherwise(self) -> bool:
        """Whether it is another group than what was searched in vain: furniture came off it."""
        return self.convincing and self.area < _CAME_OFF * self._vain_area

    def settle(self, tried: Candidate) -> None:
        """Takes over from a copy that was tried when the next try is, and what was tried in vain."""
        self._next_ns, self._wait_ns = max(self._next_ns, tried._next_ns), tried._wait_ns
        self._vain_area = tried._vain_area

    def failed(self, time_ns: int) -> None:
        """Puts off the next try, each time for longer, because no body was found."""
        self._next_ns, self._wait_ns = time_ns + self._wait_ns, min(2 * self._wait_ns, _LONGEST_NS)
        self._vain_area = self.area


def _unions(part: Bool, parts: list[Bool]) -> list[Bool]:
    """All parts together, and ``part`` with each other one, the largest first; [] where it is alone."""
    others = [other for other in parts if other is not part]
    if not others or len(others) == len(parts):
        return []
    pairs = [part | other for other in others] if len(others) > 1 else []
    return [np.logical_or.reduce(parts), *sorted(pairs, key=lambda pair: -int(pair.sum()))]


def measured(view: FrameView, pixels: Bool, kind: UInt8) -> tuple[Float, float, tuple[float, float]]:
    """Returns of (h, w) pixels: their (3,) mean in metres, square metres towards the sensor, and two shares.

    The shares are of the pixels before the known room, and before the known or filled-in room.

    Args:
        kind: (h, w) from :meth:`RoomModel.classify`.
    """
    centre, squares, before, plain = _measured(view.points, view.z, kind, pixels)
    camera = view.camera.intrinsics
    return centre, squares / (camera.fx * camera.fy), (before, plain)


@njit(cache=True, nogil=True)
def _measured(points, z, kind, part):
    """See :func:`measured`; returns the sum of z squared in place of the area."""
    points, z, kind = points.reshape(-1, 3), z.ravel(), kind.ravel()
    x, y, deep, squares, before, plain, pixels = 0.0, 0.0, 0.0, 0.0, 0, 0, pixels_of(part)
    for i in pixels:
        x, y, deep = x + points[i, 0], y + points[i, 1], deep + points[i, 2]
        squares += z[i] * z[i]
        before += kind[i] == BEFORE
        plain += kind[i] != UNLIKELY
    count = max(1, len(pixels))
    return np.array([x, y, deep]) / count, squares, before / count, plain / count
