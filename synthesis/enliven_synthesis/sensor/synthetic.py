"""A sensor without hardware: a synthetic performer in front of a camera with a known profile."""

from __future__ import annotations

import time
from pathlib import Path

from enliven.frames import DepthFrame
from enliven.person import Body
from enliven.settings import load_settings
from enliven_edge.sensors import Sensor
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.studio import SyntheticSettings, SyntheticStudio


class SyntheticSensor(Sensor):
    """Delivers depth frames of a performer, and the true joints.

    In real time it behaves like a camera: each frame arrives when it is due, and a slow reader misses frames.
    Otherwise every frame is delivered without delay.

    Args:
        profile: the camera, by name or by the path of its TOML file (see ``firmware_configs/sensors``).
        choreography: "chair", "walk", "wave", "idle" or "wander".
        seed: determines all random numbers.
        width: width of the images in pixels, or None for the profile's width.
        realtime: True to deliver frames at the profile's rate.
        loop: True to repeat the choreography, with new noise.
        more: any other field of :class:`SyntheticSettings`, such as ``camera_height`` or ``noise``.

    Raises:
        InputError: for an unknown profile, choreography or setting, or a value out of range.
    """

    made_up = True

    def __init__(
        self,
        profile: str | Path = "kinect1",
        choreography: str = "chair",
        seed: int = 0,
        width: int | None = None,
        realtime: bool = True,
        loop: bool = True,
        **more: object,
    ) -> None:
        values = {"choreography": choreography, "seed": seed, "width": width or 0, **more}
        settings = load_settings(SyntheticSettings, values, where="synthetic sensor")
        self.studio = SyntheticStudio(load_profile(profile), settings)
        self.name, self.fps = self.studio.sensor, self.studio.profile.camera.fps
        self._realtime, self._loop = realtime, loop
        self._index, self._closed = 0, False
        self._started: float | None = None

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next frame when it is due, or None after the last frame or after closing.

        Raises:
            TimeoutError: if the frame is not due within ``timeout`` seconds.
        """
        if self._realtime and not self._closed:
            self._wait(timeout)
        if self._closed or (not self._loop and self._index >= self.studio.frames):
            return None
        frame = self.studio.frame(self._index)
        self._index += 1
        return frame

    def truth(self, time_ns: int) -> Body:
        """Returns the performer at a time of the sensor's clock.

        It has (20, 3) true joints in metres, world frame.
        """
        return self.studio.body(time_ns)

    def close(self) -> None:
        """Ends the stream."""
        self._closed = True

    def _wait(self, timeout: float | None) -> None:
        """Sleeps until the next frame is due. If several frames are due, skips to the newest of them."""
        now = time.monotonic()
        if self._started is None:
            self._started = now
        rate = self.studio.profile.camera.fps
        newest = int((now - self._started) * rate)
        last = newest if self._loop else min(newest, self.studio.frames)
        self._index = max(self._index, last)
        wait = self._started + self._index / rate - now
        if timeout is not None and wait > timeout:
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"the next frame of {self.name} is due in {wait - timeout:.3f} s")
        if wait > 0:
            time.sleep(wait)
