"""The camera preview for viewers: the camera's pose and a small depth image."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, UInt16
from enliven.frames import DepthFrame, Frame
from enliven.wire import CameraMessage

_INTERVAL_NS = 200_000_000
"""Nanoseconds of the sensor's clock between two previews: fast enough to show movement, at 30 kB/s."""
_MAX_HEIGHT_PX = 72
"""Maximum height of the preview in pixels. A person is recognisable at this size."""
PRIVACY_NOTE = (
    "viewers receive a small depth image five times a second, and people can be recognised in this image; "
    "to turn the image off, set picture = false under [wire] in the settings"
)
"""The notice to operators that viewers receive a preview, if the preview is on."""
_NEAR_MM = 400.0
"""Depth that is drawn brightest, in millimetres. Depth cameras do not measure nearer surfaces."""
_FAR_MM = 6000.0
"""Depth that is drawn darkest, in millimetres. Performers are usually nearer."""
_DEFAULT_INTRINSICS = [0.9, 0.9, 0.6, 0.5]
"""Assumed intrinsics of a sensor that tracks people itself: 58 degrees vertical field of view."""


class CameraPreview:
    """Creates camera previews with a limited rate."""

    def __init__(self) -> None:
        self._last_sent_ns: int | None = None

    def create_message(
        self, frame: Frame, place: Float | None, *, mirrored: bool = False
    ) -> CameraMessage | None:
        """Returns the preview message of a frame, or None if the last preview is recent or the pose is
        unknown.

        Args:
            place: (4, 4) world_from_camera, or None if it is unknown.
            mirrored: True if performers are mirrored. The preview is then mirrored, too.
        """
        if place is None:
            return None
        if self._last_sent_ns is not None and 0 <= frame.time_ns - self._last_sent_ns < _INTERVAL_NS:
            return None
        self._last_sent_ns = frame.time_ns
        pose_rows = place[:3].ravel().tolist()
        if not isinstance(frame, DepthFrame):
            return CameraMessage(pose_rows, _DEFAULT_INTRINSICS)
        camera, image = frame.intrinsics, encode_nearness(frame.depth)
        centre_x = (camera.width - 1 - camera.cx if mirrored else camera.cx) / camera.height
        intrinsics = [
            camera.fx / camera.height,
            camera.fy / camera.height,
            centre_x,
            camera.cy / camera.height,
        ]
        image = image[:, ::-1] if mirrored else image
        return CameraMessage(pose_rows, intrinsics, image.shape[1], image.shape[0], image.tobytes())


def encode_nearness(depth: UInt16) -> np.ndarray:
    """Returns an (h, w) uint8 image of a subsampled depth image: 255 is near, 1 is far, and 0 is unknown."""
    step = max(-(-depth.shape[0] // _MAX_HEIGHT_PX), -(-depth.shape[1] // (2 * _MAX_HEIGHT_PX - 16)))
    subsampled = depth[::step, ::step]
    brightness = np.clip((_FAR_MM - subsampled) / (_FAR_MM - _NEAR_MM), 0.0, 1.0)
    is_known = (subsampled > 0) & (subsampled < 65535)
    return np.where(is_known, 1 + np.round(254 * brightness), 0).astype(np.uint8)
