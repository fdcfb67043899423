"""One candidate: a blob of pixels that may be a new person, observed until it is proven."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, UInt8
from enliven.kernels import njit
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.scene import FOREGROUND, UNLIKELY
from enliven_edge.tracking.segment.person_shape import BlobShape, measure_shape
from enliven_edge.tracking.segment.segmentation import LooseGroup

MAX_YOUNG_AGE_S = 1.0
"""Age of the background model in seconds up to which nothing counts as having entered the scene, because all
of the background is new."""
_MIN_CROWN_M = 1.05
"""Minimum crown height above the floor in metres of a person that walks in: a small child."""
_MIN_STEADY_FRAMES = 3
"""Minimum number of frames with a steady crown for a candidate to be proven. A single frame may be noise."""
_PROVEN_FRAMES = 10
"""Number of frames after which a human but not upright shape is proven too."""
_MAX_CROWN_CHANGE_M = 0.15
"""Maximum variation of the crown height in metres over those frames. It varies by more if blobs merge or
split."""
_MIN_BENT_AREA_M2 = 0.33
"""Minimum visible area in square metres of a candidate with a low crown to be a bent or kneeling person."""
_MIN_AREA_M2 = 0.14
"""Minimum visible area of a person in square metres. Smaller blobs are mostly objects."""
_MIN_AREA_PER_M2 = 0.1
"""Minimum visible area in square metres of a person of one metre, seen from the side. It grows with the
squared height."""
_MAX_AREA_PER_M2 = 0.5
"""Maximum visible area in square metres of a person of one metre. It grows with the squared height."""
MIN_STANDING_CROWN_M = 1.3
"""Minimum crown height above the floor in metres of a standing person. Most seated people are lower."""
_CHECK_INTERVAL_NS = 250_000_000
"""Nanoseconds between two checks of an unchanged object. Measuring the shape and evaluating the network are
the expensive steps."""
_MIN_OCCLUDED = 0.25
"""Minimum occluded fraction of the outline of a person that is still coming out from behind a nearer
object."""
_MAX_WAIT_NS = 800_000_000
"""Maximum waiting time for such a candidate in nanoseconds: enough to come out and to be re-identified."""
_FIRST_RETRY_NS = 150_000_000
"""Nanoseconds before the second try if the first found no body. Each later wait is twice as long."""
_SHRUNK_FRACTION = 0.7
"""If a blob shrinks below this fraction of the area of its last failed search, it is searched again at
once."""
_MAX_RETRY_NS = 2_000_000_000
"""Maximum wait between two tries in nanoseconds. A real person must not wait longer."""


class Candidate:
    """A blob of pixels of a person's size.

    Attributes:
        pixels: (h, w) its mask.
        centre: (3,) metres, world frame.
        shape: its size and shape.
        area: visible area in square metres.
        crowns: height of its top above the floor in metres, frame by frame.
        bystander: whether it is outside the zone, or locked out.
        awaited: whether a person was lost near here; the candidate may then be in any posture.
        recognised: whether the network classifies it as a person.
        parts: [(h, w)] itself and the other parts of its split group; [] if the group was not split.
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
        self._next_ns, self._wait_ns = time_ns, _FIRST_RETRY_NS
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
        """Takes over the blob in a new frame.

        ``shares`` are the fractions of its pixels in front of the known background, and in front of the known
        or filled-in background.
        """
        self.area, (self.before, self.plain) = area, shares
        self.pixels, self.centre, self.shape = pixels, centre, shape
        self.frames, self.seen_ns, self.checked_ns = self.frames + 1, time_ns, time_ns
        self.crowns = [*self.crowns[-_PROVEN_FRAMES:], shape.crown]

    def grow(self, view: FrameView, pixels: Bool) -> None:
        """Extends the candidate to these (h, w) pixels."""
        self.pixels = pixels
        self.centre, self.area, _ = measure_blob(view, pixels, np.zeros(pixels.shape, np.uint8))
        self.shape = measure_shape(view, pixels, self.area)

    @property
    def proven(self) -> bool:
        """Returns True if it entered a known scene with a person's shape, or may be the person lost here."""
        steady = (
            self.frames >= _MIN_STEADY_FRAMES
            and float(np.ptp(self.crowns[-_MIN_STEADY_FRAMES:])) < _MAX_CROWN_CHANGE_M
        )
        if not steady or self.refused:
            return False
        if self.awaited and self.shape.possible and self.area > _MIN_AREA_M2 and self.plain > 0.5:
            return True
        tall = (self.shape.crown > _MIN_CROWN_M or self.shape.cut) and self.area > _MIN_AREA_M2
        return (
            tall
            and self.before > 0.5
            and (self.shape.upright or (self.shape.human and self.frames >= _PROVEN_FRAMES))
        )

    @property
    def unions(self) -> list[Bool]:
        """Returns [(h, w)] unions of it with the other parts of its split group, the largest first.

        Seen from above, raised arms look like separate people.
        """
        return _unions(self.pixels, self.parts)

    def unchanged(self, group: LooseGroup, time_ns: int) -> bool:
        """Returns True if the blob is this candidate and looks like a static object.

        It has not moved, and is neither proven nor convincing.
        """
        if (
            self.group is None
            or self.frames < _PROVEN_FRAMES
            or not 0 <= time_ns - self.checked_ns < _CHECK_INTERVAL_NS
        ):
            return False
        if self.proven or self.convincing or self.seen_ns == time_ns:
            return False
        moved = float(np.linalg.norm(group.centre - self.group.centre))
        return moved < 0.05 and abs(group.area - self.group.area) < 0.1 * self.group.area

    @property
    def convincing(self) -> bool:
        """Returns True if it looks enough like a standing person to need no observed entry into the scene."""
        stout = self.area > _MIN_AREA_PER_M2 * self.shape.crown**2
        whole = self.shape.cut or (self.shape.crown > _MIN_CROWN_M and stout)
        slim = self.shape.cut or self.area < _MAX_AREA_PER_M2 * self.shape.crown**2
        stands = self.shape.upright and whole and slim
        is_recognised = self.recognised and self._would_convince
        return (stands or is_recognised) and self.area > _MIN_AREA_M2 and not self.refused

    @property
    def _would_convince(self) -> bool:
        """Returns True if it would be convincing if the network classified it as a person.

        A panel never would.
        """
        return self.shape.possible and (self.shape.cut or self.shape.crown > _MIN_CROWN_M)

    def needs_recognition(self, time_ns: int) -> bool:
        """Returns True if the network should be evaluated.

        This is so if the shape alone is not convincing, and the last answer is old.
        """
        if self.area < _MIN_AREA_M2 or self.refused or (self.convincing and not self.recognised):
            return False
        if not self._would_convince:  # The answer of the network would not change the decision.
            return False
        if self._asked_ns is not None and 0 <= time_ns - self._asked_ns < _CHECK_INTERVAL_NS:
            return False
        self._asked_ns = time_ns
        return True

    @property
    def tall(self) -> bool:
        """Returns True if it is as tall as a standing person, or extends beyond the lower image border."""
        return self.shape.crown > MIN_STANDING_CROWN_M or self.shape.cut

    @property
    def _stands(self) -> bool:
        """Returns True if it is as tall as a standing person, and enough of it is visible."""
        return self.shape.crown > MIN_STANDING_CROWN_M and self.area > _MIN_AREA_M2

    @property
    def imaginable(self) -> bool:
        """Returns True if it may be a person in any posture, such as bent or kneeling.

        This is used if no other person is tracked.
        """
        large = self.shape.crown > _MIN_CROWN_M or self.shape.cut or self.area > _MIN_BENT_AREA_M2
        return self.shape.human and large and not self.refused

    def due(self, time_ns: int, room_age: float, *, alone: bool, missing: bool) -> bool:
        """Returns True if a body should be searched in it now.

        Args:
            time_ns: the frame's time.
            room_age: age of the background model in seconds. In a new model nothing counts as having entered.
            alone: whether no other person is tracked; any possible person is then better than none.
            missing: whether a person is hidden or away that this candidate may be.
        """
        there = self.convincing or (self.imaginable and (alone or self.awaited or self._stands))
        late = self.convincing and self._stands and self.plain > 0.5
        if not (self.proven or late or (room_age < MAX_YOUNG_AGE_S and there)):
            return False
        # A person that comes out from behind an object may be a known one. Wait until re-identification is
        # possible.
        if missing and self.shape.behind > _MIN_OCCLUDED and 0 <= time_ns - self.first_ns < _MAX_WAIT_NS:
            return False
        return self._has_shrunk or not 0 < self._next_ns - time_ns < 2 * _MAX_RETRY_NS

    @property
    def _has_shrunk(self) -> bool:
        """Returns True if the blob has shrunk enough since the last failed search to search again.

        Furniture was removed from it.
        """
        return self.convincing and self.area < _SHRUNK_FRACTION * self._vain_area

    def settle(self, tried: Candidate) -> None:
        """Takes over the time of the next try, and the area of the failed search, from a tried copy."""
        self._next_ns, self._wait_ns = max(self._next_ns, tried._next_ns), tried._wait_ns
        self._vain_area = tried._vain_area

    def failed(self, time_ns: int) -> None:
        """Postpones the next try because no body was found, each time for longer."""
        self._next_ns, self._wait_ns = time_ns + self._wait_ns, min(2 * self._wait_ns, _MAX_RETRY_NS)
        self._vain_area = self.area


def _unions(part: Bool, parts: list[Bool]) -> list[Bool]:
    """Returns all parts together, and ``part`` with each other part, the largest first.

    The list is empty if there are no other parts.
    """
    others = [other for other in parts if other is not part]
    if not others or len(others) == len(parts):
        return []
    pairs = [part | other for other in others] if len(others) > 1 else []
    return [np.logical_or.reduce(parts), *sorted(pairs, key=lambda pair: -int(pair.sum()))]


def measure_blob(view: FrameView, pixels: Bool, kind: UInt8) -> tuple[Float, float, tuple[float, float]]:
    """Returns the (3,) mean in metres of (h, w) pixels, their area in square metres, and two fractions.

    The area is that towards the sensor.

    The fractions are those of pixels in front of the known background, and in front of the known or filled-in
    background.

    Args:
        view: the frame.
        pixels: (h, w) the mask.
        kind: (h, w) from :meth:`BackgroundModel.classify`.
    """
    centre, squares, before, plain = _measured(view.points, view.z, kind, pixels)
    camera = view.camera.intrinsics
    return centre, squares / (camera.fx * camera.fy), (before, plain)


@njit(cache=True, nogil=True)
def _measured(points, z, kind, part):
    """See :func:`measure_blob`. It returns the sum of z squared instead of the area."""
    points, z, kind = points.reshape(-1, 3), z.ravel(), kind.ravel()
    x, y, deep, squares, before, plain, pixels = 0.0, 0.0, 0.0, 0.0, 0, 0, pixels_of(part)
    for i in pixels:
        x, y, deep = x + points[i, 0], y + points[i, 1], deep + points[i, 2]
        squares += z[i] * z[i]
        before += kind[i] == FOREGROUND
        plain += kind[i] != UNLIKELY
    count = max(1, len(pixels))
    return np.array([x, y, deep]) / count, squares, before / count, plain / count
