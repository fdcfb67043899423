"""The law that every reader must keep.

A reader returns a value that can be used, or raises an EnlivenError (on the wire Malformed, or the ValueError
that receivers expect of an array); nothing else, in bounded time and in bounded memory.
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
"""Seconds that one file may take on a machine with other work; each takes milliseconds."""


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: of the reader, and of the dice that mutate its files.
        count: mutations in `make test`.
        make: a mutated file.
        read: what is done with it, in a folder of its own.
        allowed: what it may raise.
    """

    name: str
    count: int
    make: Maker
    read: Callable[[bytes, Path], Any]
    allowed: tuple[type[BaseException], ...] = (EnlivenError,)


class Broken(AssertionError):
    """A reader that broke the law; the file is beside the message."""


def check(target: Target, seed: str, folder: Path, keep: Path) -> None:
    """Give a reader the file of a seed, in ``folder``; one that breaks it is kept in ``keep``.

    Raises:
        Broken: with the path of the file, where anything but the law's outcome comes back.
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
        what = f"{target.name}, seed {seed}: {type(error).__name__}: {str(error)[:300]}; the file is {kept}"
        raise Broken(what) from error


@contextmanager
def room() -> Iterator[str]:
    """A folder for one file after the other, in memory where there is such a place; readers log nothing."""
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
    """What makes a file of a reader: the same for the same seed, on every machine."""
    return Random(f"{target.name} {seed}")


class TooSlow(BaseException):
    """No Exception, so that no reader takes it for damage."""


@contextmanager
def _bounded() -> Iterator[None]:
    """Stops what takes longer than :data:`PATIENCE`."""

    def stop(*_: Any) -> None:
        raise TooSlow(f"longer than {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
