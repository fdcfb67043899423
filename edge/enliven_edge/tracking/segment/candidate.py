"""One candidate: a blob of pixels that may be a new person, observed until it is confirmed."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.scene.background_kernels import FOREGROUND, UNLIKELY
from enliven_edge.tracking.segment.person_shape import BlobShape, measure_shape
from enliven_edge.tracking.segment.segmentation import LooseGroup

MAX_YOUNG_AGE_S = 1.0
"""Age of the background model in seconds below which no blob counts as having entered the scene, because the
whole background is new."""
_MIN_CROWN_M = 1.05
"""Minimum crown height above the floor in metres of a person who walks in: a small child."""
_MIN_STEADY_FRAMES = 3
"""Minimum number of frames with a steady crown height for a candidate to be confirmed. A single frame may be
noise."""
_PROVEN_FRAMES = 10
"""Number of frames after which a candidate is confirmed that has a person's shape but is not upright."""
_MAX_CROWN_CHANGE_M = 0.15
"""Maximum variation in metres of the crown height over the steady frames. Merging or splitting blobs vary
more.
"""
_MIN_BENT_AREA_M2 = 0.33
"""Minimum visible area in square metres of a candidate with a low crown to be a bent or kneeling person."""
_MIN_AREA_M2 = 0.14
"""Minimum visible area of a person in square metres. Smaller blobs are mostly objects."""
_MIN_AREA_PER_M2 = 0.1
"""Minimum visible area in square metres of a person one metre tall, seen from the side. It grows with the
squared height.
"""
_MAX_AREA_PER_M2 = 0.5
"""Maximum visible area in square metres of a person one metre tall. It grows with the squared height."""
MIN_STANDING_CROWN_M = 1.3
"""Minimum crown height above the floor in metres of a standing person. Most seated people are lower."""
_CHECK_INTERVAL_NS = 250_000_000
"""Nanoseconds between two checks of an unchanged object. Measuring the shape and evaluating the network are
the expensive steps."""
_MIN_OCCLUDED = 0.25
"""Minimum occluded fraction of the outline of a person who is still coming out from behind a nearer
object."""
_MAX_WAIT_NS = 800_000_000
"""Maximum waiting time in nanoseconds for a candidate that comes out from behind an object. It is long enough
to come out completely and to be re-identified.
"""
_FIRST_RETRY_NS = 150_000_000
"""Nanoseconds before the second try if the first found no body. Each later wait is twice as long."""
_SHRUNK_FRACTION = 0.7
"""A blob is searched again at once if its area is below this fraction of its area in the last failed
search.
"""
_MAX_RETRY_NS = 2_000_000_000
"""Maximum wait between two tries in nanoseconds. A real person must not wait longer."""


class Candidate:
    """A blob of pixels of a person's size.

    Attributes:
        pixels: (h, w) its mask.
        centre: (3,) metres, world frame.
        shape: its size and shape.
        area: visible area in square metres.
        crowns: crown heights above the floor in metres in the last frames.
        is_bystander: whether it is outside the zone, or locked out.
        is_awaited: whether a person was lost near the candidate and may return in any posture.
        is_recognised: whether the network classifies it as a person.
        parts: [(h, w)] the masks of all parts of its split group, including itself; [] if the group was not
            split.
    """

    def __init__(self, centre: Float, time_ns: int) -> None:
        self.centre = centre
        self.crowns: list[float] = []
        self.frames, self.area = 0, 0.0
        self.is_bystander = self.is_awaited = self.is_rejected = self.is_recognised = False
        self.seen_ns = self.first_ns = time_ns
        self.known_front_fraction = self.front_fraction = 0.0
        self.group: LooseGroup | None = None
        self.parts: list[Bool] = []
        self.checked_ns = time_ns
        self.shape: BlobShape
        self.pixels: Bool
        self._next_ns, self._wait_ns = time_ns, _FIRST_RETRY_NS
        self._failed_area = 0.0
        self._asked_ns: int | None = None

    def update(
        self,
        pixels: Bool,
        centre: Float,
        shape: BlobShape,
        area: float,
        foreground_fractions: tuple[float, float],
        time_ns: int,
    ) -> None:
        """Updates the candidate with its blob in a new frame.

        ``foreground_fractions`` are the fractions of its pixels in front of the known background, and in
        front of the known or filled-in background.
        """
        self.area, (self.known_front_fraction, self.front_fraction) = area, foreground_fractions
        self.pixels, self.centre, self.shape = pixels, centre, shape
        self.frames, self.seen_ns, self.checked_ns = self.frames + 1, time_ns, time_ns
        self.crowns = [*self.crowns[-_PROVEN_FRAMES:], shape.crown]

    def grow(self, view: FrameView, pixels: Bool) -> None:
        """Extends the candidate to these (h, w) pixels."""
        self.pixels = pixels
        self.centre, self.area, _ = measure_blob(view, pixels, np.zeros(pixels.shape, np.uint8))
        self.shape = measure_shape(view, pixels, self.area)

    @property
    def is_confirmed(self) -> bool:
        """Returns True if the candidate entered a known scene with a person's shape, or may be a lost
        person."""
        steady = (
            self.frames >= _MIN_STEADY_FRAMES
            and float(np.ptp(self.crowns[-_MIN_STEADY_FRAMES:])) < _MAX_CROWN_CHANGE_M
        )
        if not steady or self.is_rejected:
            return False
        if (
            self.is_awaited
            and self.shape.may_be_person
            and self.area > _MIN_AREA_M2
            and self.front_fraction > 0.5
        ):
            return True
        tall = (self.shape.crown > _MIN_CROWN_M or self.shape.is_cut_off) and self.area > _MIN_AREA_M2
        return (
            tall
            and self.known_front_fraction > 0.5
            and (self.shape.is_upright or (self.shape.has_person_shape and self.frames >= _PROVEN_FRAMES))
        )

    @property
    def unions(self) -> list[Bool]:
        """Returns [(h, w)] unions of the candidate with other parts of its split group, the largest first.

        Unions are needed, because raised arms look like separate people from above.
        """
        return union_masks(self.pixels, self.parts)

    def is_unchanged(self, group: LooseGroup, time_ns: int) -> bool:
        """Returns True if the blob is this candidate, unmoved, and looks like a static object.

        A static object is a candidate that is neither confirmed nor convincing.
        """
        if (
            self.group is None
            or self.frames < _PROVEN_FRAMES
            or not 0 <= time_ns - self.checked_ns < _CHECK_INTERVAL_NS
        ):
            return False
        if self.is_confirmed or self.is_convincing or self.seen_ns == time_ns:
            return False
        moved = float(np.linalg.norm(group.centre - self.group.centre))
        return moved < 0.05 and abs(group.area - self.group.area) < 0.1 * self.group.area

    @property
    def is_convincing(self) -> bool:
        """Returns True if the shape alone shows a standing person, even if its entry was not observed."""
        stout = self.area > _MIN_AREA_PER_M2 * self.shape.crown**2
        whole = self.shape.is_cut_off or (self.shape.crown > _MIN_CROWN_M and stout)
        slim = self.shape.is_cut_off or self.area < _MAX_AREA_PER_M2 * self.shape.crown**2
        stands = self.shape.is_upright and whole and slim
        is_recognised = self.is_recognised and self._would_convince
        return (stands or is_recognised) and self.area > _MIN_AREA_M2 and not self.is_rejected

    @property
    def _would_convince(self) -> bool:
        """Returns True if the candidate would be convincing if the network classified it as a person.

        A flat panel never is.
        """
        return self.shape.may_be_person and (self.shape.is_cut_off or self.shape.crown > _MIN_CROWN_M)

    def needs_recognition(self, time_ns: int) -> bool:
        """Returns True if the network should classify the candidate now.

        That is the case if the shape alone is not convincing, and the last classification is old.
        """
        if self.area < _MIN_AREA_M2 or self.is_rejected or (self.is_convincing and not self.is_recognised):
            return False
        if not self._would_convince:  # The answer of the network would not change the decision.
            return False
        if self._asked_ns is not None and 0 <= time_ns - self._asked_ns < _CHECK_INTERVAL_NS:
            return False
        self._asked_ns = time_ns
        return True

    @property
    def is_tall(self) -> bool:
        """Returns True if the candidate is as tall as a standing person, or extends beyond the lower image
        border."""
        return self.shape.crown > MIN_STANDING_CROWN_M or self.shape.is_cut_off

    @property
    def _is_standing(self) -> bool:
        """Returns True if the candidate is as tall as a standing person, and a sufficient area is visible."""
        return self.shape.crown > MIN_STANDING_CROWN_M and self.area > _MIN_AREA_M2

    @property
    def may_be_person(self) -> bool:
        """Returns True if the candidate may be a person in any posture, such as bent or kneeling.

        Such a candidate is searched only in three cases: no other person is tracked, a person may return
        here, or it is as tall as a standing person.
        """
        large = self.shape.crown > _MIN_CROWN_M or self.shape.is_cut_off or self.area > _MIN_BENT_AREA_M2
        return self.shape.has_person_shape and large and not self.is_rejected

    def is_due(self, time_ns: int, room_age: float, *, alone: bool, missing: bool) -> bool:
        """Returns True if a body should be searched in the candidate now.

        Args:
            time_ns: the frame's time.
            room_age: age of the background model in seconds. In a new model nothing counts as having entered.
            alone: whether no other person is tracked. If so, any possible person is searched.
            missing: whether a person is hidden or away that this candidate may be.
        """
        is_plausible = self.is_convincing or (
            self.may_be_person and (alone or self.is_awaited or self._is_standing)
        )
        is_unobserved_entry = self.is_convincing and self._is_standing and self.front_fraction > 0.5
        if not (self.is_confirmed or is_unobserved_entry or (room_age < MAX_YOUNG_AGE_S and is_plausible)):
            return False
        # A person who comes out from behind an object may be a known one. Wait until re-identification is
        # possible.
        if (
            missing
            and self.shape.occluded_fraction > _MIN_OCCLUDED
            and 0 <= time_ns - self.first_ns < _MAX_WAIT_NS
        ):
            return False
        return self._has_shrunk or not 0 < self._next_ns - time_ns < 2 * _MAX_RETRY_NS

    @property
    def _has_shrunk(self) -> bool:
        """Returns True if the blob has shrunk enough since the last failed search to search again.

        This happens if furniture is separated from it.
        """
        return self.is_convincing and self.area < _SHRUNK_FRACTION * self._failed_area

    def copy_search_times(self, tried: Candidate) -> None:
        """Copies the time of the next search and the area of the failed search from ``tried``, a copy that
        was searched.
        """
        self._next_ns, self._wait_ns = max(self._next_ns, tried._next_ns), tried._wait_ns
        self._failed_area = tried._failed_area

    def postpone_search(self, time_ns: int) -> None:
        """Postpones the next search because no body was found. The wait doubles with each failure."""
        self._next_ns, self._wait_ns = time_ns + self._wait_ns, min(2 * self._wait_ns, _MAX_RETRY_NS)
        self._failed_area = self.area


def union_masks(part: Bool, parts: list[Bool]) -> list[Bool]:
    """Returns all parts together, and ``part`` with each other part, the largest first.

    The list is empty if there are no other parts.
    """
    others = [other for other in parts if other is not part]
    if not others or len(others) == len(parts):
        return []
    pairs = [part | other for other in others] if len(others) > 1 else []
    return [np.logical_or.reduce(parts), *sorted(pairs, key=lambda pair: -int(pair.sum()))]


def measure_blob(view: FrameView, pixels: Bool, kind: UInt8) -> tuple[Float, float, tuple[float, float]]:
    """Returns the (3,) mean point of (h, w) pixels in metres, their area in square metres, and two fractions.

    The area is projected towards the sensor. One fraction counts the pixels in front of the known background,
    the other counts the pixels in front of the known or filled-in background.

    Args:
        view: the frame.
        pixels: (h, w) the mask.
        kind: (h, w) from :meth:`BackgroundModel.classify`.
    """
    centre, squares, known_count, front_count = _measured(view.points, view.z, kind, pixels)
    camera = view.camera.intrinsics
    return centre, squares / (camera.fx * camera.fy), (known_count, front_count)


@njit(cache=True, nogil=True)
def _measured(points, z, kind, part):
    """Computes :func:`measure_blob`, with the sum of z squared instead of the area."""
    points, z, kind = points.reshape(-1, 3), z.ravel(), kind.ravel()
    x, y, deep, squares, before, plain, pixels = 0.0, 0.0, 0.0, 0.0, 0, 0, pixels_of(part)
    for i in pixels:
        x, y, deep = x + points[i, 0], y + points[i, 1], deep + points[i, 2]
        squares += z[i] * z[i]
        before += kind[i] == FOREGROUND
        plain += kind[i] != UNLIKELY
    count = max(1, len(pixels))
    return np.array([x, y, deep]) / count, squares, before / count, plain / count
