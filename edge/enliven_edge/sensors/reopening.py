"""A live sensor that never ends.

It is read on a separate thread and reopened with back-off after failures.

A driver is a small class that only opens, reads and closes a device. For all drivers, this module handles
devices that are lost, hang, or return, possibly with another clock.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import logging
import statistics
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Literal

from enliven.errors import EnlivenError, InputError
from enliven.frames import TIME_LIMIT_NS, Frame
from enliven_edge.sensors.base import CHECK_IT, Condition, Sensor, SensorFault
from enliven_edge.sensors.isolation.isolated import IsolatedOpener
from enliven_edge.sensors.power_cycle import CameraPower
from enliven_edge.sensors.worker_thread import WorkerThread

log = logging.getLogger(__name__)

FIRST_WAIT_S = 0.1
"""Seconds before the first attempt to reopen a sensor that failed."""
MAX_WAIT_S = 0.5
"""Maximum seconds between two attempts. Each interval is twice the previous one. So a device that is
available again is used within a second, including the time to open it."""
GOOD_FRAMES = 30
"""Number of good frames (one second) after which the back-off restarts at its first interval."""
BAD_FRAMES = 30
"""Number of consecutive unusable frames after which the device is reopened."""
CALL_TIMEOUTS_S: dict[str, float] = {"read": 10.0, "open": 60.0, "close": 10.0}
"""Seconds after which a driver's call counts as hanging and is abandoned. Opening may load firmware."""
_READ_TIMEOUT_S = 0.25
"""Maximum seconds that one call waits for a frame. The device can be closed between two calls."""
_FIRST_FRAME_TIMEOUT_S = 15.0
"""Seconds after opening in which a camera without frames counts as starting. After 10 s, isolated drivers
report a fault, and the device is opened again."""
_MAX_HANGING_THREADS = 4
"""Maximum number of threads that hang in a driver. No further attempt is made until one returns."""
_CLOSE_TIMEOUT_S = 0.25
"""Maximum seconds that closing waits for the device. After that, the device is closed in the background."""
_CLOCK_JUMP_NS = 1_000_000_000
"""Maximum nanoseconds that a clock may be ahead after its device was reopened, and still count as the same
clock."""
_CLOCK_FRAMES = 5
"""Number of frames in the median of the offset between the stream's clock and this machine's clock. The
median ignores a single wrong time."""


class ReopeningSensor(Sensor):
    """A :class:`~enliven_edge.sensors.base.Sensor` over devices that are opened one after the other.

    ``read`` raises a device's error once, as a :class:`SensorFault`, and then keeps reopening the device. A
    frame that cannot be used (an InputError) does not end the stream. Times also increase when the device
    changes. If the new device's clock has another origin, times continue by the elapsed wall-clock time.

    Args:
        open_device: opens the device. The first call is made in the constructor, later calls on a thread.
        first: the device, if it is open already.
        awaited: the sensor's name, if it is opened at the first read. If empty, it is opened immediately.
        power: resets a camera that cannot be opened. If None, it is never reset.

    Raises:
        Exception: the error of the first opening.
    """

    def __init__(
        self,
        open_device: Callable[[], Sensor],
        first: Sensor | None = None,
        awaited: str = "",
        power: CameraPower | None = None,
    ) -> None:
        self._open, self._power = open_device, power
        self._device: Sensor | None = None
        self._opened_at, self._has_frames = 0.0, False
        self.name, self._known = awaited, False
        if not awaited:
            self._use_device(first or open_device())
        if isinstance(open_device, IsolatedOpener):
            open_device.reuse_process()
        self._errands, self._doing = self._thread(), "read"
        self._left: list[WorkerThread] = []
        self._wait, self._due = FIRST_WAIT_S, 0.0
        self._good = self._bad = 0
        self._fresh, self._shift_ns = False, 0
        self._last_ns = self._last_reported_ns = 0
        self._ahead_ns: deque[int] = deque(maxlen=_CLOCK_FRAMES)
        self._closed = False

    def read(self, timeout: float | None = None) -> Frame | None:
        """Returns the next frame of the device, with an adjusted time. Opens the device if necessary.

        Returns None after :meth:`close`, or if the device's stream has ended. A call of the driver that hangs
        is abandoned, and the device is opened again.

        Raises:
            TimeoutError: if no frame arrived in time.
            SensorFault: once for each loss of the device.
            InputError: for a frame that cannot be used.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._closed:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            if not self._errands.is_busy:
                self._start_call(left)
            try:
                answer = self._errands.get_result(
                    _READ_TIMEOUT_S if left is None else min(left, _READ_TIMEOUT_S)
                )
            except Exception as error:
                if isinstance(error, TimeoutError) and (self._errands.is_busy or self._doing == "read"):
                    self._abandon_hanging_call()
                    if deadline is not None and time.monotonic() >= deadline:
                        raise
                    continue
                if self._doing != "close":
                    raise self._error_after_failure(error) from error
                answer = None
            if self._doing == "read":
                return self._adjust_time(answer)
            if answer is not None:
                self._use_device(answer)
                self._fresh = True
        return None

    @property
    def is_waiting(self) -> bool:
        """Returns True if the device is closed and each attempt to open it returns, or if it may be silent.

        Returns False while a call of the driver hangs, because a restart of the process may then help.
        """
        if any(thread.is_alive for thread in self._left):
            return False
        if self._device is None:
            return True
        if self._errands.is_busy and self._errands.waiting_seconds > 2.0 * _READ_TIMEOUT_S:
            return False
        if self._device.may_be_silent:
            return True
        return not self._has_frames and time.monotonic() - self._opened_at < _FIRST_FRAME_TIMEOUT_S

    def condition(self) -> Condition | None:
        """Returns the condition of the device, or None without an open device or a report."""
        device = self._device
        return None if device is None else device.condition()

    def close(self) -> None:
        """Closes the device. A second call does nothing. If the device hangs, it is closed in the background.

        It may be called while another thread reads. ``read`` then returns None.
        """
        if not self._closed:
            self._closed = True
            if isinstance(self._open, IsolatedOpener):
                self._open.close()
            if not self._errands.finish(functools.partial(_close_devices, self._device), _CLOSE_TIMEOUT_S):
                log.warning("%s does not release its device", self.name)

    def _start_call(self, timeout: float | None) -> None:
        """Starts a call on the thread: reads a frame, or opens the device if the next attempt is due.

        Raises:
            TimeoutError: if the next attempt is not due within ``timeout`` seconds.
        """
        if self._device is not None:
            turn = _READ_TIMEOUT_S if timeout is None else min(timeout, _READ_TIMEOUT_S)
            self._run_in_background("read", functools.partial(self._device.read, turn))
            return
        wait = self._due - time.monotonic()
        if timeout is not None and wait > timeout:
            time.sleep(timeout)
            raise TimeoutError(f"{self.name} is opened again in {wait - timeout:.1f} s")
        time.sleep(max(0.0, wait))
        self._run_in_background(
            "open", self._reset_and_open if self._power is not None and self._power.is_due else self._open
        )

    def _reset_and_open(self) -> Sensor:
        """Resets the camera, and opens it. Runs on the thread."""
        assert self._power is not None
        self._power.cycle()
        return self._open()

    def _use_device(self, device: Sensor) -> None:
        """Uses an opened device from now on. The first device gives the stream its name."""
        self._device, self.fps = device, device.fps
        self._opened_at, self._has_frames = time.monotonic(), False
        self.made_up = not device.is_device
        if not self._known:
            self.name, self._known = device.name, True

    def _run_in_background(self, what: Literal["read", "open", "close"], call: Callable[[], Any]) -> None:
        self._doing = what
        self._errands.start_call(call)

    def _adjust_time(self, frame: Frame | None) -> Frame | None:
        """Returns a frame of the device with its time converted to the stream's clock."""
        self._bad = 0
        self._good += 1
        self._has_frames = True
        if self._power is not None and self._good == GOOD_FRAMES:
            self._power.record_frame()
        if self._good >= GOOD_FRAMES:
            self._wait = FIRST_WAIT_S
        time_ns = getattr(frame, "time_ns", None)
        if frame is None or type(time_ns) is not int or abs(time_ns) >= TIME_LIMIT_NS:
            return frame
        now_ns = time.monotonic_ns()
        if self._fresh and self._ahead_ns:
            self._shift_ns = self._compute_time_shift(time_ns, now_ns)
        self._fresh, self._last_ns = False, now_ns
        self._last_reported_ns = time_ns + self._shift_ns
        self._ahead_ns.append(self._last_reported_ns - now_ns)
        return dataclasses.replace(frame, time_ns=time_ns + self._shift_ns) if self._shift_ns else frame

    def _compute_time_shift(self, time_ns: int, now_ns: int) -> int:
        """Returns the nanoseconds to add to the times of a device that was just opened.

        Uses the previous shift, or 0, if the times then continue to increase. Otherwise computes the shift
        from the elapsed time of this machine's clock.
        """
        ahead_ns = statistics.median_low(self._ahead_ns)
        # Also compare with the last reported time, because on a busy machine the last frame may have arrived
        # with less delay than usual.
        after_ns = max(self._last_ns + ahead_ns, self._last_reported_ns)
        for shift in (self._shift_ns, 0):
            if after_ns < time_ns + shift <= now_ns + ahead_ns + _CLOCK_JUMP_NS:
                return shift
        return max(now_ns + ahead_ns, after_ns + 1) - time_ns

    def _error_after_failure(self, error: Exception) -> Exception:
        """Returns the error to raise after the device raised ``error``."""
        if self._doing == "read" and isinstance(error, InputError) and self._bad < BAD_FRAMES:
            self._bad += 1
            return error
        device, self._device = self._device, None
        self._schedule_retry()
        if device is not None:
            self._run_in_background("close", device.close)
        message = error.what if isinstance(error, EnlivenError) else str(error) or "the reason is unknown"
        remedy = getattr(error, "remedy", "") or CHECK_IT
        return SensorFault(message, where=self.name, remedy=remedy)

    def _abandon_hanging_call(self) -> None:
        """Abandons a call that hangs. Its device is closed when the call returns.

        Raises:
            SensorFault: if a call was abandoned.
        """
        limit = CALL_TIMEOUTS_S[self._doing]
        self._left = [errands for errands in self._left if errands.is_alive]
        if self._errands.waiting_seconds < limit or len(self._left) >= _MAX_HANGING_THREADS:
            return
        self._errands.finish(functools.partial(_close_devices, self._device))
        self._left.append(self._errands)
        self._errands, self._device = self._thread(), None
        self._schedule_retry()
        raise SensorFault(
            f"the call {self._doing!r} took more than {limit:.0f} s",
            where=self.name,
            remedy="Unplug the device and plug it in again.",
        )

    def _schedule_retry(self) -> None:
        """Records a failure, and sets the time of the next attempt to open the device."""
        if self._power is not None:
            self._power.record_failure()
        self._due = time.monotonic() + self._wait
        self._wait = min(2 * self._wait, MAX_WAIT_S)
        self._good = self._bad = 0

    def _thread(self) -> WorkerThread:
        return WorkerThread(f"driver of {self.name}")


def open_reopening(
    open_sensor: Callable[[], Sensor], awaited: str = "", power: CameraPower | None = None
) -> Sensor:
    """Returns an opened sensor. A live sensor is reopened after every failure. A recording ends.

    Args:
        awaited: the name of a live sensor that may be missing at first. If empty, it must be present.
        power: resets a camera that cannot be opened. If None, it is never reset.
    """
    if awaited:
        return ReopeningSensor(open_sensor, awaited=awaited, power=power)
    first = open_sensor()
    return first if first.recorded else ReopeningSensor(open_sensor, first, power=power)


def _close_devices(device: Sensor | None, answers: list[Any]) -> None:
    """Closes a device, and the devices among the answers that were not taken."""
    for answer in (device, *answers):
        if hasattr(answer, "close"):
            with contextlib.suppress(Exception):
                answer.close()
