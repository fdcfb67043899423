"""The time axis that the timeline, curves and sounds share: times in pixels, zoom and pan."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_viewer.studio.editor.editor import Editor

LABEL_WIDTH = 190.0
"""Width of the labels in pixels: about 25 letters."""
RULER_HEIGHT = 26.0
"""Height of the ruler in pixels."""
END_MARGIN = 12.0
"""Margin at the right in pixels, so that the pointer can grab the end of the last bar."""
_MIN_VISIBLE_S = 0.25
"""Minimum visible time span in seconds: a few frames."""
_MAX_VISIBLE_FACTOR = 1.25
"""Maximum visible time span as a multiple of the project's length. It leaves room to drag the last clip's
end.
"""
_ZOOM_PER_NOTCH = 0.85
"""Factor of the visible time span per notch of the wheel."""
_TICK_INTERVALS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Possible intervals in seconds between two numbers on the ruler."""


@dataclass(frozen=True)
class TimeScale:
    """Conversions between times and pixels of an area with labels at the left.

    Attributes:
        length: length of the whole project in seconds.
        width: width of the whole area in pixels.
        start: time at the left of the track, in seconds.
        span: visible time span in seconds; 0 shows everything.
    """

    length: float
    width: float
    start: float = 0.0
    span: float = 0.0

    @property
    def track_width(self) -> float:
        """Returns the width of the track in pixels."""
        return max(self.width - LABEL_WIDTH - END_MARGIN, 1.0)

    @property
    def visible_s(self) -> float:
        """Returns the visible time span in seconds."""
        return self.span or self.length

    def x(self, time: float) -> float:
        """Returns the x coordinate of a time, in pixels."""
        return LABEL_WIDTH + self.track_width * (time - self.start) / self.visible_s

    def time(self, x: float) -> float:
        """Returns the time of an x coordinate, in seconds. It is extrapolated outside the track."""
        return self.start + (x - LABEL_WIDTH) / self.track_width * self.visible_s

    def ticks(self) -> tuple[tuple[float, bool], ...]:
        """Returns the times to mark on the ruler, and whether each has a number.

        Numbers are at least 60 pixels apart.
        """
        min_step = 60.0 * self.visible_s / self.track_width
        step = next((s for s in _TICK_INTERVALS_S if s >= min_step), _TICK_INTERVALS_S[-1])
        small = step / 5
        first, last = -int(-self.start / small), int((self.start + self.visible_s) / small + 1e-9)
        return tuple((k * small, k % 5 == 0) for k in range(first, last + 1))


class TimeAxis:
    """The time axis of the window, which shows all or a part of an editor's project.

    Attributes:
        width: width of the whole area in pixels.
        start: time at the left of the track, in seconds.
        span: visible time span in seconds; 0 shows everything.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.width, self.start, self.span = 1000.0, 0.0, 0.0

    @property
    def scale(self) -> TimeScale:
        """Returns the current scale."""
        return TimeScale(self.editor.length, self.width, self.start, self.span)

    def zoom(self, notches: float, x: float) -> None:
        """Zooms the visible time span in or out around a pixel."""
        scale = self.scale
        fixed_time, max_span = scale.time(x), _MAX_VISIBLE_FACTOR * scale.length
        span = min(max(scale.visible_s * _ZOOM_PER_NOTCH**notches, _MIN_VISIBLE_S), max_span)
        fraction = (fixed_time - scale.start) / scale.visible_s
        self.span = 0.0 if span >= scale.length and notches < 0 else span
        self._set_start(fixed_time - fraction * span)

    def pan(self, pixels: float) -> None:
        """Pans the visible time span to the right by some pixels."""
        scale = self.scale
        self._set_start(scale.start + pixels * scale.visible_s / scale.track_width)

    def show_all(self) -> None:
        """Shows the whole project."""
        self.start = self.span = 0.0

    def _set_start(self, start: float) -> None:
        max_start = max(_MAX_VISIBLE_FACTOR * self.editor.length - self.span, 0.0) if self.span else 0.0
        self.start = min(max(start, 0.0), max_start)
