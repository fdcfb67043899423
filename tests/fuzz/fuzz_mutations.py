"""Mutations of bytes and of trees that imitate damaged and malicious files."""

from __future__ import annotations

import copy
import re
import struct
from random import Random
from typing import Any

EXTREMES = [
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    2**63 - 1,
    2**64 - 1,
]
WORDS = [
    b"-1",
    b"0",
    b"1",
    b"4294967295",
    b"999999999999999999999",
    b"1e308",
    b"-1e-308",
    b"nan",
    b"inf",
    b"",
]
LEAVES: list[Any] = [
    None, True, False, 0, 1, -1, 3, 255, 65536, 2**31, 2**32, 2**53, -(2**63), 1e-308, 1e308, 0.5, "", "x",
    "../../../etc/passwd", "\0", "a" * 300, [], {}, [0], [[]], {"a": 1},
]  # fmt: skip
MOST_BYTES = 1 << 17
"""Maximum size of a mutated file, bytes. Longer files take longer without finding more."""
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def mutated(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns the bytes with one to four mutations. ``other`` is the source of spliced parts."""
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        changed = dice.choice(_BYTES)(data, other, dice)
        data = changed if len(changed) <= MOST_BYTES else data
    return data


def mutated_tree(tree: Any, dice: Random) -> Any:
    """Changes a tree of dicts, lists and leaves in one to three random positions, and returns it."""
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        tree = _changed(tree, dice)
    return tree


def _flip(data: bytes, other: bytes, dice: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 8))):
        if changed:
            changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
    return bytes(changed)


def _cut(data: bytes, other: bytes, dice: Random) -> bytes:
    return data[: dice.randrange(len(data) + 1)]


def _removed(data: bytes, other: bytes, dice: Random) -> bytes:
    a = dice.randrange(len(data) + 1)
    return data[:a] + data[a + dice.choice((1, 2, 4, 8, 64)) :]


def _doubled(data: bytes, other: bytes, dice: Random) -> bytes:
    a, size = dice.randrange(len(data) + 1), dice.choice((1, 4, 16, 256))
    return data[:a] + data[a : a + size] * dice.choice((2, 2, 50)) + data[a + size :]


def _spliced(data: bytes, other: bytes, dice: Random) -> bytes:
    return data[: dice.randrange(len(data) + 1)] + other[dice.randrange(len(other) + 1) :]


def _patched(data: bytes, other: bytes, dice: Random) -> bytes:
    a, b = dice.randrange(len(data) + 1), dice.randrange(len(other) + 1)
    piece = other[b : b + dice.choice((1, 4, 16, 64))]
    return data[:a] + piece + data[a + len(piece) :]


def _extreme(data: bytes, other: bytes, dice: Random) -> bytes:
    size = dice.choice((1, 2, 4, 4, 8))
    number = dice.choice(EXTREMES) % (1 << 8 * size)
    a = dice.randrange(len(data) + 1)
    return data[:a] + number.to_bytes(size, dice.choice(("little", "big"))) + data[a + size :]


def _float(data: bytes, other: bytes, dice: Random) -> bytes:
    kind = dice.choice(("<f", "<d"))
    value = struct.pack(kind, dice.choice((0.0, -1.0, float("nan"), float("inf"), 3e38, 1e-38)))
    a = dice.randrange(len(data) + 1)
    return data[:a] + value + data[a + len(value) :]


def _word(data: bytes, other: bytes, dice: Random) -> bytes:
    """Replaces a number in a text by another."""
    matches = list(_NUMBER.finditer(data))
    if not matches:
        return _extreme(data, other, dice)
    at = dice.choice(matches)
    return data[: at.start()] + dice.choice(WORDS) + data[at.end() :]


def _lines(data: bytes, other: bytes, dice: Random) -> bytes:
    """Swaps two lines of a text, or repeats one many times."""
    lines = data.split(b"\n")
    a, b = dice.randrange(len(lines)), dice.randrange(len(lines))
    if dice.random() < 0.5:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a:a] = [lines[b]] * dice.choice((1, 3, 300))
    return b"\n".join(lines)


_OFTEN = (_flip, _extreme, _word)
_BYTES = (*_OFTEN, *_OFTEN, _cut, _removed, _doubled, _spliced, _patched, _float, _lines)


def _changed(tree: Any, dice: Random) -> Any:
    """Makes one change at a random position."""
    places = list(_places(tree))
    if not places:
        return copy.deepcopy(dice.choice(LEAVES))
    holder, key = dice.choice(places)
    how = dice.randrange(6)
    if how == 0:
        del holder[key]
    elif how == 1:
        inner = dice.choice(places)
        holder[key] = copy.deepcopy(inner[0][inner[1]])
    elif how == 2 and isinstance(holder, list):
        holder[key:key] = [copy.deepcopy(holder[key])] * dice.choice((1, 2, 40))
    elif how == 3 and isinstance(holder[key], int | float):
        value = float(holder[key])
        holder[key] = dice.choice((value + 1, value - 1, -value, value * 1e6, int(value) + 1, int(value) - 1))
    elif how == 4:
        deep: Any = 0
        for _ in range(dice.choice((2, 20, 60))):
            deep = [deep] if dice.random() < 0.5 else {"a": deep}
        holder[key] = deep
    else:
        holder[key] = copy.deepcopy(dice.choice(LEAVES))
    return tree


def _places(tree: Any) -> Any:
    """Returns (holder, key) of every element of a tree."""
    waiting = [tree]
    while waiting:
        at = waiting.pop()
        if isinstance(at, dict | list):
            for key in at if isinstance(at, dict) else range(len(at)):
                yield at, key
                waiting.append(at[key])
