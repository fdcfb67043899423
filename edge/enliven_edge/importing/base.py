"""The interface of a reader of foreign recordings, and helpers that the readers share."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import decode_text, open_file, read_file
from enliven.frames import Frame

_MAX_TEXT_BYTES = 1 << 28
"""Maximum bytes of a text file: an hour of 25 joints as decimal numbers has some 30 million."""


def _make_ignore_note(sentence: str) -> None:
    """Ignores a note. It is the default of :attr:`ImportOptions.note`."""


@dataclass(frozen=True)
class ImportOptions:
    """The user's options for information that is missing in the files.

    Attributes:
        fps: frames per second for files without times. If None, uses the usual rate of the file layout.
        device: the sensor to read if a file has several. If None, reads the sensor that saw the most people.
        lens: fx, fy, cx and cy in pixels, for depth images without a camera file. If None, uses those of a
            common sensor.
        units_per_metre: number of depth units per metre. If None, it is detected, with millimetres as
            default.
        note: function that is called with a sentence for each assumption about the files, and for each
            skipped file.
    """

    fps: float | None = None
    device: str | None = None
    lens: tuple[float, float, float, float] | None = None
    units_per_metre: float | None = None
    note: Callable[[str], None] = _make_ignore_note

    def times_ns(self, usual_fps: float) -> Iterator[int]:
        """Yields evenly spaced times in nanoseconds from 0, for files without times."""
        fps = self.fps or usual_fps
        frame = 0
        while True:
            yield round(frame * 1e9 / fps)
            frame += 1


DEFAULT_OPTIONS = ImportOptions()


def parse_lens(text: str | None) -> tuple[float, float, float, float] | None:
    """Returns the four numbers of ``FX,FY,CX,CY``, or None if the text is empty.

    Raises:
        InputError: if these are not four numbers.
    """
    if text is None:
        return None
    try:
        fx, fy, cx, cy = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"{text!r} is not four numbers with commas between them",
            where="--lens",
            remedy="Pass focal lengths and principal point in pixels, such as --lens 525,525,319.5,239.5",
        ) from None
    return fx, fy, cx, cy


@runtime_checkable
class Reader(Protocol):
    """Reads one layout of foreign recordings.

    ``name`` is the value for ``--reader``. ``description`` is one line. ``note`` lists missing information
    and the assumptions that replace it (empty if there are none).
    """

    name: str
    description: str
    note: str

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if these files have this layout, judged by their content. Never raises."""
        ...

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[Frame]:
        """Yields the frames, ordered by time.

        Raises:
            InputError: for a file (and line) that cannot be read.
        """
        ...


class FileReader(Reader):
    """A layout with one file for each recording, which :meth:`matches` recognises."""

    def matches(self, path: Path) -> bool:
        """Returns True if a file has this layout, judged by its first bytes."""
        raise NotImplementedError

    def can_read(self, paths: Sequence[Path]) -> bool:
        """Returns True if :meth:`matches` accepts at least one of the files."""
        return any(self.matches(path) for path in paths)

    def choose_file(self, paths: Sequence[Path]) -> Path:
        """Returns the only file of this layout, or the only file at all. Raises InputError like
        :func:`require_single_file`.
        """
        return require_single_file([path for path in paths if self.matches(path)] or paths)


def natural_order(path: Path) -> tuple[str, list[int], str]:
    """Returns a sort key that sorts frame_9 before frame_10."""
    return str(path.parent), [int(digits) for digits in re.findall(r"\d+", path.name)], path.name


def read_head(path: Path, size: int = 4096) -> bytes:
    """Returns the first bytes of a file, or no bytes if it cannot be read."""
    try:
        with open_file(path) as file:
            return file.read(size)
    except (InputError, OSError):
        return b""


def read_text(path: Path) -> str:
    """Returns the text of a file.

    Raises:
        InputError: if it cannot be read.
    """
    return decode_text(read_file(path, _MAX_TEXT_BYTES))


def require_single_file(paths: Sequence[Path]) -> Path:
    """Returns the only recording among the files, for a layout with one file for each recording.

    Raises:
        InputError: if there are several.
    """
    if len(paths) > 1:
        names = ", ".join(path.name for path in paths[:4]) + (", ..." if len(paths) > 4 else "")
        raise InputError(
            f"the {len(paths)} files are separate recordings ({names})",
            where=str(paths[0].parent),
            remedy="Import one file at a time. Each file becomes a recording of its own.",
        )
    return paths[0]


def read_rows(path: Path, delimiter: str = ",") -> list[list[str]]:
    """Returns the rows of a delimited text file, without empty rows and an empty last field.

    Raises:
        InputError: if the file cannot be read or is empty.
    """
    try:
        rows = list(csv.reader(read_text(path).split("\n"), delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        problem = f"the file is not a table with {delimiter!r} between the columns"
        raise InputError(problem, where=str(path), remedy="Copy the file again from its source.") from None
    rows = [row[:-1] if row and row[-1].strip() == "" else row for row in rows]
    rows = [row for row in rows if row]
    if not rows:
        raise InputError("the file is empty", where=str(path), remedy="Copy the file again from its source.")
    return rows


def numbers_from_rows(rows: Sequence[Sequence[str]], path: Path, columns: int, first_line: int = 1) -> Float:
    """Returns the rows (R, columns) as numbers. An incomplete last row is dropped.

    Raises:
        InputError: for a line that is too short or contains other text.
    """
    if len(rows) > 1 and len(rows[-1]) != columns:
        rows = rows[:-1]
    check_row_lengths(rows, path, columns, first_line)
    try:
        return np.array([[float(cell) if cell.strip() else np.nan for cell in row] for row in rows])
    except ValueError:
        line, invalid_text = next(
            (line, cell)
            for line, row in enumerate(rows, first_line)
            for cell in row
            if cell.strip() and not are_numbers([cell])
        )
        raise InputError(f"line {line}: {invalid_text[:40]!r} is not a number", where=str(path)) from None


def check_row_lengths(rows: Sequence[Sequence[str]], path: Path, columns: int, first_line: int) -> None:
    """Raises InputError for the first row that does not have the expected number of columns."""
    for line, row in enumerate(rows, first_line):
        if len(row) != columns:
            raise InputError(
                f"line {line} has {len(row)} values, expected {columns}",
                where=str(path),
                remedy="Remove the line, or copy the file again.",
            )


def read_floats(path: Path) -> Float:
    """Returns the numbers (N,) of a text file, separated by whitespace.

    Raises:
        InputError: if it contains other text.
    """
    words = read_text(path).split()
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        invalid_text = next(word for word in words if not are_numbers([word]))
        problem = f"the file contains text that is not a number: {invalid_text[:40]!r}"
        raise InputError(problem, where=str(path)) from None


def are_numbers(cells: Sequence[str]) -> bool:
    """Returns True if every cell is a number."""
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return False
    return bool(cells)


def first_lines(head: bytes, count: int) -> list[str]:
    """Returns the first complete lines of a text file, or an empty list if it is not a text file."""
    text = decode_text(head)
    return text.split("\n")[:count] if "\0" not in text else []
