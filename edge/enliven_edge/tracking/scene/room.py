"""The background model: the depth of the room without people at every working pixel, kept up to date."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, UInt8
from enliven_edge.tracking.frame import FrameView, known_pixels
from enliven_edge.tracking.scene.room_kernels import (
    LearningRate,
    classified,
    empty_room,
    guard,
    learn_frame,
    widened,
)
from enliven_edge.tracking.scene.room_prior import background_fill
from enliven_edge.tracking.settings import RoomSettings

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
        self.age = 0.0
        self._state = empty_room(shape)
        self._fill_z = np.zeros(shape)
        self._learnt_ns: int | None = None
        self._filled_ns: int | None = None
        self._known = self._stale = 0

    @property
    def z(self) -> Float:
        """(h, w) metres; 0 where the room was never seen."""
        return self._state.z

    def classify(self, view: FrameView, near: float, far: float, floor_band: float) -> UInt8:
        """(h, w) what every pixel is: ROOM, BEFORE, UNSEEN or UNLIKELY."""
        self._fill(view, floor_band)
        return np.asarray(classified(view.z, view.points, self.z, self._fill_z, near, far, floor_band))

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
        rate = LearningRate(
            step,
            self.settings.absorb_after,
            self.settings.clear_after,
            seen_for,
            _DARK if measured else np.inf,
        )
        compared, nearer, farther = learn_frame(z, widened(person, 2), hold, self._state, rate)
        return Agreement(compared, nearer / max(1, compared), farther / max(1, compared))

    def guard(self, owner: AnyArray, ids: AnyArray, z: Float) -> None:
        """Remembers the last place of each person.

        Args:
            owner: (h, w) the person of each pixel as an index into ``ids``, or -1.
            ids: (K,) the people's ids.
        """
        guard(owner, ids, z, self._state.guarded, self._state.guard_z)

    @property
    def still(self) -> Bool:
        """(h, w) the pixels that kept their depth for longer than people do, where no room is known."""
        return np.asarray((self.z == 0.0) & (self._state.still > _STILL))

    def absorb(self, where: Bool) -> None:
        """Learns as the room what the (h, w) pixels show."""
        self.z[where] = self._state.still_z[where]

    def forget(self, where: Bool) -> None:
        """Learns the room anew at the (h, w) pixels."""
        self.z[where] = 0.0
        self._state.waited[where] = self._state.away[where] = 0.0

    def release(self, identity: int) -> None:
        """Ends the guard of a person's last place: the person is seen elsewhere, or gone for good."""
        self._state.guarded[self._state.guarded == identity] = -1

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
