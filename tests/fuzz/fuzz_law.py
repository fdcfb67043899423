"""The rule for every reader: it returns a usable value or raises an EnlivenError.

On the wire, MalformedMessageError is also allowed, and the ValueError that receivers expect for an array. All
other exceptions are faults, and time and memory are bounded.
"""

from __future__ import annotations

import logging
import resource
import signal
import time
import traceback
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from fuzz_mutations import mutated

from enliven.errors import EnlivenError

PATIENCE = 30
"""Maximum processor time for one file, seconds. A typical file takes milliseconds."""
WAITING_FACTOR = 10
"""Maximum elapsed time for one file, as a multiple of the processor time. A reader may also wait."""
MAX_GROWTH_MB = 512
"""Maximum memory growth of the process for one file, MB. The first file also loads kernels."""
MIN_GROWTH_S = 0.005
"""Minimum time in which a process can grow by :data:`MAX_GROWTH_MB`, seconds. It assumes 100 GB/s."""
PEAK_INTERVAL = 64
"""Number of files between two measurements of peak memory. A measurement takes up to a millisecond."""
TICK_S = 0.5
"""Interval of the timers that find slow readers, seconds."""

Mutator = Callable[[bytes, bytes, Random], bytes]
"""A function that returns a mutation of its first argument. It splices in parts of the second argument."""


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: name of the reader, and seed of its random generator.
        count: number of mutations in `make test`.
        seeds: valid files.
        read: function that reads a file, in a separate folder.
        mutators: functions that mutate a file; each is equally likely. They accept any bytes.
        allowed: exceptions that it may raise.
    """

    name: str
    count: int
    seeds: tuple[bytes, ...]
    read: Callable[[bytes, Path], Any]
    mutators: tuple[Mutator, ...] = (mutated,)
    allowed: tuple[type[BaseException], ...] = (EnlivenError,)

    @property
    def slug(self) -> str:
        """Returns the name in a form for file names."""
        return self.name.replace(" ", "-")

    def make(self, dice: Random) -> bytes:
        """Returns a mutation of a seed, which depends only on the random generator."""
        seed, other = dice.choice(self.seeds), dice.choice(self.seeds)
        return dice.choice(self.mutators)(seed, other, dice)


class Broken(AssertionError):
    """Raised if a reader breaks the rule. The message contains the path of the file.

    Attributes:
        kept: the file.
        is_new: False if a file with the same fault is already stored.
    """

    def __init__(self, message: str, kept: Path, is_new: bool) -> None:
        super().__init__(message)
        self.kept, self.is_new = kept, is_new


def check(target: Target, seed: str, folder: Path, keep: Path) -> None:
    """Gives a reader the mutated file of a seed, in ``folder``. A file that breaks the reader is stored in
    ``keep``.

    Raises:
        Broken: if the outcome is not allowed. The message contains the path of the file.
    """
    check_bytes(target, target.make(dice_of(target, seed)), folder, keep, f"seed {seed}")


def check_bytes(target: Target, data: bytes, folder: Path, keep: Path, origin: str = "") -> None:
    """Gives a reader the bytes of a file, in ``folder``. A file that breaks the reader is kept in ``keep``.

    The name of a stored file depends on the line of code of the fault, so that each fault has one file.

    Raises:
        Broken: if the outcome is not allowed. The message contains the path of the file.
    """
    _peak.renew_sometimes()
    began = time.perf_counter()
    try:
        try:
            with _bounded():
                target.read(data, folder)
        finally:
            if time.perf_counter() - began > MIN_GROWTH_S:
                _peak.check()
    except target.allowed:
        return
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        raise keep_broken(target, data, keep, error, origin) from error


def keep_broken(target: Target, data: bytes, keep: Path, error: BaseException, origin: str = "") -> Broken:
    """Stores a file that breaks a reader. Returns the exception that describes it."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f"{Path(frames[-1].filename).name}:{frames[-1].name}" if frames else ""
    fault = zlib.crc32(f"{type(error).__name__} {place}".encode())
    kept = keep / f"broken-{target.slug}-{fault:08x}.bin"
    is_new = not kept.exists()
    if is_new:
        kept.write_bytes(data)
    reason = f"{type(error).__name__}: {str(error)[:300]}" + (f" ({place})" if place else "")
    about = ", ".join(filter(None, (target.name, origin)))
    return Broken(f"{about}: {reason}; the file is {kept}", kept, is_new)


class _PeakMemory:
    """The peak resident memory of this process, measured only as often as necessary."""

    def __init__(self) -> None:
        self._mb, self._files = peak_mb(), 0

    def renew_sometimes(self) -> None:
        """Measures the peak before every few files, so that one file does not count for the growth of
        many.
        """
        if self._files % PEAK_INTERVAL == 0:
            self._mb = peak_mb()
        self._files += 1

    def check(self) -> None:
        """Measures the peak. Raises TooLarge if it has grown too much."""
        before, self._mb = self._mb, peak_mb()
        if (grown := self._mb - before) > MAX_GROWTH_MB:
            raise TooLarge(f"took {grown:.0f} MB")


def peak_mb() -> float:
    """Returns the peak resident memory of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@contextmanager
def room() -> Iterator[str]:
    """Yields a folder for files, in memory if possible. Within the block, readers log and warn nothing."""
    levels = {name: logging.getLogger(name).level for name in ("enliven", "enliven_viewer")}
    place = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with TemporaryDirectory(dir=place) as folder, warnings.catch_warnings(), timers():
        warnings.simplefilter("ignore")
        try:
            for name in levels:
                logging.getLogger(name).setLevel(logging.CRITICAL)
            yield folder
        finally:
            for name, level in levels.items():
                logging.getLogger(name).setLevel(level)


def dice_of(target: Target, seed: str) -> Random:
    """Returns the random generator for one file of a reader. The same seed gives the same file on every
    machine."""
    return Random(f"{target.name} {seed}")


class TooLarge(Exception):
    """Raised if reading a file takes more than :data:`MAX_GROWTH_MB`."""


class TooSlow(BaseException):
    """Raised if reading takes too long. It is not an Exception, so that readers do not treat it as file
    damage.
    """


class _Ticks:
    """Counts the ticks of a timer while one file is read, which needs no system call for each file.

    Args:
        factor: the limit, as a multiple of :data:`PATIENCE`.
    """

    def __init__(self, factor: float) -> None:
        self._factor, self._count = factor, 0
        self._is_reading = False

    def begin(self) -> None:
        """Starts counting for a file."""
        self._count, self._is_reading = 0, True

    def end(self) -> None:
        """Stops counting. Later ticks are ignored."""
        self._is_reading = False

    def handle(self, *_: Any) -> None:
        """Counts a tick of the timer. Raises TooSlow beyond the limit."""
        if not self._is_reading:
            return
        self._count += 1
        if self._count * TICK_S > self._factor * PATIENCE:
            self._is_reading = False
            raise TooSlow(f"longer than {self._factor * PATIENCE:g} s")


_peak = _PeakMemory()
_processor, _waiting = _Ticks(1.0), _Ticks(WAITING_FACTOR)


@contextmanager
def timers() -> Iterator[None]:
    """Runs the timers that stop slow readers. A forked child process must start its own.

    At first only processor time counts, because a busy machine may suspend this process for long.
    """
    kinds = (
        (signal.SIGPROF, signal.ITIMER_PROF, _processor),
        (signal.SIGALRM, signal.ITIMER_REAL, _waiting),
    )
    before = [signal.signal(number, ticks.handle) for number, _, ticks in kinds]
    for _, timer, _ in kinds:
        signal.setitimer(timer, TICK_S, TICK_S)
    try:
        yield
    finally:
        for (number, timer, _), handler in zip(kinds, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


@contextmanager
def _bounded() -> Iterator[None]:
    """Stops code that takes more than :data:`PATIENCE` of processor time, or far more elapsed time, while
    :func:`timers` run.
    """
    _processor.begin()
    _waiting.begin()
    try:
        yield
    finally:
        _processor.end()
        _waiting.end()
