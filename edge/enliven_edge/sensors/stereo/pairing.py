"""Pairs the images of two cameras that were taken at the same time according to the cameras' clocks."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from enliven.arrays import UInt8
from enliven.errors import ResourceError

_SYNC_TIMEOUT_NS = 5_000_000_000
"""Maximum nanoseconds until two cameras are synchronised. The Raspberry Pi sends a synchronisation message
every thirty images, and the second camera may need two messages."""
_LOST_AFTER_NS = 750_000_000
"""Nanoseconds without a pair after which the sensor counts as lost. The edge counts a second of silence as a
loss."""
_MAX_WAITING = 4
"""Maximum number of images of one camera that wait for the other camera's. The library has four buffers per
camera."""


@dataclass(frozen=True)
class CameraImage:
    """One image of one camera.

    Attributes:
        eye: index of the camera, 0 for the left or only one, 1 for the right one.
        image: (H, W) uint8 grey or (H, W, 3) uint8 sRGB.
        time_ns: capture time, by a clock that the cameras share.
        sequence: the camera's sequence number of the image.
    """

    eye: int
    image: UInt8
    time_ns: int
    sequence: int


class ImagePairing:
    """Pairs the images of two cameras, and drops those without a partner.

    Args:
        name: name of the sensor.
        tolerance_ns: maximum difference between the times of a pair.

    Attributes:
        apart_ns: time difference of the last pair in nanoseconds, left minus right; None before the first
            pair.
        dropped: number of dropped images.
    """

    def __init__(self, name: str, tolerance_ns: int) -> None:
        self._name, self._tolerance = name, tolerance_ns
        self._waiting: tuple[deque[CameraImage], deque[CameraImage]] = (
            deque(maxlen=_MAX_WAITING),
            deque(maxlen=_MAX_WAITING),
        )
        self._since_ns: int | None = None
        self._least_ns: int | None = None
        self.apart_ns: int | None = None
        self.dropped = 0

    def add(self, image: CameraImage) -> tuple[CameraImage, CameraImage] | None:
        """Returns the pair (left, right) that an image completes. Returns None if the image must wait for its
        partner.

        Raises:
            ResourceError: if the cameras have been out of synchronisation for too long.
        """
        line = self._waiting[image.eye]
        self._since_ns = image.time_ns if self._since_ns is None else self._since_ns
        if len(line) == _MAX_WAITING:
            self._drop(line.popleft())
        line.append(image)
        left, right = self._waiting
        while left and right:
            offset_ns = left[0].time_ns - right[0].time_ns
            if abs(offset_ns) <= self._tolerance:
                self.apart_ns, self._since_ns, self._least_ns = offset_ns, left[0].time_ns, None
                return left.popleft(), right.popleft()
            self._least_ns = min(abs(offset_ns), self._least_ns or abs(offset_ns))
            self._drop((left if offset_ns < 0 else right).popleft())
        return None

    def _drop(self, image: CameraImage) -> None:
        self.dropped += 1
        assert self._since_ns is not None
        patience = _SYNC_TIMEOUT_NS if self.apart_ns is None else _LOST_AFTER_NS
        if image.time_ns - self._since_ns < patience:
            return
        self._since_ns = image.time_ns
        if self._least_ns is None:
            side = "left" if image.eye else "right"
            raise ResourceError(
                f"the {side} camera sends no images",
                where=self._name,
                remedy="Check the ribbon cable of this camera.",
            )
        raise ResourceError(
            f"the two cameras are not synchronised: their images are {1e-6 * self._least_ns:.1f} ms apart",
            where=self._name,
            remedy="Connect the sync pins of the cameras, or use a tuning file with rpi.sync "
            "(docs/stereo.md).",
        )
