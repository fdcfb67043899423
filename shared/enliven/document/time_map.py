"""The time map of a layer: which second of its take is played at which second of the project."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

from enliven.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class TimeMap:
    """When a take is played; the layers of all rigs are time maps.

    At t seconds of the project, (t - offset) speed seconds of the take are played, counted from its end where
    the speed is below 0. Before its begin and after its end the take stands still, unless it loops.

    Attributes:
        offset: seconds of the project's time at which the take begins.
        speed: 1 as recorded; 0.5 half as fast; below 0 backwards from the end.
        loop: begin again at the end; otherwise the last frame stays.
    """

    offset: float = 0.0
    speed: float = 1.0
    loop: bool = False

    def check_time(self, where: str) -> None:
        """Refuse numbers that cannot be played.

        Raises:
            InputError: where one is not finite, or the speed is 0.
        """
        if self.speed == 0.0 or not (math.isfinite(self.offset) and math.isfinite(self.speed)):
            what = f"offset {self.offset}, speed {self.speed} cannot be played"
            raise InputError(what, where=where, mend="Give seconds, and a speed that is not 0.")

    def played(self, time: float, length: float) -> tuple[float, int]:
        """The second of a take of ``length`` seconds that is played at a time of the project.

        :class:`enliven.motion.layers.timing.Clocks` is the same for many layers and times, compiled.

        Returns:
            The second, within [0, length]; and how many times the take was played to its end before, 0
            without a loop.
        """
        played = (time - self.offset) * self.speed + (length if self.speed < 0.0 else 0.0)
        rounds = math.floor(played / length) if self.loop and length > 0.0 else 0
        return min(max(played - rounds * length, 0.0), length), rounds

    def time_of(self, second: float, length: float) -> float:
        """The time of the project at which a second of the take is played first."""
        return self.offset + (second - (length if self.speed < 0.0 else 0.0)) / self.speed

    def lasting(self, length: float) -> float:
        """Seconds of the project that one round of a take of ``length`` seconds lasts."""
        return length / abs(self.speed)

    def end(self, length: float) -> float:
        """The time of the project at which a take of ``length`` seconds has been played once."""
        return self.offset + self.lasting(length)

    def later(self, delay: float) -> Self:
        """The same, ``delay`` seconds later."""
        return replace(self, offset=self.offset + delay)

    def ending(self, end: float, length: float, slowest: float, fastest: float) -> Self:
        """The same way round, at the speed with which a take of ``length`` seconds ends at ``end``.

        Args:
            slowest, fastest: bounds of the speed.
        """
        speed = min(max(length / max(end - self.offset, 1e-3), slowest), fastest)
        return replace(self, speed=speed if self.speed > 0.0 else -speed)


class Playing(TimeMap):
    """A layer of any rig: the take that it plays, when, and whether it is heard.

    Attributes:
        source: the map of the project that holds its take: "takes" or "streams".
        take: the id there.
        muted: true leaves the layer out.
    """

    source: ClassVar[str] = "takes"
    if TYPE_CHECKING:

        @property
        def take(self) -> str: ...

        @property
        def muted(self) -> bool: ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """What it refers to: maps of the project, and ids there."""
        return ((self.source, self.take),)

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """The same layer with other ids of what it refers to."""
        return replace(self, take=names[self.source, self.take])  # type: ignore[call-arg]
