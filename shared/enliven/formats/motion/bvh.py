"""Reads Biovision hierarchy files (.bvh) of every order of rotations, unit and rate."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import read_file
from enliven.formats.motion.capture import Capture, composed

_AXES = {"X": 0, "Y": 1, "Z": 2}
"""Column of each rotation or translation axis in a vector."""
_LONGEST_FRAME = 1.0
"""Seconds: a longer time between frames is a damaged header, since no capture is slower than one frame a
second."""
_MOST_DEEP = 256
"""Joints above one another: the deepest known skeletons, with tails and ropes, have some 60."""
_MOST_JOINTS = 4096
"""As many as a pose on the wire has."""
_MOST_PLACES = 1 << 24
"""Frames times joints, 3 GB of turns and places: 93 min of 25 joints at 120 frames a second."""


@dataclass
class _Hierarchy:
    """The joints in the order of the file.

    Attributes:
        channels: of each joint, (kind, axis) with kind "p" (position) or "r" (rotation).
        taken: of each name that was used, the highest number that was put behind it.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, float, float]] = field(default_factory=list)
    channels: list[list[tuple[str, int]]] = field(default_factory=list)
    taken: dict[str, int] = field(default_factory=dict)


class _Lines:
    """The lines of a file with their numbers, blank ones left out."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._lines = [(n, line.split()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._at = 0

    def next(self, expected: str) -> list[str]:
        if self._at == len(self._lines):
            raise InputError(f"the file ends where {expected} should be", where=str(self._path))
        self._at += 1
        return self._lines[self._at - 1][1]

    def more(self) -> bool:
        return self._at < len(self._lines)

    def wrong(self, what: str, mend: str = "") -> InputError:
        number = self._lines[max(self._at - 1, 0)][0] if self._lines else 1
        return InputError(what, where=f"{self._path}, line {number}", mend=mend)

    def numbers(self, words: list[str], count: int, of: str) -> list[float]:
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self.wrong(f"{of} has something that is no number: {' '.join(words)[:60]}") from None
        if len(values) != count:
            raise self.wrong(f"{of} has {len(values)} numbers, expected {count}")
        if not all(math.isfinite(value) for value in values):
            raise self.wrong(f"{of} has a number that is not finite")
        return values


def read_bvh(path: Path | str) -> Capture:
    """Reads a BVH file.

    A file with fewer or more frames than its header states is read as far as it goes, with a note.

    Raises:
        InputError: for a file that cannot be read or is no BVH, with the line that is wrong.
    """
    path = Path(path)
    return parse_bvh(read_file(path).decode("utf-8", "replace"), path)


def parse_bvh(text: str, path: Path = Path("bvh")) -> Capture:
    """Reads the motion in the text of a BVH file; ``path`` is named in errors."""
    lines = _Lines(path, text.removeprefix("\ufeff"))
    if not lines.more() or lines.next("HIERARCHY") != ["HIERARCHY"]:
        raise lines.wrong("the first line is not HIERARCHY", "Is this a BVH file?")
    tree = _read_hierarchy(lines)
    promised, seconds = _read_header(lines)
    rows, notes = _read_rows(lines, tree, promised)
    offsets, rotations = _local(tree, rows)
    positions, world = composed(tuple(tree.parents), offsets, rotations)
    return Capture(tuple(tree.names), tuple(tree.parents), positions, world, seconds, notes)


def _read_hierarchy(lines: _Lines) -> _Hierarchy:
    """Reads everything up to the line MOTION."""
    tree, chain = _Hierarchy(), list[int]()
    while True:
        words = lines.next("MOTION")
        match words:
            case ["MOTION"]:
                break
            case ["ROOT" | "JOINT" | "End", *rest]:
                _begin(lines, tree, chain, words[0], " ".join(rest))
            case ["OFFSET", *numbers] if chain:
                x, y, z = lines.numbers(numbers, 3, "an OFFSET")
                tree.offsets[chain[-1]] = (x, y, z)
            case ["CHANNELS", count, *kinds] if chain:
                tree.channels[chain[-1]] = _channels(lines, count, kinds)
            case ["}"] if chain:
                chain.pop()
            case _:
                raise lines.wrong(f"{' '.join(words)[:60]!r} does not belong here")
    if chain or not tree.names:
        raise lines.wrong("MOTION comes before the hierarchy is complete")
    return tree


def _begin(lines: _Lines, tree: _Hierarchy, chain: list[int], word: str, name: str) -> None:
    """Reads the name of a joint and the brace after it."""
    if (word == "ROOT") != (not chain):
        raise lines.wrong(f"{word} {name} does not belong here")
    parent = chain[-1] if chain else -1
    if word == "End":
        name = f"{tree.names[parent]} end"
    if not name:
        raise lines.wrong(f"{word} has no name")
    if len(chain) >= _MOST_DEEP or len(tree.names) >= _MOST_JOINTS:
        what = f"deeper than {_MOST_DEEP}" if len(chain) >= _MOST_DEEP else f"more than {_MOST_JOINTS}"
        raise lines.wrong(f"there are joints {what}", "No skeleton is like this: export it again.")
    chain.append(len(tree.names))
    tree.names.append(_unused(name, tree.taken))
    tree.parents.append(parent)
    tree.offsets.append((0.0, 0.0, 0.0))
    tree.channels.append([])
    if lines.next("{") != ["{"]:
        raise lines.wrong(f"'{{' is missing after {name}")


def _unused(name: str, taken: dict[str, int]) -> str:
    """Returns the name, or the first numbered one that no joint has yet: a wrist may have two ends."""
    plain, number = name, taken.get(name, 1)
    while name in taken:
        number += 1
        name = f"{plain} {number}"
    taken[plain] = number
    taken.setdefault(name, 1)
    return name


def _channels(lines: _Lines, count: str, kinds: list[str]) -> list[tuple[str, int]]:
    """(kind, axis) of each channel of a joint."""
    known = {
        f"{axis}{kind}".lower(): (kind[0], _AXES[axis]) for axis in _AXES for kind in ("position", "rotation")
    }
    unknown = [kind for kind in kinds if kind.lower() not in known]
    if unknown:
        raise lines.wrong(f"there is no channel {unknown[0]}", "Known: Xposition ... Zrotation.")
    if not _is_count(count) or int(count) != len(kinds):
        raise lines.wrong(f"CHANNELS says {count} and names {len(kinds)}")
    return [known[kind.lower()] for kind in kinds]


def _is_count(word: str) -> bool:
    """Whether a word is a whole number of a sensible length, in plain digits."""
    return word.isascii() and word.isdigit() and len(word) < 10


def _read_header(lines: _Lines) -> tuple[int, float]:
    """Returns the number of frames that the header states, and the seconds between them."""
    words = lines.next("Frames:")
    if words[0] != "Frames:" or len(words) != 2 or not _is_count(words[1]):
        raise lines.wrong("expected 'Frames:' and their number")
    promised = int(words[1])
    words = lines.next("Frame Time:")
    if words[:2] != ["Frame", "Time:"]:
        raise lines.wrong("expected 'Frame Time:' and seconds")
    (seconds,) = lines.numbers(words[2:], 1, "Frame Time")
    if not 0.0 < seconds <= _LONGEST_FRAME:
        raise lines.wrong(f"a frame lasts {seconds} s")
    return promised, seconds


def _read_rows(lines: _Lines, tree: _Hierarchy, promised: int) -> tuple[Float, tuple[str, ...]]:
    """Returns (F, C) the numbers of every frame for every channel, and notes on what was unusual."""
    width = sum(map(len, tree.channels))
    rows: list[list[float]] = []
    while lines.more():
        if (len(rows) + 1) * len(tree.names) > _MOST_PLACES:
            what = f"more than {len(rows)} frames of {len(tree.names)} joints are too many"
            raise lines.wrong(what, "Take it in parts.")
        rows.append(lines.numbers(lines.next("a frame"), width, f"frame {len(rows) + 1}"))
    if not rows:
        raise lines.wrong("there are no frames")
    notes = () if len(rows) == promised else (f"{promised} frames are promised, {len(rows)} are there",)
    return np.array(rows), notes


def _local(tree: _Hierarchy, rows: Float) -> tuple[Float, Float]:
    """(F, N, 3) offsets and (F, N, 3, 3) rotations of every joint in its parent's frame.

    A joint's position channels take the place of its offset.
    """
    frames, count = len(rows), len(tree.names)
    offsets = np.broadcast_to(np.array(tree.offsets), (frames, count, 3)).copy()
    rotations = np.broadcast_to(np.eye(3), (frames, count, 3, 3)).copy()
    column = 0
    for j, channels in enumerate(tree.channels):
        for kind, axis in channels:
            values = rows[:, column]
            column += 1
            if kind == "p":
                offsets[:, j, axis] = values
            else:
                rotations[:, j] = rotations[:, j] @ about(axis, np.radians(values))
    return offsets, rotations


def about(axis: int, angles: Float) -> Float:
    """(F, 3, 3) rotations by (F,) radians about the X (0), Y (1) or Z (2) axis."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    turned = np.zeros((len(angles), 3, 3))
    turned[:, axis, axis] = 1.0
    turned[:, one, one] = turned[:, two, two] = np.cos(angles)
    turned[:, two, one], turned[:, one, two] = np.sin(angles), -np.sin(angles)
    return turned
