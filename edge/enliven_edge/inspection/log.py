"""Reports on a sensor during its recording, in sentences.

It reports missing images, the state of the device, and lost connections.
"""

from __future__ import annotations

from collections import Counter

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.sensors import LogEntry, SensorFault

_MAX_DESCRIBED_LOSSES = 5
"""Maximum number of losses that are described one by one. Further ones are only counted."""


class SensorLog:
    """Collects the events of a recording, one after the other."""

    def __init__(self) -> None:
        self._frames: Counter[str] = Counter()
        self._first_ns = self._last_ns = 0
        self._counts: dict[str, int] = {}
        self._gaps: list[tuple[float, int]] = []
        self._links: Counter[str] = Counter()
        self._celsius: list[float] = []
        self._max_celsius: float | None = None
        self._uncalibrated = False
        self._losses: list[tuple[float, str]] = []
        self._lost_seconds, self._lost = 0.0, False
        self._unusable = 0

    def add(self, moment: LogEntry) -> None:
        """Adds the next event."""
        match moment.content:
            case SensorFault() as error:
                # After the first error, further errors are failed attempts to reopen the sensor. So all of
                # them count as one loss.
                if not self._lost:
                    self._losses.append((self._seconds(self._last_ns), error.what))
                self._lost = True
            case InputError():
                self._unusable += 1
            case frame:
                if not self._frames:
                    self._first_ns = frame.time_ns
                if self._lost:
                    self._lost_seconds += (
                        max(0.0, 1e-9 * (frame.time_ns - self._last_ns)) if self._frames else 0.0
                    )
                if isinstance(frame, DepthFrame) and frame.sequence is not None:
                    self._count(frame.sensor, frame.sequence, frame.time_ns)
                self._lost, self._last_ns = False, frame.time_ns
                self._frames[frame.sensor] += 1
                self._add_condition(moment)

    def facts(self) -> list[tuple[str, str]]:
        """Returns all facts for the report, each with its name."""
        seconds = self._seconds(self._last_ns)
        facts = [("frames", f"{sum(self._frames.values())} in {seconds:.1f} s of {', '.join(self._frames)}")]
        facts.append(("missing", self._describe_missing()))
        if any(self._links):
            facts.append(("link", ", ".join(filter(None, self._links))))
        if self._celsius:
            limit = (
                "" if self._max_celsius is None else f"; the sensor switches off at {self._max_celsius:.0f}"
            )
            facts.append(
                ("temperature", f"{min(self._celsius):.0f} to {max(self._celsius):.0f} degrees{limit}")
            )
        if self._uncalibrated:
            facts.append(
                ("lens", "the typical lens of this model, because the camera did not report its own")
            )
        if self._losses:
            facts.append(("lost", f"{len(self._losses)} times, for {self._lost_seconds:.1f} s in total"))
            facts += [
                ("", f"at {second:.2f} s: {reason}")
                for second, reason in self._losses[:_MAX_DESCRIBED_LOSSES]
            ]
        if self._unusable:
            facts.append(("unusable", f"{self._unusable} frames, which were skipped"))
        return facts

    def _describe_missing(self) -> str:
        """Returns a sentence about the gaps in the sensor's sequence numbers."""
        if not self._counts:
            return "unknown, because the sensor does not number its images"
        if not self._gaps:
            return "none, by the image numbers of the sensor"
        start_s, longest = max(self._gaps, key=lambda gap: gap[1])
        count = sum(lost for _, lost in self._gaps)
        gap = f"the longest gap is {longest} images at {start_s:.2f} s"
        return f"{count} images in {len(self._gaps)} gaps; {gap}"

    def _count(self, sensor: str, sequence: int, time_ns: int) -> None:
        """Counts a gap in the sensor's sequence numbers. A reopened sensor starts with other numbers."""
        old_count = self._counts.get(sensor)
        if old_count is not None and not self._lost and sequence > old_count + 1:
            self._gaps.append((self._seconds(time_ns), sequence - old_count - 1))
        self._counts[sensor] = sequence

    def _add_condition(self, moment: LogEntry) -> None:
        condition = moment.condition
        if condition is None:
            return
        self._links[condition.link] += 1
        self._max_celsius = condition.hot
        self._uncalibrated = self._uncalibrated or not condition.calibrated
        if condition.temperature is not None:
            self._celsius.append(condition.temperature)

    def _seconds(self, time_ns: int) -> float:
        return max(0.0, 1e-9 * (time_ns - self._first_ns))
