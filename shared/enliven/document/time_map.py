"""The time map of a layer: converts times of the project to times of the layer's take."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

from enliven.document.keys import CurveKey, curve_from_keys
from enliven.errors import InputError

MIN_SPEED = 0.02
"""Minimum speed factor of a speed key. Time must never stop or reverse."""
MAX_SPEED = 50.0
"""Maximum speed factor of a speed key."""
_MIN_KEY_INTERVAL_S = 1e-3
"""Minimum time in seconds between two keys of a weight or a speed. It is shorter than any frame."""
_MAX_LOOP_TIME_RATIO = 4.0
"""Maximum time until all loops start together again, as a multiple of the required minimum duration."""
_MAX_LOOP_MISMATCH = 0.02
"""Maximum mismatch between loops that count as starting together, as a fraction of a loop. A smaller mismatch
is not visible as a jump."""
_SHORTEST_ROUND = 0.05
"""Minimum duration of a loop in seconds. A shorter one counts as a static pose and is ignored."""
_TOUCHING_CLIPS_S = 1e-9
"""Maximum distance in seconds between two clips that touch. It allows for rounding."""


@dataclass(frozen=True)
class Segment:
    """A segment of a lane, shown as one clip on the timeline. It plays a part of a take.

    Attributes:
        begin, end: start and end of the segment, seconds of the lane.
        first: time of the take, in seconds, at ``begin``. Before its first and after its last frame, a take
            is constant.
        speed: seconds of the take per second of the lane. A negative speed plays backwards.
    """

    begin: float
    end: float
    first: float = 0.0
    speed: float = 1.0

    @property
    def last(self) -> float:
        """The time of the take, in seconds, that plays at :attr:`end`."""
        return self.first + (self.end - self.begin) * self.speed

    def compute_take_time(self, at: float) -> float:
        """Converts a time of the lane to a time of the take, seconds."""
        return self.first + (at - self.begin) * self.speed


class Moment(NamedTuple):
    """The state of a layer at one time: a blend of two times of its take.

    The take at ``second`` has the weight 1 - ``share``, and the take at ``other`` has the weight ``share``.
    ``rounds`` is the number of completed loops of the lane. ``weight``, from 0 to 1, is the layer's strength.
    It is 0 if no segment plays and no frame is frozen (``hold``).
    """

    second: float
    other: float
    share: float
    rounds: int
    weight: float


@dataclass(frozen=True, eq=False, kw_only=True)
class TimeMap:
    """The timing of a take. The layers of all rigs are subclasses of it.

    A layer plays a lane: a sequence of segments of its take. Two overlapping segments are blended over the
    overlap. A lane without segments plays the take once. At t seconds of the project, the lane is at (t -
    offset) speed seconds, counted from its end if the speed is negative. After the last segment, a layer
    freezes the last frame, has no effect, or loops.

    Attributes:
        offset: time of the project at which the lane begins, seconds.
        speed: 1 plays as recorded, 0.5 at half speed, and negative values backwards from the end.
        loop: True restarts the lane at its end.
        segments: the segments of the lane. The first begins at 0. Empty means the whole take.
        hold: True freezes the first frame before the lane, and the last frame after it. Otherwise the layer
            is muted before and after the lane.
        ease: seconds of the lane over which a layer that does not hold fades in and out.
        smooth: standard deviation of the Gaussian filter that smooths the take, seconds. 0 plays the take as
            recorded.
        recorded: the name of the recording that created the layer, or empty.
        alternatives: the name of the group of alternative takes to which the recording belongs. Only one take
            of a group plays, on all characters. Empty without a group.
        weights: keyframes of the layer's weight, from 0 to 1, in the order of time. Empty means full weight.
        speeds: keyframes of the lane's speed factor. It is above 0, because time must not stop or reverse.
            Empty means 1.
    """

    offset: float = 0.0
    speed: float = 1.0
    loop: bool = False
    segments: tuple[Segment, ...] = ()
    hold: bool = True
    ease: float = 0.0
    smooth: float = 0.0
    recorded: str = ""
    alternatives: str = ""
    weights: tuple[CurveKey, ...] = ()
    speeds: tuple[CurveKey, ...] = ()

    def check_time(self, where: str) -> None:
        """Checks that all values can be played.

        Raises:
            InputError: if a number is not finite, a speed is 0, or segments are not in sequence.
        """
        for name in ("segments", "weights", "speeds"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if problem := _describe_key_problem(self.weights, self.speeds):
            advice = (
                f"Use weights from 0 to 1, speeds of at least {MIN_SPEED}, and a different time for each key."
            )
            raise InputError(problem, where=where, remedy=advice)
        if self.speed == 0.0 or not (math.isfinite(self.offset) and math.isfinite(self.speed)):
            message = f"the offset {self.offset} s or the speed {self.speed} of the layer is not valid"
            raise InputError(
                message, where=where, remedy="Set a finite offset in seconds, and a speed that is not 0."
            )
        if not (0.0 <= self.ease < math.inf and 0.0 <= self.smooth < math.inf):
            message = f"the fade of {self.ease} s or the smoothing of {self.smooth} s is not valid"
            raise InputError(message, where=where, remedy="Set durations of at least 0 s.")
        if problem := _describe_problem(self.segments):
            raise InputError(problem, where=where, remedy="Move one of the clips, or trim it.")

    def lane(self, length: float) -> tuple[Segment, ...]:
        """Returns the segments of the lane for a take of ``length`` seconds. There is at least one
        segment."""
        return self.segments or (Segment(0.0, length),)

    def compute_ends(self, length: float) -> tuple[float, float]:
        """Returns the times of a take of ``length`` seconds that play at the lane's start and end, in
        seconds."""
        lane = self.lane(length)
        return _clamp_second(lane[0].first, length), _clamp_second(lane[-1].last, length)

    def extent(self, length: float) -> float:
        """Returns the duration of the lane in seconds."""
        return self.segments[-1].end if self.segments else length

    def moment(self, time: float, length: float) -> Moment:
        """Returns the state of a take of ``length`` seconds at a time of the project.

        :class:`enliven.motion.layers.timing.LayerClocks` is the compiled version for many layers and times.
        """
        extent, lane = self.extent(length), self.lane(length)
        lane_time = (self.convert_to_unwarped_time(time) - self.offset) * self.speed + (
            extent if self.speed < 0.0 else 0.0
        )
        rounds = math.floor(lane_time / extent) if self.loop and extent > 0.0 else 0
        lane_time -= rounds * extent
        number = max((k for k, segment in enumerate(lane) if segment.begin <= lane_time), default=0)
        current, previous = lane[number], lane[max(number - 1, 0)]
        weight = 1.0
        if not self.hold:
            weight = self._weight_within(lane_time, rounds, lane, number)
        if self.weights:
            weight *= float(curve_from_keys(self.weights)([time - self.offset])[0])
        # After the end of a clip, its last frame is shown until the next clip begins.
        second = _clamp_second(
            current.compute_take_time(min(max(lane_time, current.begin), current.end)), length
        )
        if number and lane_time < previous.end:
            fraction = ease_in_out((lane_time - current.begin) / (previous.end - current.begin))
            return Moment(
                _clamp_second(previous.compute_take_time(lane_time), length), second, fraction, rounds, weight
            )
        return Moment(second, second, 0.0, rounds, weight)

    def convert_to_unwarped_time(self, time: float) -> float:
        """Converts a time of the project to the time at which the same frame would play without speed keys.

        The result increases with the time. At the offset, both times are equal.
        """
        if not self.speeds:
            return time
        return self.offset + float(curve_from_keys(self.speeds).integrate([time - self.offset])[0])

    def convert_to_warped_time(self, time: float) -> float:
        """Converts a time without speed keys to a time of the project. It is the inverse of
        :meth:`convert_to_unwarped_time`.
        """
        return (
            self.offset + curve_from_keys(self.speeds).time_at_integral(time - self.offset)
            if self.speeds
            else time
        )

    def _weight_within(self, at: float, rounds: int, lane: Sequence[Segment], number: int) -> float:
        """Returns the weight of a layer without ``hold`` at a time of its lane, within a loop."""
        begin, end = find_clip_run(lane, number)
        if self.loop:
            # A gapless loop only fades in, at the start of its first round. That is the end of the lane if it
            # plays backwards. The layer has no effect before its first loop.
            if (rounds < 0 and self.speed > 0.0) or (rounds > 0 and self.speed < 0.0):
                return 0.0
            if begin <= _TOUCHING_CLIPS_S and (rounds or self.speed < 0.0):
                begin = -math.inf
            if end >= lane[-1].end - _TOUCHING_CLIPS_S and (rounds or self.speed > 0.0):
                end = math.inf
        if not begin <= at <= end:
            return 0.0
        return (
            ease_in_out(min((at - begin) / self.ease, (end - at) / self.ease, 1.0))
            if self.ease > 0.0
            else 1.0
        )

    def find_played_time(self, time: float, length: float) -> tuple[float, int]:
        """Returns the time within a take of ``length`` seconds that has the largest weight at a time of the
        project.

        Returns:
            The time of the take in seconds, within [0, length], and the number of completed loops of the lane
            (0 without a loop).
        """
        moment = self.moment(time, length)
        return (moment.other if moment.share > 0.5 else moment.second), moment.rounds

    def time_of(self, second: float, length: float) -> float:
        """Returns the time of the project at which a time of the take first plays.

        If no segment contains the time, the first segment is extrapolated.
        """
        lane = self.lane(length)
        lane_times = [segment.begin + (second - segment.first) / segment.speed for segment in lane]
        playing_times = [
            lane_time
            for lane_time, segment in zip(lane_times, lane, strict=True)
            if segment.begin <= lane_time <= segment.end
        ]
        lane_time = min(playing_times) if playing_times else lane_times[0]
        lane_time -= self.extent(length) if self.speed < 0.0 else 0.0
        return self.convert_to_warped_time(self.offset + lane_time / self.speed)

    def plays(self, second: float, length: float) -> bool:
        """Returns True if a time of the take is played at some time. It is not played if it was trimmed
        off."""
        ends = (sorted((segment.first, segment.last)) for segment in self.lane(length))
        return any(low - _TOUCHING_CLIPS_S <= second <= high + _TOUCHING_CLIPS_S for low, high in ends)

    def compute_loop_duration(self, length: float) -> float:
        """Returns the duration of one loop with a take of ``length`` seconds, in seconds of the project."""
        lasts = self.extent(length) / abs(self.speed)
        return self.convert_to_warped_time(self.offset + lasts) - self.offset if self.speeds else lasts

    def end(self, length: float) -> float:
        """Returns the time of the project at which a lane with a take of ``length`` seconds has been played
        once."""
        return self.offset + self.compute_loop_duration(length)

    def add_delay(self, delay: float) -> Self:
        """Returns the time map delayed by ``delay`` seconds."""
        return replace(self, offset=self.offset + delay)

    def clips(self, length: float) -> tuple[Segment, ...]:
        """Returns the segments in seconds of the project, in the order of time.

        Speed keys may change the speed within a segment. The speed of a returned segment is the mean.
        """
        extent, speed = self.extent(length), self.speed
        start = self.offset - (extent / speed if speed < 0.0 else 0.0)
        segments = []
        for segment in self.lane(length):
            low, high = sorted((start + segment.begin / speed, start + segment.end / speed))
            first, faster = (segment.first if speed > 0.0 else segment.last), segment.speed * speed
            if self.speeds:
                faster *= high - low
                low, high = self.convert_to_warped_time(low), self.convert_to_warped_time(high)
                faster /= high - low
            segments.append(Segment(low, high, first, faster))
        return tuple(sorted(segments, key=lambda one: one.begin))

    def with_clips(self, clips: Sequence[Segment], length: float) -> Self:
        """Returns the time map with other segments, which are given in seconds of the project. A single
        segment that plays the whole take is replaced by an empty list.

        Raises:
            InputError: without segments, or if they are not in sequence.
        """
        if not clips:
            raise InputError(
                "the last clip of a layer cannot be removed",
                where="clip",
                remedy="Remove the whole layer instead.",
            )
        ordered = sorted(clips, key=lambda one: one.begin)
        first, start = ordered[0], ordered[0].begin
        low, high = sorted((first.first, first.last))
        if len(ordered) == 1 and abs(low) < _TOUCHING_CLIPS_S and abs(high - length) < _TOUCHING_CLIPS_S:
            return replace(self, offset=start, speed=first.speed, segments=())
        lane = tuple(
            replace(segment, begin=segment.begin - start, end=segment.end - start) for segment in ordered
        )
        return replace(self, offset=start, speed=1.0, segments=lane)

    def with_lane(self, change: Callable[[Self], Self]) -> Self:
        """Applies an edit that does not support keys of weight or speed.

        Args:
            change: a function that edits the layer without these keys. The times of this layer are those that
                :meth:`convert_to_unwarped_time` returns.
        """
        changed = change(self._remove_keys())
        if not (self.weights or self.speeds):
            return changed
        new_begin = self.convert_to_warped_time(changed.offset)
        shift = new_begin - self.offset

        def shifted(keys: Sequence[CurveKey]) -> tuple[CurveKey, ...]:
            return tuple(replace(key, second=key.second - shift) for key in keys)

        return replace(changed, offset=new_begin, weights=shifted(self.weights), speeds=shifted(self.speeds))

    def _remove_keys(self) -> Self:
        return replace(self, weights=(), speeds=())

    def list_timing_values(self) -> tuple[object, ...]:
        """Returns all values that determine when and how the take plays. Layers with equal values share a bar
        on the timeline.
        """
        return tuple(getattr(self, field.name) for field in fields(TimeMap))

    def with_default_timing(self) -> Self:
        """Returns the layer with default timing: it starts at 0, plays once at recorded speed, and is not
        smoothed.
        """
        return replace(self, **{field.name: field.default for field in fields(TimeMap)})


class LayerBase(TimeMap):
    """A layer of any rig: the take that it plays, its timing, and whether it is muted.

    Attributes:
        source: the collection of the project that contains its take: "takes" or "streams".
        take: the id of the take in this collection.
        muted: True leaves the layer out.
    """

    source: ClassVar[str] = "takes"
    if TYPE_CHECKING:

        @property
        def take(self) -> str:
            """The id of the take in the collection :attr:`source`."""
            ...

        @property
        def muted(self) -> bool:
            """True if the layer is left out."""
            ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """Returns its references: collections of the project, and ids in them."""
        return ((self.source, self.take),)

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """Returns the layer with renamed ids."""
        return replace(self, take=names[self.source, self.take])  # type: ignore[call-arg]


def compute_closing_time(loop_lengths: Sequence[float], min_time: float) -> float:
    """Returns a time, at least ``min_time``, at which loops of these lengths all start together again, at
    least nearly.

    Returns ``min_time`` if there is not a loop, or if the time would be more than four times ``min_time``.
    All times are in seconds.
    """
    loop_lengths = [seconds for seconds in loop_lengths if seconds > _SHORTEST_ROUND]
    if not loop_lengths:
        return min_time
    longest = max(loop_lengths)
    for count in range(
        math.ceil(min_time / longest - _MAX_LOOP_MISMATCH),
        math.ceil(_MAX_LOOP_TIME_RATIO * min_time / longest) + 1,
    ):
        length = count * longest
        if all(
            abs(length / seconds - round(length / seconds)) < _MAX_LOOP_MISMATCH for seconds in loop_lengths
        ):
            return length
    return min_time


def ease_in_out(fraction: float) -> float:
    """Returns the progress of a blend that starts and ends with zero speed (smoothstep): 3 s^2 - 2 s^3."""
    return fraction * fraction * (3.0 - 2.0 * fraction)


def find_clip_run(lane: Sequence[Segment], number: int) -> tuple[float, float]:
    """Returns the start and end in seconds of the run of touching segments that contains segment
    ``number``.
    """
    low = high = number
    while low > 0 and lane[low - 1].end >= lane[low].begin - _TOUCHING_CLIPS_S:
        low -= 1
    while high + 1 < len(lane) and lane[high].end >= lane[high + 1].begin - _TOUCHING_CLIPS_S:
        high += 1
    return lane[low].begin, lane[high].end


def _describe_key_problem(weights: Sequence[CurveKey], speeds: Sequence[CurveKey]) -> str:
    for keys in (weights, speeds):
        if any(b.second - a.second < _MIN_KEY_INTERVAL_S for a, b in pairwise(keys)):
            return (
                "two keys of the layer's weight or speed are at the same time, or the keys are not in "
                "the order of time"
            )
    if any(not 0.0 <= key.value <= 1.0 for key in weights):
        return (
            "a key sets the layer's weight to "
            f"{max((key.value for key in weights), key=lambda v: abs(v - 0.5))}, which is not "
            "between 0 and 1"
        )
    if any(not MIN_SPEED <= key.value <= MAX_SPEED for key in speeds):
        return (
            f"the keys set the layer's speed to values from {min(key.value for key in speeds)} to "
            f"{max(key.value for key in speeds)}, outside {MIN_SPEED}..{MAX_SPEED}"
        )
    return ""


def _clamp_second(second: float, length: float) -> float:
    return min(max(second, 0.0), length)


def _describe_problem(segments: Sequence[Segment]) -> str:
    numbers = [x for segment in segments for x in (segment.begin, segment.end, segment.first, segment.speed)]
    if not all(math.isfinite(x) for x in numbers) or any(segment.speed == 0.0 for segment in segments):
        return "a clip of the layer has an invalid start, end or speed"
    if any(segment.end <= segment.begin for segment in segments):
        return "a clip of the layer has no duration"
    if segments and abs(segments[0].begin) > _TOUCHING_CLIPS_S:
        return "the first clip of the layer does not begin at 0 s"
    if any(b.begin <= a.begin or b.end <= a.end for a, b in pairwise(segments)):
        return "a clip of the layer is completely inside another clip"
    if any(c.begin < a.end - _TOUCHING_CLIPS_S for a, c in zip(segments, segments[2:], strict=False)):
        return "three clips of the layer play at the same time"
    return ""
