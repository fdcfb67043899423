"""One of the people who are followed: the fit of their body, who they are, and whether they are in sight."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.kernels import njit
from enliven.person import Joint
from enliven_edge.tracking.body_model import Posture, model
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import FEWEST_PIXELS, Follower
from enliven_edge.tracking.people.identity import Looks, percentile

_LOOK_EVERY, _LOOK_OFTEN = 5, 10
_TRAVELLED, _MOVED = 0.15, 0.1
_FASTEST, _SLOWING = 2.0, 0.5
_UNSURE, _SPREADING = 0.35, 0.7
_FAITH, _SUREST, _VAGUE, _BARELY_KNOWN = 0.1, 6, 0.4, 20
_DOUBT, _THING, _MAYBE, _HARDLY_SEEN = 0.2, 0.4, 0.8, 3
"""Weight of a frame in the mean probability of being a person; that below which somebody new is none, and
below which somebody seen in so few frames may be none."""
_PLAIN, _PLAIN_FRAMES = 0.85, 10
"""Who is so likely a person at the mean for so many frames is one, whatever their later postures."""
_HEAD_ABOUT = 0.18
"""Metres in plan from the head's joint within which the top of the head is."""
UNDECIDED = 0


class Person:
    """Somebody who is followed.

    Attributes:
        id: their number; 0 while it is not decided who of those who left has come back.
        follower: the fit.
        looks: what they are known by.
        seen_ns: when they were last seen well.
        found_ns: when they were found.
        hidden_ns: since when something stands before them, or None.
        travelled: whether they have moved as no thing does.
        doubted: whether they have yet to move to be believed.
        shapely: whether they were found in a person's outline, a head above shoulders.
    """

    def __init__(self, identity: int, follower: Follower, looks: Looks, time_ns: int) -> None:
        self.id, self.follower, self.looks = identity, follower, looks
        self.seen_ns = self.found_ns = time_ns
        self.hidden_ns: int | None = None
        self.travelled = self.doubted = self.shapely = False
        self._first_joints: Float | None = None
        self._start = follower.posture.position.copy()
        self._centre: Float | None = None
        self._velocity = np.zeros(3)
        self._time_ns = time_ns
        self._turn = 0
        self._clear = self._somebody = 1.0
        self._plain = 0

    @property
    def place(self) -> Float:
        """(3,) the hip centre, world frame."""
        return self.follower.posture.position

    @property
    def vague(self) -> bool:
        """Whether hardly any joint has been seen since they were found, or the network doubts that they are
        one: a thing, most likely."""
        known = self.shapely or self.travelled or self._plain >= _PLAIN_FRAMES
        odd = self._somebody < _THING and not known
        return (self._clear < _VAGUE or odd) and self.looks.weight < _BARELY_KNOWN

    @property
    def fleeting(self) -> bool:
        """Whether it is not worth waiting for them when they are hidden: hardly seen, and maybe a thing."""
        return self._somebody < _MAYBE and not self.travelled and self.looks.weight < _HARDLY_SEEN

    def expected(self) -> Posture:
        """Where they are expected in the next frame."""
        return self.follower.posture if self.hidden_ns is not None else self.follower.predicted()

    @property
    def hidden(self) -> bool:
        """Whether they were not seen in the last frame."""
        return self.hidden_ns is not None

    def hidden_for(self, time_ns: int) -> float:
        """Seconds for which they were not seen; 0 while they are."""
        return 0.0 if self.hidden_ns is None else (time_ns - self.hidden_ns) * 1e-9

    def uncertainty(self, time_ns: int) -> float:
        """Metres within which they must be; it grows while they are not seen."""
        return _UNSURE + _SPREADING * max(0.0, (time_ns - self.seen_ns) * 1e-9)

    def follow(self, view: FrameView, pixels: Bool, *, whole: bool) -> bool:
        """Fits the frame; whether it shows them well.

        Args:
            whole: nothing stands before them, and the image does not end at them.
        """
        before = self.place.copy()
        good = self.follower.follow(view, pixels)
        surest = sum(sorted(self.follower.confidence.tolist())[-_SUREST:]) / _SUREST
        self._clear += _FAITH * (surest - self._clear)
        self._somebody += _DOUBT * (self.follower.somebody - self._somebody)
        self._plain += self._somebody > _PLAIN
        if good:
            self._seen(view, pixels, self.place - before, whole=whole)
        return good

    def coast(self, view: FrameView, pixels: Bool) -> None:
        """Goes along with their pixels, in a frame that is not fitted."""
        centre = _centre(view, pixels)
        if centre is not None and self._centre is not None:
            step = centre - self._centre
            step[1] = 0.0
            self.follower.carry(step * min(1.0, 0.15 / max(1e-9, math.hypot(*step))))
            self.seen_ns = view.time_ns
        self._centre = centre

    def hide(self, time_ns: int) -> None:
        """Is not seen: goes on as they went, slower and slower, and nothing is known of the joints."""
        if self.hidden_ns is None:
            self.hidden_ns = time_ns
        seconds = min(0.2, max(0.0, (time_ns - self._time_ns) * 1e-9))
        self._velocity = self._velocity * math.exp(-seconds / _SLOWING)
        self.follower.carry(self._velocity * seconds)
        self.follower.hide()
        self._time_ns, self._centre = time_ns, None

    def replaced(self, follower: Follower, time_ns: int) -> None:
        """Was found again by a new fit."""
        self.follower, self.hidden_ns = follower, None
        if self.looks.weight > _LOOK_OFTEN:
            follower.posture.lengths = self.looks.lengths.copy()
        self._velocity, self._centre = np.zeros(3), None
        self.seen_ns = self._time_ns = time_ns

    def _seen(self, view: FrameView, pixels: Bool, step: Float, *, whole: bool) -> None:
        """Remembers what a good frame shows."""
        seconds = (view.time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < 0.5:
            velocity = step / seconds
            velocity[1] = 0.0
            velocity *= min(1.0, _FASTEST / max(1e-9, math.hypot(*velocity)))
            self._velocity += min(1.0, seconds / 0.15) * (velocity - self._velocity)
        self._time_ns = self.seen_ns = view.time_ns
        self.hidden_ns = None
        self.travelled = self.travelled or math.dist(self.place, self._start) > _TRAVELLED
        self._turn += 1
        self._centre = None
        if self._turn % _LOOK_EVERY != 1 and self.looks.weight > _LOOK_OFTEN:
            return
        self._centre = _centre(view, pixels)
        if whole:
            self.looks.see(self.follower.posture.lengths, self._crown(view, pixels))
        if self.doubted:
            self._watch_limbs()

    def _watch_limbs(self) -> None:
        """Believes who moves: a limb that is seen goes farther than noise carries it."""
        joints, sure = self.follower.posture.joints(), self.follower.confidence > 0.5
        if self._first_joints is None:
            self._first_joints = joints
        away = np.linalg.norm(joints - self._first_joints, axis=1)
        if self.travelled or np.count_nonzero(sure & (away > _MOVED)) >= 2:
            self.doubted = False

    def _crown(self, view: FrameView, pixels: Bool) -> float | None:
        """Metres above the floor of the top of the head, where they stand with the hands below it."""
        joints, sure = self.follower.posture.joints(), self.follower.confidence
        head = joints[Joint.HEAD]
        risen = head - joints[Joint.HIP_CENTER]
        upright = risen[1] > 0.9 * math.hypot(*risen)
        hands = max(float(joints[j, 1]) for j in (Joint.HAND_LEFT, Joint.HAND_RIGHT))
        if sure[Joint.HEAD] < 0.5 or not upright or hands > head[1] - 0.1:
            return None
        heights = heights_beside(view.points, pixels, head, _HEAD_ABOUT)
        return percentile(heights, 0.99) if len(heights) > 20 else None


def _centre(view: FrameView, pixels: Bool) -> Float | None:
    """(3,) the mean of somebody's points, None where there are too few."""
    if np.count_nonzero(pixels) < FEWEST_PIXELS:
        return None
    return np.asarray(mean_point(view.points, pixels))


@njit(cache=True, nogil=True)
def mean_point(points, pixels):  # type: ignore[no-untyped-def]
    """(3,) the mean of (h, w, 3) points on the (h, w) pixels, one at least."""
    x, y, z, count = 0.0, 0.0, 0.0, 0
    for v in range(pixels.shape[0]):
        for u in range(pixels.shape[1]):
            if pixels[v, u]:
                x, y, z = x + points[v, u, 0], y + points[v, u, 1], z + points[v, u, 2]
                count += 1
    return np.array([x, y, z]) / count


@njit(cache=True, nogil=True)
def heights_beside(points, pixels, place, radius):  # type: ignore[no-untyped-def]
    """(N,) heights of (h, w, 3) points on the (h, w) pixels, of those within a radius of a place in plan."""
    heights, count = np.empty(np.count_nonzero(pixels)), 0
    for v in range(pixels.shape[0]):
        for u in range(pixels.shape[1]):
            if not pixels[v, u]:
                continue
            x, z = points[v, u, 0] - place[0], points[v, u, 2] - place[2]
            if x * x + z * z < radius * radius:
                heights[count] = points[v, u, 1]
                count += 1
    return heights[:count]


_SAMPLES, _BEFORE = 3, 0.12
"""Samples along a capsule, and metres before its surface from which something hides it."""
_TRUNK = np.flatnonzero(model.CAPSULES.frame <= model.HEAD)


def sight(view: FrameView, posture: Posture, owner: Int, index: int) -> tuple[float, float]:
    """The shares of a body that stand behind something else, and outside the image.

    Args:
        owner: (h, w) whose the pixels are; a person's own arm hides nothing.
        index: which owner is this person.
    """
    inside, covered, own = _seen(view, posture, owner, index, slice(None))
    hidden, shown = np.count_nonzero(covered & ~own), np.count_nonzero(inside)
    return hidden / len(own), 1.0 - shown / len(own)


def trunk_shown(view: FrameView, posture: Posture, pixels: Bool) -> float:
    """Of the trunk and the head that the image could show, the share that the (h, w) ``pixels`` do show."""
    inside, covered, own = _seen(view, posture, pixels.astype(np.int64), 1, _TRUNK)
    due = inside & ~(covered & ~own)
    return float((own & due).sum() / len(own)) if due.mean() < 0.25 else float(own[due].mean())


def _seen(
    view: FrameView, posture: Posture, owner: Int, mine: int, capsules: slice | Int
) -> tuple[Bool, Bool, Bool]:
    """(S,) of samples along the capsules: in the image, behind something, and on the pixels of ``mine``.

    Args:
        owner: (h, w) whose the pixels are.
    """
    ends, radii = (each[capsules] for each in posture.capsules())
    out = _samples(ends, radii, view.z, owner, mine, view.camera.camera, view.world_from_camera)
    return out[0], out[1], out[2]


@njit(cache=True, nogil=True)
def _samples(ends, radii, depth, owner, mine, camera, pose):  # type: ignore[no-untyped-def]
    """(3, S) see :func:`_seen`."""
    height, width = depth.shape
    out = np.zeros((3, len(ends) * _SAMPLES), np.bool_)
    for n in range(out.shape[1]):
        c, t = n // _SAMPLES, (n % _SAMPLES) / (_SAMPLES - 1)
        x, y, z = 0.0, 0.0, 0.0
        for b in range(3):
            offset = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b]) - pose[b, 3]
            x += pose[b, 0] * offset
            y += pose[b, 1] * offset
            z += pose[b, 2] * offset
        if z <= 0.1:
            continue
        u = int(np.floor(camera[0] * x / z + camera[2] + 0.5))
        v = int(np.floor(camera[1] * y / z + camera[3] + 0.5))
        if 0 <= u < width and 0 <= v < height:
            seen, radius = depth[v, u], max(radii[c, 0], radii[c, 1])
            out[0, n], out[2, n] = True, owner[v, u] == mine
            out[1, n] = 0.0 < seen < z - radius - _BEFORE
    return out
