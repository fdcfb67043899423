"""Finds words and numbers in large text files by vectorized NumPy operations."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Int

BLOCK_BYTES = 1 << 20
"""Size of the block of text that is searched at a time, in bytes. The masks of a block take about ten times
as much memory."""
_MAX_SHOWN_BYTES = 40
"""Maximum number of bytes of an invalid word that an error message shows."""
_COMMENT = re.compile(rb"#[^\n]*")


class DamagedMeshError(ValueError):
    """An error in a mesh file. Its message is written for the user."""


class WrongWordError(DamagedMeshError):
    """An error about an invalid word in a text.

    Attributes:
        line: line number of the word in the text, from 0.
        what: description of the error.
    """

    def __init__(self, line: int, what: str) -> None:
        super().__init__(f"line {line + 1}: {what}")
        self.line, self.what = line, what


def split_into_blocks(text: bytes, end: bytes = b"\n") -> Iterator[tuple[int, bytes]]:
    """Splits a text into blocks of about :data:`BLOCK_BYTES`, and yields (offset, block). Each block except
    the last ends after the delimiter ``end``.
    """
    offset = 0
    while offset < len(text):
        cut = (
            len(text) if offset + BLOCK_BYTES >= len(text) else text.rfind(end, offset, offset + BLOCK_BYTES)
        )
        if cut < offset:
            cut = text.find(end, offset)
        block_end = len(text) if cut < 0 or cut == len(text) else cut + len(end)
        yield offset, text[offset:block_end]
        offset = block_end


def remove_comments(text: bytes) -> bytes:
    """Returns the text without comments. A comment begins at "#" and extends to the end of the line."""
    return _COMMENT.sub(b"", text) if b"#" in text else text


def word_starts(text: bytes) -> Int:
    """Returns the offset (W,) of each word of a text."""
    is_space = np.frombuffer(text, np.uint8) <= ord(" ")
    is_start = ~is_space
    is_start[1:] &= is_space[:-1]
    return np.flatnonzero(is_start)


def word_lines(text: bytes, offsets: Int) -> Int:
    """Returns the line number (W,), counted from 0, of each byte offset (W,) in the text."""
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))
    return np.searchsorted(ends, offsets)


def parse_numbers(text: bytes, dtype: Any = np.float64) -> AnyArray:
    """Parses the numbers of a text, separated by white space. Returns (N,) numbers.

    Args:
        dtype: float64 or int64.

    Raises:
        WrongWordError: if a word is not a number of this type.
    """
    with warnings.catch_warnings():
        # If a word is not a number, some versions of NumPy stop parsing with a warning, and others raise an
        # error.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype, sep=" ") if text.strip() else np.empty(0, dtype)
        except (DeprecationWarning, ValueError):
            pass
        warnings.simplefilter("ignore", DeprecationWarning)
        word_start = _find_first_non_number(text, dtype)
    word = text[word_start : word_start + _MAX_SHOWN_BYTES].split(None, 1)[0].decode("utf-8", "replace")
    kind = "whole number" if np.dtype(dtype).kind == "i" else "number"
    raise WrongWordError(text.count(b"\n", 0, word_start), f"{word!r} is not a {kind}")


def _find_first_non_number(text: bytes, dtype: Any) -> int:
    """Returns the offset of the first word that is not a number, by bisection."""
    starts = word_starts(text)
    low, high = 0, len(starts)
    while high - low > 1:
        middle = (low + high) // 2
        part = text[starts[low] : starts[middle]]
        try:
            is_right = len(np.fromstring(part, dtype, sep=" ")) == middle - low
        except ValueError:
            is_right = False
        low, high = (middle, high) if is_right else (low, middle)
    return int(starts[low])
