"""Images of two cameras that were taken at the same moment, by the cameras' clocks."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from enliven.arrays import UInt8
from enliven.errors import ResourceError

_MOST_ODD = 45
"""Images in a row without a partner, three quarters of a second of two cameras at 30, after which they are
called out of step: until cameras that are synchronised have found each other, some are odd."""
_WAITING = 4
"""Images of one camera that wait for the other's; the library gives each camera four."""


@dataclass(frozen=True)
class Picture:
    """One image of one camera.

    Attributes:
        eye: which camera, 0 the left or only one, 1 the right one.
        image: (H, W) uint8 grey or (H, W, 3) uint8 sRGB.
        time_ns: when it was taken, by a clock that the cameras share.
        sequence: the camera's own count of its images.
    """

    eye: int
    image: UInt8
    time_ns: int
    sequence: int


class Pairing:
    """Puts pictures of two cameras together, and leaves out what has no partner.

    Args:
        name: of the sensor.
        tolerance_ns: by which the times of a pair may differ.

    Attributes:
        apart_ns: by how much those of the last pair did, left minus right; None before the first.
        odd: pictures that were left out.
    """

    def __init__(self, name: str, tolerance_ns: int) -> None:
        self._name, self._tolerance = name, tolerance_ns
        self._waiting: tuple[deque[Picture], deque[Picture]] = (
            deque(maxlen=_WAITING),
            deque(maxlen=_WAITING),
        )
        self._odd_now = 0
        self._least_ns = 0
        self.apart_ns: int | None = None
        self.odd = 0

    def add(self, picture: Picture) -> tuple[Picture, Picture] | None:
        """The pair that a picture completes, left and right; None where it must wait.

        Raises:
            ResourceError: where the cameras have been out of step for long.
        """
        line = self._waiting[picture.eye]
        if len(line) == _WAITING:
            self._leave_out(line.popleft())
        line.append(picture)
        left, right = self._waiting
        while left and right:
            apart = left[0].time_ns - right[0].time_ns
            if abs(apart) <= self._tolerance:
                self.apart_ns, self._odd_now = apart, 0
                return left.popleft(), right.popleft()
            if self._odd_now == 0 or abs(apart) < abs(self._least_ns):
                self._least_ns = apart
            self._leave_out((left if apart < 0 else right).popleft())
        return None

    def _leave_out(self, picture: Picture) -> None:
        """Counts a picture that has no partner."""
        self.odd += 1
        self._odd_now += 1
        if self._odd_now < _MOST_ODD:
            return
        self._odd_now = 0
        other = self._waiting[1 - picture.eye]
        if not other and self.apart_ns is None and self._least_ns == 0:
            which = "left" if picture.eye else "right"
            raise ResourceError(
                f"the {which} camera sends no images", where=self._name, mend="Check its ribbon cable."
            )
        raise ResourceError(
            f"the two cameras are not in step: {1e-6 * abs(self._least_ns):.1f} ms apart",
            where=self._name,
            mend="Join their sync pins or use a tuning file with rpi.sync (docs/stereo.md).",
        )
