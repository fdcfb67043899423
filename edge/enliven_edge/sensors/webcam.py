"""A plain webcam or a film.

Bodies come from colour images alone, and their distances from an assumed body height.
"""

from __future__ import annotations

import errno
import sys
import time
from pathlib import Path
from typing import Any

from enliven.doctor import need
from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame
from enliven_edge.landmarks.colour_pose import MonocularPoseEstimator, check_view
from enliven_edge.landmarks.source import LandmarkSource, MediaPipeSettings
from enliven_edge.sensors.base import Sensor

_FORMATS = {"linux": "v4l2", "darwin": "avfoundation", "win32": "dshow"}
_REMEDIES = {
    errno.EACCES: "Let your user use cameras (sudo usermod -aG video $USER), and log in again.",
    errno.EBUSY: "Close the other program that uses the camera.",
}
"""Advice if the system refuses a camera, by errno."""


class WebcamSensor(Sensor):
    """Delivers the bodies that a :class:`~enliven_edge.landmarks.source.LandmarkSource` detects in a video.

    Distances assume people of ``body_height``: a shorter person appears to be farther away.

    Args:
        device: a camera such as "/dev/video0", or the path of a film, which is played once at its own pace.
        python: the Python that has mediapipe; empty for this one.
        model: a pose landmarker's .task file, if mediapipe contains none.
        view: degrees, horizontal field of view of the camera.
        height: metres, height of the camera above the floor.
        tilt: downward tilt of the camera in degrees.
        body_height: metres, height of the performers.
        source: detects the landmarks instead of MediaPipe.

    Raises:
        InputError: for a film that cannot be read.
        ResourceError: for a camera that cannot be opened, or if PyAV or MediaPipe are missing.
    """

    def __init__(
        self,
        device: str = "/dev/video0",
        python: str = "",
        model: str = "",
        view: float = 65.0,
        height: float = 1.2,
        tilt: float = 0.0,
        body_height: float = 1.72,
        source: LandmarkSource | None = None,
    ) -> None:
        check_view(view)
        self.name = f"webcam {device}"
        self._is_live = device.startswith("/dev/") or "=" in device
        need("av", "film", "webcam")
        if self._is_live:
            _refuse_absent(device)
            if source is None:
                MediaPipeSettings(python, model).check()
        self._container = _open_video(device, self._is_live)
        try:
            self._estimator = MonocularPoseEstimator(view, height, tilt, body_height, python, model, source)
        except BaseException:
            self._container.close()
            raise
        self._images = self._container.decode(video=0)
        self._first: tuple[float, float] | None = None
        self._waiting: Any = None
        self._closed = False

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the bodies in the next image. The images of a film wait for their time. Returns None at its
        end.

        Raises:
            TimeoutError: if the film's next image is due later than ``timeout``.
        """
        if self._closed:
            return None
        image = self._waiting or self._next_image()
        self._waiting = None
        if image is None:
            return None
        wait = 0.0 if self._is_live else self._due_time_s(float(image.time or 0.0)) - time.monotonic()
        if timeout is not None and wait > timeout:
            self._waiting = image
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"the next image of {self.name} is due in {wait - timeout:.3f} s")
        if wait > 0:
            time.sleep(wait)
        time_ns = time.monotonic_ns() if self._is_live else round(float(image.time or 0.0) * 1e9)
        colour = image.to_ndarray(format="rgb24")
        return BodyFrame(self._estimator.bodies(colour, time_ns), time_ns, self.name)

    def close(self) -> None:
        """Closes the camera or film, and ends the detection of landmarks. A second call does nothing."""
        if not self._closed:
            self._closed = True
            self._container.close()
            self._estimator.close()

    def _next_image(self) -> Any:
        """Returns the next image, or None at the end."""
        import av

        try:
            return next(self._images, None)
        except av.error.FFmpegError as error:
            if self._is_live:
                raise ResourceError(f"the camera was lost ({error})", where=self.name) from None
            raise InputError("the film is damaged", where=self.name) from None

    def _due_time_s(self, seconds: float) -> float:
        """Returns the time of the monotonic clock in seconds at which a film's image is due."""
        if self._first is None:
            self._first = (time.monotonic(), seconds)
        return self._first[0] + seconds - self._first[1]


def _refuse_absent(device: str) -> None:
    """Raises an error for a missing camera. The message lists the existing cameras.

    Raises:
        ResourceError: if the system lists its cameras as files, and this one is not among them.
    """
    if not device.startswith("/dev/") or Path(device).exists():
        return
    others = ", ".join(str(path) for path in sorted(Path("/dev").glob("video*")))
    remedy = (
        f"Set device to one of these cameras: {others}."
        if others
        else "Plug in a camera, or set device to a film."
    )
    raise ResourceError("the camera was not found", where=device, remedy=remedy)


def _open_video(device: str, live: bool) -> Any:
    """Returns the video of a camera or a film."""
    import av

    try:
        container = av.open(device, format=_FORMATS.get(sys.platform) if live else None)
    except (av.error.FFmpegError, OSError) as error:
        if live:
            remedy = _REMEDIES.get(
                error.errno or 0, "Check that this is a camera, and that no other program uses it."
            )
            raise ResourceError(
                f"the camera cannot be opened ({error.strerror})", where=device, remedy=remedy
            ) from None
        raise InputError("the file is not a film that can be read", where=device) from None
    if not container.streams.video:
        container.close()
        raise InputError("the file contains no video", where=device)
    return container
