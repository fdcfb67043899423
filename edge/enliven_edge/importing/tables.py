"""Reads numbers from text files; an error names the line."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven_edge.importing.base import text_of


def rows_of(path: Path, delimiter: str = ",") -> list[list[str]]:
    """Returns the rows of a delimited text file, without empty rows and without the empty field after a final
    delimiter.

    Raises:
        InputError: where the file cannot be read or is empty.
    """
    try:
        rows = list(csv.reader(text_of(path).splitlines(), delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"it is not a table ({error})", where=str(path)) from None
    rows = [row[:-1] if row and row[-1].strip() == "" else row for row in rows]
    rows = [row for row in rows if row]
    if not rows:
        raise InputError("the file is empty", where=str(path), mend="Copy it again from its source.")
    return rows


def numbers_of(rows: Sequence[Sequence[str]], path: Path, columns: int, first_line: int = 1) -> Float:
    """Returns (R, columns) the rows as numbers; an incomplete last row is left out.

    Raises:
        InputError: naming the line that is too short or holds something else.
    """
    if len(rows) > 1 and len(rows[-1]) != columns:
        rows = rows[:-1]
    for line, row in enumerate(rows, first_line):
        if len(row) != columns:
            raise InputError(
                f"line {line} has {len(row)} values, expected {columns}",
                where=str(path),
                mend="Remove the line, or copy the file again.",
            )
    try:
        return np.array([[float(cell) if cell.strip() else np.nan for cell in row] for row in rows])
    except ValueError as error:
        raise InputError(f"a cell is not a number ({error})", where=str(path)) from None


def are_numbers(cells: Sequence[str]) -> bool:
    """Returns whether every cell is a number."""
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return False
    return bool(cells)


def first_lines(head: bytes, count: int) -> list[str]:
    """Returns the first whole lines of the beginning of a text file; none where it is no text."""
    try:
        lines = head.decode("utf-8-sig", errors="strict" if len(head) < 4096 else "ignore").splitlines()
    except UnicodeDecodeError:
        return []
    return lines[:count] if b"\0" not in head else []
