"""Runs a recording through the tracker frame by frame and draws the result."""

from __future__ import annotations

import numpy as np
from PIL import Image

from enliven.arrays import UInt8
from enliven.frames import DepthFrame
from enliven.person import Body
from enliven_edge.inspection.picture import add_caption, depth_picture, depth_span, draw_bodies, tint_people
from enliven_edge.sensors import Condition
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker

_SPAN_SMOOTHING = 0.97
"""Smoothing factor per frame of the grey value range, so that images do not flicker."""


class Inspector:
    """Tracks frames, and draws depth, bodies and messages.

    Args:
        width: pixels, width of the images.
        fps: nominal frames per second of the sensor.

    Attributes:
        bodies: bodies of the last tracked frame.
    """

    def __init__(self, tracker: Tracker, width: int = 640, fps: float = 30.0) -> None:
        self._tracker, self._width = tracker, width
        self._health = HealthMonitor(fps=fps, far=tracker.settings.scene.far)
        self._span: tuple[float, float] | None = None
        self._first_ns: int | None = None
        self.bodies: list[Body] = []

    def record_error(self, error: Exception) -> None:
        """Records an error that the sensor raised instead of a frame during recording."""
        self._health.record_read_error(error)

    def draw_frame(self, frame: DepthFrame, condition: Condition | None = None) -> UInt8:
        """Tracks one frame and draws it, together with the condition of its sensor."""
        if self._health.admit(frame):
            self.bodies = self._tracker.track(frame)
            stand, state = self._tracker.world_from_camera, self._tracker.state
            self._health.check_result(frame, self.bodies, stand, state)
            if stand is not None and state is not None:
                self._health.check_device(condition, stand, state.floor_known)
        scale = self._width / frame.intrinsics.width
        picture = depth_picture(frame.depth, *self._smooth_span(frame))
        if self._tracker.owner is not None and self.bodies:
            picture = tint_people(picture, self._tracker.owner, frame.depth)
        height = round(picture.shape[0] * scale)
        picture = np.asarray(Image.fromarray(picture).resize((self._width, height)))
        mount = self._tracker.world_from_camera
        if mount is not None:
            picture = draw_bodies(picture, self.bodies, frame.intrinsics, mount, scale)
        return add_caption(picture, self._caption_lines(frame))

    def _smooth_span(self, frame: DepthFrame) -> tuple[float, float]:
        now = depth_span(frame.depth)
        previous = self._span or now
        k = _SPAN_SMOOTHING
        self._span = k * previous[0] + (1 - k) * now[0], k * previous[1] + (1 - k) * now[1]
        return self._span

    def _caption_lines(self, frame: DepthFrame) -> list[str]:
        """Returns the text lines of an image: the current problems, the most severe first, then time and
        people.
        """
        first = self._first_ns = frame.time_ns if self._first_ns is None else self._first_ns
        people = ", ".join(f"{b.id} ({b.confidence.mean():.2f})" for b in self.bodies) or "nobody"
        states = [str(state)[:110] for state in self._health.states[:3]]
        return [*states, f"{(frame.time_ns - first) * 1e-9:6.2f} s   {people}"]
