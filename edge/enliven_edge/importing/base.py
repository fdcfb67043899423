"""The interface of a reader of foreign recordings, and what the readers share."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from enliven.errors import InputError
from enliven.files import open_file, read_file
from enliven.frames import Frame

_MOST_TEXT = 1 << 28
"""Bytes of a table or a list: an hour of 25 joints in plain numbers has some 30 million."""


@dataclass(frozen=True)
class ImportOptions:
    """The user's options for files that do not state these themselves.

    Attributes:
        fps: frames a second where the files hold no times; None for the layout's usual rate.
        device: which of several sensors in one file to read; None for the one that saw most.
    """

    fps: float | None = None
    device: str | None = None

    def times_ns(self, usual_fps: float) -> Iterator[int]:
        """Yields evenly spaced times from 0, for files without their own."""
        fps = self.fps or usual_fps
        frame = 0
        while True:
            yield round(frame * 1e9 / fps)
            frame += 1


DEFAULT_OPTIONS = ImportOptions()


@runtime_checkable
class Reader(Protocol):
    """Reads one layout of foreign recordings.

    ``name`` is what ``--reader`` takes; ``description`` is one line; ``note`` states what the files leave
    open and what was assumed instead (empty where nothing was).
    """

    name: str
    description: str
    note: str

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns whether these files have this layout, judged by their content; never raises."""
        ...

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[Frame]:
        """Yields the frames, in the order of time.

        Raises:
            InputError: naming the file (and line) that cannot be understood.
        """
        ...


def natural_order(path: Path) -> tuple[str, list[int], str]:
    """Returns a key that sorts frame_9 before frame_10."""
    return str(path.parent), [int(digits) for digits in re.findall(r"\d+", path.name)], path.name


def head_of(path: Path, size: int = 4096) -> bytes:
    """Returns the first bytes of a file; empty where it cannot be read."""
    try:
        with open_file(path) as file:
            return file.read(size)
    except (InputError, OSError):
        return b""


def text_of(path: Path) -> str:
    """Returns the text of a file.

    Raises:
        InputError: where it cannot be read as UTF-8.
    """
    try:
        return read_file(path, _MOST_TEXT).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"it cannot be read as text ({error})", where=str(path)) from None


def only_one(paths: Sequence[Path]) -> Path:
    """Returns the only recording among the files, for a layout with one file for each recording.

    Raises:
        InputError: where there are several.
    """
    if len(paths) > 1:
        names = ", ".join(path.name for path in paths[:4]) + (", ..." if len(paths) > 4 else "")
        raise InputError(
            f"these are {len(paths)} recordings ({names})",
            where=str(paths[0].parent),
            mend="Import one file at a time: each becomes a recording of its own.",
        )
    return paths[0]
