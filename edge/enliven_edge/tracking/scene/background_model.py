"""The background model: the depth of the scene without people, at every pixel of the working image.

Each frame updates it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, UInt8
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.frame.reduction import known_pixels
from enliven_edge.tracking.scene.background_fill import background_fill
from enliven_edge.tracking.scene.background_kernels import (
    LearningRate,
    classify_pixels,
    dilate,
    empty_background,
    guard_people,
    learn_frame,
)
from enliven_edge.tracking.settings import BackgroundSettings

_FILL_INTERVAL_NS = 300_000_000
"""Nanoseconds between two checks of the amount of known background. The interval limits the cost, because a
check and a fill process the whole image.
"""
_FILL_CHANGE = 0.002
"""If the known fraction of the image changes by more than this value, the background is filled again."""
_FILL_CHECKS = 6
"""Number of checks after which the background is filled again in any case, because known depths change
too."""
_MIN_FILL_FRACTION = 0.05
"""Minimum fraction of known background pixels before unseen pixels are filled in. Below it the visible
background may be only the outline of a person in front of a hall too deep for the sensor. The person would
then be taken for background."""
_STARTUP_S = 0.1
"""Seconds after the start in which every depth is learnt without delay, because the whole background is
new."""
_CONSTANT_FOR_S = 0.25
"""Seconds for which a depth must stay constant before it is learnt at a pixel without known background.
Without this delay, an arm that the fit has lost would be learnt in a hall too deep for the sensor. Arms move
sooner.
"""
_FORGET_AFTER_S = 2.0
"""Seconds without a measurement after which a pixel's background is forgotten. Flickering pixels have shorter
gaps."""
_MIN_MEASURED = 0.5
"""Pixels are forgotten only if at least this fraction of the known background is measured. If less is
measured, the lens is probably covered.
"""
_FURNITURE_AFTER_S = 0.5
"""Seconds of constant depth after which a pixel next to a person counts as furniture. Standing people sway,
so their depth varies."""
_DEPTH_NOISE_M = 0.04
"""Difference in metres up to which two depths near the sensor are the same."""
_DEPTH_NOISE_PER_M = 0.01
"""Increase of ``_DEPTH_NOISE_M`` with the square of the depth, in 1/metres: the noise of depth sensors."""
_MAX_TIME_STEP_S = 0.5
"""Maximum time step in seconds. A longer gap in the stream counts as a step of this length."""


@dataclass(frozen=True)
class Agreement:
    """How well a frame agreed with the background model before the frame was learnt.

    Attributes:
        compared: number of pixels with depth in both frame and model that do not belong to a person.
        nearer, farther: fractions of these pixels that are clearly nearer or farther than the background.
    """

    compared: int
    nearer: float
    farther: float


class BackgroundModel:
    """The background model, learnt from pixels that do not belong to a person.

    A pixel's depth follows small changes slowly. If farther depth stays for ``clear_after`` seconds, an
    object was removed, and the farther depth becomes the background. (A flickering edge never stays.) If
    nearer depth stays for ``absorb_after`` seconds, an object was added, and the nearer depth becomes the
    background. The last position of a person is guarded against this, because the person may still be there.
    The guard ends when the person is seen elsewhere or the background is visible again. Depth that is no
    longer measured is forgotten after a while.
    """

    def __init__(self, shape: tuple[int, int], settings: BackgroundSettings | None = None) -> None:
        self.settings = settings or BackgroundSettings()
        self.age = 0.0
        self._state = empty_background(shape)
        self._fill_z = np.zeros(shape)
        self._learnt_ns: int | None = None
        self._filled_ns: int | None = None
        self._known = self._stale = 0

    @property
    def z(self) -> Float:
        """Returns the background's depth (h, w) in metres, with 0 for never-seen background."""
        return self._state.z

    def classify(self, view: FrameView, near: float, far: float, floor_band: float) -> UInt8:
        """Returns the class (h, w) of every pixel: BACKGROUND, FOREGROUND, UNSEEN or UNLIKELY."""
        self._fill_unseen(view, floor_band)
        return np.asarray(classify_pixels(view.z, view.points, self.z, self._fill_z, near, far, floor_band))

    def learn(
        self, z: Float, person: Bool, time_ns: int | None = None, hold: Bool | None = None
    ) -> Agreement:
        """Learns from a frame without its ``person`` pixels and a border of two pixels around them.

        Args:
            z: (h, w) metres.
            person: (h, w) the pixels that are not learnt.
            time_ns: the frame's time. If None, it is 1/30 s after the previous frame.
            hold: (h, w) pixels of possible people. At these pixels, unknown background is not learnt at once.
        """
        step = 1 / 30 if time_ns is None or self._learnt_ns is None else (time_ns - self._learnt_ns) * 1e-9
        step = min(max(step, 0.0), _MAX_TIME_STEP_S)
        self._learnt_ns = time_ns
        self.age += step
        hold = np.zeros(z.shape, bool) if hold is None else hold
        seen_for = _CONSTANT_FOR_S if self.age > _STARTUP_S else 0.0
        measured = known_pixels(z) > _MIN_MEASURED * known_pixels(self.z)
        rate = LearningRate(
            step,
            self.settings.absorb_after,
            self.settings.clear_after,
            seen_for,
            _FORGET_AFTER_S if measured else np.inf,
        )
        compared, nearer, farther = learn_frame(z, dilate(person, 2), hold, self._state, rate)
        return Agreement(compared, nearer / max(1, compared), farther / max(1, compared))

    def guard(self, owner: AnyArray, ids: AnyArray, z: Float) -> None:
        """Guards the last position of each person, which is then not learnt as background.

        Args:
            owner: (h, w) the person of each pixel as an index into ``ids``, or -1.
            ids: (K,) the people's ids.
            z: (h, w) metres.
        """
        guard_people(owner, ids, z, self._state.guarded, self._state.guard_z)

    def still_pixels(self, z: Float) -> Bool:
        """Returns the pixels (h, w) without known background that keep their depth longer than people can.

        Pixels that show another depth in this frame are left out. So a motionless person does not become
        background when another person passes in front.

        Args:
            z: (h, w) metres of this frame.
        """
        is_still = (self.z == 0.0) & (self._state.still > _FURNITURE_AFTER_S)
        is_still[is_still] = np.abs(z[is_still] - self._state.still_z[is_still]) < (
            _DEPTH_NOISE_M + _DEPTH_NOISE_PER_M * z[is_still] ** 2
        )
        return np.asarray(is_still)

    def absorb(self, where: Bool) -> None:
        """Learns the recent constant depth as background at the (h, w) pixels ``where``."""
        self.z[where] = self._state.still_z[where]

    def forget(self, where: Bool) -> None:
        """Forgets the background at the (h, w) pixels ``where``, so that it is learnt again."""
        self.z[where] = 0.0
        self._state.waited[where] = self._state.away[where] = 0.0

    def release(self, identity: int) -> None:
        """Ends the guard of a person's last position, because the person is visible elsewhere or has left for
        good.
        """
        self._state.guarded[self._state.guarded == identity] = -1

    def _fill_unseen(self, view: FrameView, floor_band: float) -> None:
        """Fills in never-seen background, if the known background has changed enough since the last fill."""
        time_ns = view.time_ns
        if self._filled_ns is None or not 0 <= time_ns - self._filled_ns < _FILL_INTERVAL_NS:
            known_count = int(np.count_nonzero(self.z))
            if abs(known_count - self._known) > _FILL_CHANGE * self.z.size or self._stale > _FILL_CHECKS:
                self._fill_z = np.zeros_like(self.z)
                if known_count >= _MIN_FILL_FRACTION * self.z.size:
                    ray, pose = view.camera.ray, view.world_from_camera
                    self._fill_z = background_fill(self.z, ray, pose, floor_band)
                self._known, self._stale = known_count, 0
            self._stale += 1
            self._filled_ns = time_ns if known_count else None
