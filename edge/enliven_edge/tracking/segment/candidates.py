"""Candidates: groups of pixels that may be a new person, watched until they have proven it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import BEFORE, ROOM, UNLIKELY, widened, without_walls
from enliven_edge.tracking.segment.columns import parted
from enliven_edge.tracking.segment.person_shape import LARGEST_AREA, SMALLEST_AREA, BlobShape, shape_of
from enliven_edge.tracking.segment.segmentation import LooseGroup, Segments, groups_of

_SAME = 0.45
"""Metres that a candidate's centre moves from frame to frame at most: about the width of a person."""
_FORGET_NS = 400_000_000
"""Nanoseconds after which an unseen candidate is forgotten: it keeps its proof over a few bad frames."""
_MOST = 8
"""Loose groups that are measured in a frame, the largest first: this bounds the cost of a frame."""
_MOST_AT_FIRST = 16
"""The same in a young room, in which much of the room itself is a loose group."""
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
"""Square metres seen at the least of a person a metre tall, from the side; they grow with the height
squared."""
_BULKY = 0.5
"""Square metres seen at the most of a person a metre tall; they grow with the height squared."""
_STANDS = 1.3
"""Metres above the floor from which a crown is that of a standing person: most seated people's are lower."""
_CHECK_NS = 250_000_000
"""Nanoseconds between two looks at a thing that does not change: measuring a shape and asking the network are
the dear parts."""
_REFUSED = 0.4
"""Metres in plan around a thing taken for a person within which no candidate is believed: about its size."""
_REFUSED_NS = 20_000_000_000
"""Nanoseconds for which that holds: longer than the room takes to absorb the thing."""
_BEHIND = 0.25
"""Share of the outline behind something nearer from which a person is still coming out from there."""
_PATIENCE_NS = 800_000_000
"""Nanoseconds for which such a candidate is waited for: time to come out, and to be known again."""
_BACK_OFF_NS = 150_000_000
"""Nanoseconds to the next try after a first try that found no body; each later wait is twice as long."""
_LONGEST_NS = 2_000_000_000
"""Nanoseconds between two tries at most: a real person must not wait for longer."""
_USUAL = 0.5
"""Square metres that are seen of a person, about."""
_PARTED_AREA = 0.45
"""Square metres seen of the smallest group that is parted: less is one person."""
_TOUCHING = 3
"""Pixels within which a fragment touches a group."""
_GAP = 0.6
"""Metres in depth between a fragment and what it touches at most: a raised forearm begins no farther off."""
_ARM = 0.8
"""Metres from the place of touch to nine tenths of a fragment at most: the length of an arm."""
_TIGHTNESS = 0.35
"""Factor on the step in depth within which pixels join, when a person is parted from a wall beside."""
_PIECES = 6
"""Pieces of a group that are looked at, the largest first: this bounds the cost of a frame."""
_FEWEST = 30
"""Pixels of the smallest part that is measured: fewer have no shape."""


Part = tuple[Bool, Bool | None]
"""(h, w) some pixels of a group, and (h, w) those of the walls behind them; None without walls."""


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
        return self.shape.crown > _STANDS or self.shape.cut

    @property
    def _stands(self) -> bool:
        """Whether it is as tall as a standing person, and enough of it is seen."""
        return self.shape.crown > _STANDS and self.area > _LEAST

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
        return not 0 < self._next_ns - time_ns < 2 * _LONGEST_NS

    def settle(self, tried: Candidate) -> None:
        """Takes over the time of the next try from a copy that was tried."""
        self._next_ns, self._wait_ns = max(self._next_ns, tried._next_ns), tried._wait_ns

    def failed(self, time_ns: int) -> None:
        """Puts off the next try, each time for longer, because no body was found."""
        self._next_ns, self._wait_ns = time_ns + self._wait_ns, min(2 * self._wait_ns, _LONGEST_NS)


class Candidates:
    """All candidates, and the places of things that were taken for people."""

    def __init__(self) -> None:
        self._known: list[Candidate] = []
        self._refused: list[tuple[Float, int]] = []

    def clear(self) -> None:
        """Forgets all candidates and all things."""
        self._known.clear()
        self._refused.clear()

    def refuse(self, place: Float, time_ns: int) -> None:
        """Believes no candidate at a (3,) place for a while: a thing there was taken for a person."""
        self._refused.append((place.copy(), time_ns))

    def drop(self, candidate: Candidate) -> None:
        """Removes a candidate that is now a followed person."""
        self._known = [other for other in self._known if other is not candidate]

    @property
    def bystanders(self) -> int:
        """The number of candidates that have proven to be people, but may not perform."""
        return sum(1 for n in self._known if n.bystander and n.proven)

    def update(
        self,
        view: FrameView,
        kind: UInt8,
        segments: Segments,
        admits: Callable[[Float], bool],
        awaits: Callable[[Float], bool],
        *,
        young: bool,
    ) -> list[Candidate]:
        """The candidates in this frame, the likeliest first; ``young``: the room is new."""
        groups = [g for g in segments.loose if g.area > SMALLEST_AREA and g.tall > 0.3]
        groups = groups[: _MOST_AT_FIRST if young else _MOST]
        present = []
        for group in groups:
            same = next((n for n in self._known if n.unchanged(group, view.time_ns)), None)
            if same is not None:
                same.seen_ns = view.time_ns
                present.append(same)
                continue
            mask, shape = _all_of(segments, group, view)
            if not mask.any():  # a person has taken all of it back
                continue
            bare = parted(view.points, mask) if group.area > _PARTED_AREA else [mask]
            parts: list[Part] = [(part, None) for part in bare]
            if young and group.area > _PARTED_AREA:
                shape = shape or shape_of(view, mask, group.area)
                if not replace(shape, area=_USUAL).possible:
                    parts += _beside_walls(view, kind, mask)
            for part, walls in parts:
                if any(_mostly(part, other.pixels) for other in present if other.convincing):
                    continue
                found = self._one(view, kind, part, walls, shape if part is mask else None)
                if found is not None and found not in present:
                    found.parts = bare if walls is None else []
                    found.bystander = not admits(found.centre)
                    found.awaited = awaits(found.centre)
                    found.group = group if len(parts) == 1 else None
                    present.append(found)
        self._known = [n for n in self._known if n in present or 0 <= view.time_ns - n.seen_ns < _FORGET_NS]
        return sorted(present, key=lambda n: -n.shape.likeness)

    def _one(
        self, view: FrameView, kind: UInt8, part: Bool, walls: Bool | None, shape: BlobShape | None
    ) -> Candidate | None:
        """The candidate that a group of pixels is, known or new; None where it has not a person's size.

        Args:
            shape: of the group, where that was measured before; its area is replaced.
        """
        if np.count_nonzero(part) < _FEWEST:
            return None
        centre, area, shares = measured(view, part, kind)
        if not SMALLEST_AREA < area < LARGEST_AREA:
            return None
        shape = shape_of(view, part, area, walls) if shape is None else replace(shape, area=area)
        # Any outline is free in front of walls that were taken away: so the candidate needs a head as well.
        if shape.likeness == 0 or (walls is not None and not shape.upright):
            return None
        known = [n for n in self._known if n.seen_ns != view.time_ns]
        near = min(known, key=lambda n: float(np.linalg.norm(n.centre - centre)), default=None)
        if near is None or np.linalg.norm(near.centre - centre) > _SAME:
            near = Candidate(centre, view.time_ns)
            self._known.append(near)
        near.refused = self._is_refused(centre, view.time_ns)
        near.update(part, centre, shape, area, shares, view.time_ns)
        return near

    def _is_refused(self, centre: Float, time_ns: int) -> bool:
        """Whether a thing at the place was taken for a person not long ago."""
        self._refused = [(at, t) for at, t in self._refused if 0 <= time_ns - t < _REFUSED_NS]
        return any(float(np.linalg.norm((at - centre)[[0, 2]])) < _REFUSED for at, _ in self._refused)


def _mostly(part: Bool, other: Bool) -> bool:
    """Whether more than half of a part's pixels belong to the other, too."""
    return bool(np.count_nonzero(part & other) > 0.5 * np.count_nonzero(part))


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
def _measured(points, z, kind, part):  # type: ignore[no-untyped-def]
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


def _beside_walls(view: FrameView, kind: UInt8, mask: Bool) -> list[Part]:
    """Parts of a group that may be people before a wall in it or beside one."""
    rest = without_walls(view, mask)
    walls = mask & ~rest
    before: list[Part] = [(part, walls) for part in _before_walls(view, kind, rest, walls)]
    return before + [(part, None) for part in _tight(view, kind, mask)]


def _before_walls(view: FrameView, kind: UInt8, rest: Bool, walls: Bool) -> list[Bool]:
    """What is left of a group without its walls: people who stand in front of them, for example."""
    if not walls.any():
        return []
    parts = [part for group in _pieces(view, kind, rest, 1.0) for part in parted(view.points, group)]
    return [part for part in parts if quantile(np.sort(view.points[..., 1][part]), 0.99) > _STANDS]


def _tight(view: FrameView, kind: UInt8, mask: Bool) -> list[Bool]:
    """The parts of a group that are joined by smaller steps in depth: a person beside a wall, for example."""
    return _pieces(view, kind, mask, _TIGHTNESS)


def _pieces(view: FrameView, kind: UInt8, mask: Bool, tightness: float) -> list[Bool]:
    """The largest parts of a mask that are joined by steps in depth, scaled by ``tightness``."""
    places = pixels_of(mask & (kind != ROOM) & (kind != UNLIKELY))
    labels, count = groups_of(view.z, places, tightness)
    size = np.bincount(labels.ravel()[places], minlength=count + 1)
    return [labels == index for index in np.argsort(-size)[:_PIECES] if size[index] > 100]


def _all_of(segments: Segments, main: LooseGroup, view: FrameView) -> tuple[Bool, BlobShape | None]:
    """(h, w) the main group with the fragments that belong to it, unless it is more like a person without.

    Returns its shape too, where that was measured to decide.
    """
    bare = segments.group(main)
    mask = _with_fragments(segments, main, bare, view)
    if mask is bare or main.area >= LARGEST_AREA:
        return mask, None
    shape = shape_of(view, mask, main.area)
    if shape.upright:
        return mask, shape
    without = shape_of(view, bare, main.area)
    return (bare, without) if without.upright else (mask, shape)


def _with_fragments(segments: Segments, main: LooseGroup, bare: Bool, view: FrameView) -> Bool:
    """(h, w) the main group and smaller ones that touch it within reach, such as a forearm held forward.

    Args:
        bare: (h, w) the main group's pixels; returned where there are no others.
    """
    mask = bare
    top, left, bottom, right = main.box
    near = [
        other
        for other in segments.loose
        if other.label != main.label
        and other.area < 0.6 * main.area
        and other.box[0] <= bottom + _TOUCHING
        and other.box[2] >= top - _TOUCHING
        and other.box[1] <= right + _TOUCHING
        and other.box[3] >= left - _TOUCHING
    ]
    for other in near:
        # What touches it is near its box: the rest of the image need not be searched.
        top, left, bottom, right = other.box
        window = np.s_[
            max(0, top - _TOUCHING) : bottom + _TOUCHING, max(0, left - _TOUCHING) : right + _TOUCHING
        ]
        part, points = segments.labels[window] == other.label, view.points[window]
        contact = widened(part, _TOUCHING) & mask[window]
        if contact.any() and _reaches(points[part], points[contact]):
            mask = mask.copy() if mask is bare else mask
            mask[window] |= part
    return mask


def _reaches(part: Float, contact: Float) -> bool:
    """Whether a fragment begins where it touches and ends within an arm's length of there, unlike a wall.

    Args:
        part, contact: (N, 3) and (M, 3) metres, world frame, of the fragment and of what it touches.
    """
    gap = _median(part[:, 2]) - _median(contact[:, 2])
    if abs(gap) >= _GAP:
        return False
    away = part - contact.mean(0)
    return quantile(np.sort(np.sqrt((away * away).sum(1))), 0.9) < _ARM


def _median(values: Float) -> float:
    return float(quantile(np.sort(values), 0.5))
