"""The rule that every reader must keep.

A reader returns a usable value or raises an EnlivenError (on the wire MalformedMessageError, or the
ValueError that receivers expect for an array). Nothing else may happen, and time and memory are bounded.
"""

from __future__ import annotations

import logging
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from fuzz_seeds import Maker

from enliven.errors import EnlivenError

PATIENCE = 30
"""Timeout for one file on a busy machine, seconds. Each takes milliseconds."""


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: name of the reader, and seed of its random generator.
        count: number of mutations in `make test`.
        make: function that returns a mutated file.
        read: function that reads the file, in a separate folder.
        allowed: exceptions that it may raise.
    """

    name: str
    count: int
    make: Maker
    read: Callable[[bytes, Path], Any]
    allowed: tuple[type[BaseException], ...] = (EnlivenError,)


class Broken(AssertionError):
    """Raised if a reader breaks the rule. The message contains the path of the file."""


def check(target: Target, seed: str, folder: Path, keep: Path) -> None:
    """Gives a reader the file of a seed, in ``folder``. A file that breaks the reader is kept in ``keep``.

    Raises:
        Broken: if the outcome is not allowed; contains the path of the file.
    """
    data = target.make(dice_of(target, seed))
    try:
        with _bounded(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.read(data, folder)
    except target.allowed:
        return
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        kept = keep / f"broken-{target.name.replace(' ', '-')}-{seed}.bin"
        kept.write_bytes(data)
        summary = (
            f"{target.name}, seed {seed}: {type(error).__name__}: {str(error)[:300]}; the file is {kept}"
        )
        raise Broken(summary) from error


@contextmanager
def room() -> Iterator[str]:
    """Yields a folder for one file after the other, in memory if possible. Readers log nothing."""
    levels = {name: logging.getLogger(name).level for name in ("enliven", "enliven_viewer")}
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
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


class TooSlow(BaseException):
    """Not a subclass of Exception, so that readers do not mistake it for damage in the file."""


@contextmanager
def _bounded() -> Iterator[None]:
    """Stops anything that takes longer than :data:`PATIENCE`."""

    def stop(*_: Any) -> None:
        raise TooSlow(f"longer than {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
