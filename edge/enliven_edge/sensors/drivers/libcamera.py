"""Cameras of a Raspberry Pi, and others that libcamera supports.

One camera gives bodies from colour, two give depth.
"""

from __future__ import annotations

import time
from pathlib import Path

from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven_edge.landmarks.colour_pose import MonocularPoseEstimator, check_view
from enliven_edge.landmarks.source import LandmarkSource
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.drivers.libcamera_images import LibcameraImages
from enliven_edge.sensors.stereo.calibration import load_calibration
from enliven_edge.sensors.stereo.matching import StereoMatcher
from enliven_edge.sensors.stereo.pair_folder import RecordedPairs
from enliven_edge.sensors.stereo.pairing import CameraImage, ImagePairing
from enliven_edge.sensors.stereo.rectification import Rectification, import_opencv

_MAX_TEMPERATURE_C = 75.0
"""Maximum temperature of the image sensor in degrees Celsius, from the specification of the IMX296 (Global
Shutter Camera)."""


class LibcameraSensor(Sensor):
    """One camera that tracks bodies in colour images, or two calibrated cameras that measure depth.

    Args:
        calibration: the file that ``enliven calibrate-stereo`` wrote. Without it only the left camera is
            used.
        left, right: cameras, as seen from behind: libcamera's numbers, or parts of their ids.
        width, height: pixels of one camera's images. Two cameras use the size of the calibration.
        fps: images per second.
        near, far: metres, range of valid depth.
        apart_ms: maximum milliseconds between the two images of a pair. In 1 ms a hand at 1 m/s moves 1 mm.
            At a distance of 2 m this is a depth error of 2 cm if the cameras are 10 cm apart.
        exposure_us: microseconds of exposure; 0 for automatic exposure.
        gain: gain of the image sensor, if the exposure is given.
        tuning: a tuning file for the Raspberry Pi's image processor.
        rehearse: a folder of image pairs that replace the cameras' images.
        view: degrees, horizontal field of view of the single camera.
        stand: metres, height of the single camera above the floor.
        tilt: degrees that the single camera looks down.
        body_height: metres, height of the performers in front of the single camera.
        python, model: location of MediaPipe, as for the webcam.
        source: detects the landmarks instead of MediaPipe.

    Raises:
        InputError: for a calibration, folder or option that cannot be used.
        ResourceError: if a library or camera is missing, or a camera is in use.
    """

    isolated = True

    def __init__(
        self,
        calibration: str = "",
        left: str | int = 0,
        right: str | int = 1,
        width: int = 640,
        height: int = 400,
        fps: float = 30.0,
        near: float = 0.7,
        far: float = 8.0,
        apart_ms: float = 1.0,
        exposure_us: int = 0,
        gain: float = 1.0,
        tuning: str = "",
        rehearse: str = "",
        view: float = 65.0,
        stand: float = 1.2,
        tilt: float = 0.0,
        body_height: float = 1.72,
        python: str = "",
        model: str = "",
        source: LandmarkSource | None = None,
    ) -> None:
        check_view(view)
        if not 1.0 <= fps <= 240.0:
            raise InputError(
                f"the frame rate is {fps}", where="sensor libcamera", remedy="Set fps to 1 to 240."
            )
        self.fps = fps
        self._matcher: StereoMatcher | None = None
        self._estimator: MonocularPoseEstimator | None = None
        size, cameras = (width, height), [str(left)]
        if calibration:
            size, cameras = self._prepare(calibration, near, far), [str(left), str(right)]
        elif rehearse:
            remedy = "Add --set calibration=FILE, with a file that enliven calibrate-stereo wrote."
            raise InputError(
                "image pairs need a calibration of the two cameras", where=rehearse, remedy=remedy
            )
        self._images: RecordedPairs | LibcameraImages
        if rehearse:
            self._images = RecordedPairs(Path(rehearse), fps)
        else:
            self._images = LibcameraImages(cameras, size, fps, not calibration, exposure_us, gain, tuning)
        self.name = self._images.name
        self._pairing = ImagePairing(self.name, round(1e6 * apart_ms))
        try:
            if not calibration:
                self._estimator = MonocularPoseEstimator(
                    view, stand, tilt, body_height, python, model, source
                )
            elif isinstance(self._images, LibcameraImages):
                self._check_sizes(self._images.sizes, size)
        except BaseException:
            self._images.close()
            raise

    def read(self, timeout: float | None = None) -> DepthFrame | BodyFrame | None:
        """Returns bodies for each image of a single camera, or depth for each pair of images.

        Returns None at the end of a rehearsal. ``timeout`` limits the total wait for both images of a pair.

        Raises:
            TimeoutError: if no image, or no second image of a pair, arrived in time.
            InputError: for a damaged image. The stream continues with the next call.
            ResourceError: if a camera was lost.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            picture = self._images.read(left)
            if picture is None:
                return None
            if self._estimator is not None:
                bodies = self._estimator.bodies(picture.image, picture.time_ns)
                return BodyFrame(bodies, picture.time_ns, self.name)
            pair = self._pairing.add(picture)
            if pair is not None:
                return self._compute_depth(*pair)

    def condition(self) -> Condition:
        """Returns the time offset between the two cameras' last images, and the image sensor's
        temperature."""
        offset_ns = self._pairing.apart_ns
        link = "" if offset_ns is None else f"CSI, two cameras {1e-6 * abs(offset_ns):.2f} ms apart"
        return Condition(link, temperature=self._images.temperature(), hot=_MAX_TEMPERATURE_C)

    def close(self) -> None:
        """Stops the cameras, and ends the detection of landmarks."""
        self._images.close()
        if self._estimator is not None:
            self._estimator.close()

    def _prepare(self, calibration: str, near: float, far: float) -> tuple[int, int]:
        """Creates the matcher of a calibration. Returns the calibrated image size (width, height)."""
        stereo_calibration = load_calibration(Path(calibration))
        import_opencv().setNumThreads(1)
        self._rectification = Rectification(stereo_calibration)
        self._matcher = StereoMatcher(self._rectification, near, far)
        return stereo_calibration.width, stereo_calibration.height

    def _compute_depth(self, left: CameraImage, right: CameraImage) -> DepthFrame:
        """Returns the depth of an image pair, in the rectified left camera."""
        assert self._matcher is not None
        depth = self._matcher.depth(left.image, right.image)
        camera = self._rectification.intrinsics
        return DepthFrame(depth, camera, left.time_ns, self.name, sequence=left.sequence)

    def _check_sizes(self, sizes: list[tuple[int, int]], calibrated_size: tuple[int, int]) -> None:
        """Raises InputError for a camera with another image size than the calibrated one."""
        for size in sizes:
            if size != calibrated_size:
                raise InputError(
                    f"a camera sends images of {size[0]} x {size[1]} pixels, but the calibration is for "
                    f"{calibrated_size[0]} x {calibrated_size[1]}",
                    where=self.name,
                    remedy="Calibrate with a size that the cameras support: enliven calibrate-stereo --size.",
                )
