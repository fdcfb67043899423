"""The times of restarts: the delay after a failure, and the nightly restart."""

from __future__ import annotations

import re
import time

from enliven.errors import InputError

MAX_WAIT_S = 30.0
"""Maximum delay between two restarts, in seconds. The delay doubles after each restart, so that a program
that always fails uses few resources.
"""
STABLE_RUN_S = 60.0
"""Running time, in seconds, after which a program counts as stable. Its next restart is then immediate."""
_SECOND_WAIT_S = 1.0
"""Delay before the second restart in a row, in seconds. After this time, ports and the camera are free
again."""
_NIGHTLY_WINDOW_MIN = 60
"""Length of the window for the nightly restart, in minutes. It covers the hour that daylight saving time
skips."""
_MIN_NIGHTLY_INTERVAL_S = 3 * 3600.0
"""Minimum time between two nightly restarts, in seconds. It covers the window and the hour that daylight
saving time repeats."""
_TIME_OF_DAY_PATTERN = re.compile(r"([01]\d|2[0-3]):([0-5]\d)")


class RestartBackoff:
    """The delays between the restarts of one program: none, then 1 s, doubled up to :data:`MAX_WAIT_S`.

    Args:
        max_wait_s: maximum delay in seconds.
        stable_run_s: running time in seconds after which the next restart is immediate again.
    """

    def __init__(self, max_wait_s: float = MAX_WAIT_S, stable_run_s: float = STABLE_RUN_S) -> None:
        self._max_wait_s, self._stable_run_s = max_wait_s, stable_run_s
        self._next_wait_s = 0.0

    def wait_after(self, run_s: float) -> float:
        """Returns the delay in seconds before the restart of a program that ran for ``run_s`` seconds."""
        wait_s = 0.0 if run_s >= self._stable_run_s else self._next_wait_s
        self._next_wait_s = min(max(2 * wait_s, _SECOND_WAIT_S), self._max_wait_s)
        return wait_s


class NightlyRestart:
    """The time of a nightly restart. It handles jumps of the clock and daylight saving time.

    A restart is due within the hour after the time of day, but at most once in three hours of the monotonic
    clock.

    Args:
        time_of_day: local time such as "04:00". Empty means never.
        monotonic_s: current time of the monotonic clock in seconds.

    Raises:
        InputError: if the time of day is not of the form HH:MM.
    """

    def __init__(self, time_of_day: str, monotonic_s: float) -> None:
        self._minute = parse_time_of_day(time_of_day) if time_of_day else None
        self._last_s = monotonic_s

    def is_due(self, monotonic_s: float, unix_s: float) -> bool:
        """Returns True if the restart is due. Returns True once per night.

        Args:
            monotonic_s: time of the monotonic clock in seconds.
            unix_s: Unix time in seconds, which may jump.
        """
        if self._minute is None or monotonic_s - self._last_s < _MIN_NIGHTLY_INTERVAL_S:
            return False
        local = time.localtime(unix_s)
        minutes_since = (local.tm_hour * 60 + local.tm_min - self._minute) % (24 * 60)
        if minutes_since >= _NIGHTLY_WINDOW_MIN:
            return False
        self._last_s = monotonic_s
        return True


def parse_time_of_day(text: str) -> int:
    """Returns a time of day such as "04:00" in minutes since midnight.

    Raises:
        InputError: if it is not of the form HH:MM.
    """
    match = _TIME_OF_DAY_PATTERN.fullmatch(text)
    if match is None:
        raise InputError(
            f"{text!r} is not a time of day",
            where="care.restart_at",
            remedy="Write the time as HH:MM, such as 04:00.",
        )
    return int(match[1]) * 60 + int(match[2])
