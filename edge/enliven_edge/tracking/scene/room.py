"""The background model: the depth of the room without people at every working pixel, kept up to date."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, UInt8
from enliven.kernels import njit
from enliven_edge.tracking.frame import FrameView, known_pixels
from enliven_edge.tracking.scene.room_prior import background_fill
from enliven_edge.tracking.settings import RoomSettings

ROOM = 0
"""Class of a pixel that shows the room, or nothing."""
BEFORE = 1
"""Class of a pixel that shows something in front of the known room."""
UNSEEN = 2
"""Class of a pixel where the room was never seen, nearer than the room around it."""
UNLIKELY = 3
"""Class of a pixel where the room was never seen, about as far as the room around it: hardly a person."""
_FLICKERS = 6.0
"""Times that a pixel has come to the same nearer depth and gone: more often it is an edge of the room, which
is as near as the nearer depth."""
_FILL_EVERY_NS = 300_000_000
"""Nanoseconds between two looks at how much of the room is known: both pass the whole image."""
_FILL_SHARE = 0.002
"""Share of the image by which the known part must have changed for the fill to be computed anew."""
_FILL_AFTER = 6
"""Looks after which the fill is computed anew without such a change: known depths change too."""
_TELLS = 0.05
"""Share of the image that is known of the room from which it tells what was never seen: less is a fringe of a
person before a hall too deep for the sensor, and the person would be taken for what lies about it."""
_AT_ONCE = 0.1
"""Seconds at the start in which everything is learnt at once: the whole room is new."""
_SEEN_FOR = 0.25
"""Seconds for which a depth must stay the same to be learnt later, where the room was never seen: a lost arm
in front of a hall too deep for the sensor moves on sooner."""
_DARK = 2.0
"""Seconds without a measurement after which the room is forgotten at a pixel: depth flickers for less."""
_MEASURED = 0.5
"""Share of the known room that must be measured meanwhile: with less the lens is covered."""
_STILL = 0.5
"""Seconds for which a pixel beside a person has one depth where it is furniture: people who stand sway."""
_LONGEST_STEP = 0.5
"""Seconds: a gap in the stream ages nothing by more."""


@dataclass(frozen=True)
class Agreement:
    """How a frame agrees with the room that was known.

    Attributes:
        compared: pixels that are known in both and belong to no person.
        nearer, farther: the shares of them that are plainly nearer or farther than the room.
    """

    compared: int
    nearer: float
    farther: float


class RoomModel:
    """The room's depth, learnt from what is not a person.

    A pixel's depth follows small changes slowly. Farther depth that stays for ``clear_after`` seconds
    replaces it (something was taken away; a flickering edge never stays). Nearer depth that stays for
    ``absorb_after`` seconds is absorbed (something was put there), but not at the last place of a person who
    has not been seen elsewhere since: the person may stand still there until the room is seen again. Depth
    that is no longer measured is forgotten after a while.
    """

    def __init__(self, shape: tuple[int, int], settings: RoomSettings | None = None) -> None:
        self.settings = settings or RoomSettings()
        self.z = np.zeros(shape)
        self.age = 0.0
        self._fill_z = np.zeros(shape)
        self._nearer, self._waited, self._away = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self._flips = np.zeros(shape)
        self._still, self._still_z = np.zeros(shape), np.zeros(shape)
        self._guarded, self._guard_z = np.full(shape, -1, np.int64), np.zeros(shape)
        self._learnt_ns: int | None = None
        self._filled_ns: int | None = None
        self._known = self._stale = 0

    def classify(self, view: FrameView, near: float, far: float, floor_band: float) -> UInt8:
        """(h, w) what every pixel is: ROOM, BEFORE, UNSEEN or UNLIKELY."""
        self._fill(view, floor_band)
        return np.asarray(_classify(view.z, view.points, self.z, self._fill_z, near, far, floor_band))

    def learn(
        self, z: Float, person: Bool, time_ns: int | None = None, hold: Bool | None = None
    ) -> Agreement:
        """Takes in a frame without its ``person`` pixels and two pixels around them.

        Args:
            hold: (h, w) pixels of possible people: what was never seen there is not learnt at once.
        """
        step = 1 / 30 if time_ns is None or self._learnt_ns is None else (time_ns - self._learnt_ns) * 1e-9
        step = min(max(step, 0.0), _LONGEST_STEP)
        self._learnt_ns = time_ns
        self.age += step
        hold = np.zeros(z.shape, bool) if hold is None else hold
        seen_for = _SEEN_FOR if self.age > _AT_ONCE else 0.0
        measured = known_pixels(z) > _MEASURED * known_pixels(self.z)
        compared, nearer, farther = _learn(
            self.z, z, widened(person, 2), hold, self._nearer, self._waited, self._away, self._guarded,
            self._guard_z, self._flips, self._still, self._still_z, step, self.settings.absorb_after,
            self.settings.clear_after, seen_for, _DARK if measured else np.inf,
        )  # fmt: skip
        return Agreement(compared, nearer / max(1, compared), farther / max(1, compared))

    def guard(self, owner: AnyArray, ids: AnyArray, z: Float) -> None:
        """Remembers the last place of each person.

        Args:
            owner: (h, w) the person of each pixel as an index into ``ids``, or -1.
            ids: (K,) the people's ids.
        """
        _guard(owner, ids, z, self._guarded, self._guard_z)

    @property
    def still(self) -> Bool:
        """(h, w) the pixels that kept their depth for longer than people do, where no room is known."""
        return np.asarray((self.z == 0.0) & (self._still > _STILL))

    def absorb(self, where: Bool) -> None:
        """Learns as the room what the (h, w) pixels show."""
        self.z[where] = self._still_z[where]

    def forget(self, where: Bool) -> None:
        """Learns the room anew at the (h, w) pixels."""
        self.z[where] = 0.0
        self._waited[where] = self._away[where] = 0.0

    def release(self, identity: int) -> None:
        """Ends the guard of a person's last place: the person is seen elsewhere, or gone for good."""
        self._guarded[self._guarded == identity] = -1

    def _fill(self, view: FrameView, floor_band: float) -> None:
        """Fills in what was never seen, anew when enough has changed."""
        time_ns = view.time_ns
        if self._filled_ns is None or not 0 <= time_ns - self._filled_ns < _FILL_EVERY_NS:
            known = int(np.count_nonzero(self.z))
            if abs(known - self._known) > _FILL_SHARE * self.z.size or self._stale > _FILL_AFTER:
                self._fill_z = np.zeros_like(self.z)
                if known >= _TELLS * self.z.size:
                    ray, pose = view.camera.ray, view.world_from_camera
                    self._fill_z = background_fill(self.z, ray, pose, floor_band)
                self._known, self._stale = known, 0
            self._stale += 1
            self._filled_ns = time_ns if known else None


@njit(cache=True, nogil=True, error_model="numpy")
def _classify(z, points, room, fill, near, far, floor_band):  # type: ignore[no-untyped-def]
    """See :meth:`RoomModel.classify`; without a branch, so that many pixels are compared at once."""
    height, width = z.shape
    out = np.empty((height, width), np.uint8)
    for v in range(height):
        for u in range(width):
            d, known, likely = z[v, u], room[v, u], fill[v, u]
            margin = 0.05 + 0.012 * d * d
            seen = BEFORE if d < known - margin else ROOM
            never_seen = UNSEEN if (likely == 0.0) | (d < likely - margin) else UNLIKELY
            counts = (d > near) & (d < far) & (points[v, u, 1] > floor_band)
            out[v, u] = (seen if known > 0.0 else never_seen) if counts else ROOM
    return out


@njit(cache=True, nogil=True)
def _learn(
    room,
    z,
    person,
    hold,
    nearer,
    waited,
    away,
    guarded,
    guard_z,
    flips,
    still,
    still_z,
    step,
    absorb_after,
    clear_after,
    seen_for,
    dark,
):  # type: ignore[no-untyped-def]
    """Learns one frame; returns the numbers of pixels compared, plainly nearer and plainly farther."""
    height, width = z.shape
    compared, count_nearer, count_farther = 0, 0, 0
    follow = min(1.0, 0.3 * step)
    for v in range(height):
        for u in range(width):
            d = z[v, u]
            if room[v, u] == 0.0:
                _stays(still, still_z, v, u, d, step)
            if person[v, u]:
                continue
            if d <= 0.0:
                _not_measured(room, waited, away, v, u, step, dark)
                continue
            if room[v, u] == 0.0:
                same = abs(d - nearer[v, u]) <= 0.04 + 0.010 * d * d
                if not hold[v, u] and (seen_for == 0.0 or (same and waited[v, u] + step > seen_for)):
                    room[v, u], waited[v, u] = d, 0.0
                    continue
            else:
                compared += 1
            margin = 0.04 + 0.010 * d * d
            if room[v, u] > 0.0 and abs(d - room[v, u]) <= margin:
                room[v, u] += follow * (d - room[v, u])
                # The sign of the number of flips is where the pixel was last.
                flips[v, u] = -abs(flips[v, u]) * (1.0 - 0.1 * step)
                waited[v, u] = max(0.0, waited[v, u] - step)
                away[v, u], guarded[v, u] = 0.0, -1
            elif room[v, u] > 0.0 and d > room[v, u]:
                count_farther += 1
                guarded[v, u] = -1
                waited[v, u] = max(0.0, waited[v, u] - step)
                away[v, u] += step
                if away[v, u] > clear_after:
                    # What was there comes back sooner than something new: an edge that flickers slowly.
                    nearer[v, u], waited[v, u] = room[v, u], 0.7 * absorb_after
                    room[v, u], away[v, u] = d, 0.0
            else:
                count_nearer += room[v, u] > 0.0
                away[v, u] = 0.0
                if guarded[v, u] >= 0 and abs(d - guard_z[v, u]) <= 2.0 * margin:
                    continue
                if flips[v, u] <= 0.0 and not hold[v, u] and abs(d - nearer[v, u]) <= 2.0 * margin:
                    flips[v, u] = 1.0 - flips[v, u]
                    if flips[v, u] > _FLICKERS and room[v, u] > 0.0:
                        room[v, u], flips[v, u] = nearer[v, u], 0.0
                        continue
                if abs(d - nearer[v, u]) <= margin:
                    waited[v, u] += step
                    nearer[v, u] += 0.2 * (d - nearer[v, u])
                    if waited[v, u] > absorb_after:
                        room[v, u], waited[v, u] = nearer[v, u], 0.0
                else:
                    waited[v, u] -= 2.0 * step
                    if waited[v, u] <= 0.0:
                        nearer[v, u], waited[v, u] = d, 0.0
    return compared, count_nearer, count_farther


@njit(cache=True, nogil=True)
def _stays(still, still_z, v, u, d, step):  # type: ignore[no-untyped-def]
    """Updates how long a pixel, a person's or not, has had the same depth within the noise."""
    if abs(d - still_z[v, u]) <= 0.01 + 0.004 * d * d:
        still[v, u] += step
        still_z[v, u] += 0.1 * (d - still_z[v, u])
    else:
        still[v, u] -= 2.0 * step
        if still[v, u] <= 0.0:
            still_z[v, u], still[v, u] = d, 0.0


@njit(cache=True, nogil=True)
def _not_measured(room, waited, away, v, u, step, dark):  # type: ignore[no-untyped-def]
    """Updates a pixel without a measurement: the room is forgotten there after ``dark`` seconds."""
    if room[v, u] == 0.0:
        waited[v, u] = max(0.0, waited[v, u] - 2.0 * step)
    elif dark < np.inf:
        away[v, u] += step
        if away[v, u] > dark:
            room[v, u], away[v, u], waited[v, u] = 0.0, 0.0, 0.0


@njit(cache=True, nogil=True)
def _guard(owner, ids, z, guarded, guard_z):  # type: ignore[no-untyped-def]
    """See :meth:`RoomModel.guard`; a followed person guards only the pixels of this frame."""
    height, width = owner.shape
    for v in range(height):
        for i in ids:
            for u in range(width):
                guarded[v, u] = -1 if guarded[v, u] == i else guarded[v, u]
        for u in range(width):
            if owner[v, u] >= 0:
                guarded[v, u], guard_z[v, u] = ids[owner[v, u]], z[v, u]


@njit(cache=True, nogil=True)
def widened(mask, pixels):  # type: ignore[no-untyped-def]
    """The (h, w) mask grown by a square of ``pixels`` to every side.

    Unites each row with the rows around it, and then with itself moved by up to so many pixels.
    """
    height, width = mask.shape
    out, row = np.zeros((height, width), np.bool_), np.empty(width + 2 * pixels, np.bool_)
    middle = row[pixels : pixels + width]
    for v in range(height):
        row[:] = False
        for near in range(max(0, v - pixels), min(height, v + pixels + 1)):
            beside = mask[near]
            for u in range(width):
                middle[u] |= beside[u]
        made = out[v]
        for first in range(2 * pixels + 1):
            moved = row[first : first + width]
            for u in range(width):
                made[u] |= moved[u]
    return out
