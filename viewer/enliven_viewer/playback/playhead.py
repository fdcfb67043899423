"""The playhead of a timeline: live, paused, scrubbed, stepped or looped, at any speed."""

from __future__ import annotations

from enliven_viewer.playback.timeline import NS_PER_S, Timeline, TimelineMoment

PLAYBACK_SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Playback speeds that the keys select; 1 is real time."""


class Playhead:
    """The displayed position on a timeline.

    In live mode it follows the newest moment. Otherwise it keeps a time inside the timeline, which advances
    by ``speed`` seconds per second unless it is paused.

    Attributes:
        lag_ns: in live mode, the delay behind the newest moment, so that several edges show the same moment.
    """

    def __init__(self, timeline: Timeline, *, live: bool = True, loop: bool = False) -> None:
        self.timeline = timeline
        self.live = live
        self.paused = False
        self.loop = self._loops = loop
        self.speed = 1.0
        self.lag_ns = 0
        self._span_ns: int | None = None
        self._time = float(timeline.start_ns)
        self._generation = timeline.generation

    @property
    def time_ns(self) -> int:
        """Returns the displayed sensor time, inside the timeline."""
        timeline = self.timeline
        if self.live:
            return max(timeline.end_ns - self.lag_ns, timeline.start_ns)
        return min(max(int(self._time), timeline.start_ns), timeline.end_ns)

    @property
    def fraction(self) -> float:
        """Returns the displayed time as a fraction of the timeline, from start (0) to end (1)."""
        length = self.timeline.end_ns - self.timeline.start_ns
        return (self.time_ns - self.timeline.start_ns) / length if length else 1.0

    def moment(self) -> TimelineMoment | None:
        """Returns the moment to draw now, or None if nothing was received."""
        return self.timeline.find_moment(self.time_ns)

    def advance(self, seconds: float) -> None:
        """Advances the viewer's clock by ``seconds``."""
        if self._generation != self.timeline.generation:
            self._generation = self.timeline.generation
            self.go_live()
        if self.live or self.paused:
            return
        start, end = self._start_ns, self.timeline.end_ns
        self._time = max(self._time, start) + seconds * self.speed * NS_PER_S
        if self._time > end:
            self._time = start + (self._time - end) % max(end - start, 1) if self.loop else end

    def toggle_pause(self) -> None:
        """Freezes the displayed time, or continues from it."""
        if self.live:
            self._leave_live()
            self.paused = True
        else:
            self.paused = not self.paused

    def scrub(self, fraction: float) -> None:
        """Shows the time at ``fraction`` in [0, 1] of the timeline, and pauses there."""
        start, end = self.timeline.start_ns, self.timeline.end_ns
        self.live, self.paused = False, True
        self._time = start + min(max(fraction, 0.0), 1.0) * (end - start)

    def step(self, count: int) -> None:
        """Shows the moment ``count`` moments later (or earlier), and pauses there."""
        time = self.timeline.neighbour(self.time_ns, count)
        self.live, self.paused = False, True
        self._time = float(time)

    def change_speed(self, steps: int = 1) -> None:
        """Switches to a higher (or lower) speed in :data:`PLAYBACK_SPEEDS`, ``steps`` entries away.

        In live mode, starts playback.
        """
        nearest = min(range(len(PLAYBACK_SPEEDS)), key=lambda k: abs(PLAYBACK_SPEEDS[k] - self.speed))
        self.speed = PLAYBACK_SPEEDS[min(max(nearest + steps, 0), len(PLAYBACK_SPEEDS) - 1)]
        if self.live:
            self._leave_live()

    def go_live(self) -> None:
        """Returns to live mode."""
        self.live, self.paused, self.speed = True, False, 1.0
        self.loop, self._span_ns = self._loops, None

    def replay_last(self, seconds: float) -> None:
        """Loops the newest ``seconds`` until :meth:`go_live`."""
        self.live, self.paused, self.speed, self.loop = False, False, 1.0, True
        self._span_ns = round(seconds * NS_PER_S)
        self._time = float(self._start_ns)

    @property
    def _start_ns(self) -> int:
        """Returns the start time of playback: the timeline's start, or later while only its end is
        replayed.
        """
        start = self.timeline.start_ns
        return start if self._span_ns is None else max(start, self.timeline.end_ns - self._span_ns)

    def _leave_live(self) -> None:
        self._time = float(self.timeline.end_ns)
        self.live = False
