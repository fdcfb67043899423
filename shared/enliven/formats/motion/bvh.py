"""Reads Biovision hierarchy files (.bvh) with any rotation order, unit and frame rate."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Int
from enliven.errors import InputError
from enliven.files import decode_text, open_file, read_file
from enliven.formats.motion.capture import Capture, forward_kinematics
from enliven.meshes import WrongWordError, parse_numbers, split_into_blocks, word_lines, word_starts

_AXES = {"X": 0, "Y": 1, "Z": 2}
"""Column of each rotation or translation axis in a vector."""
_MAX_FRAME_TIME_S = 1.0
"""Maximum plausible frame time, in seconds. A longer time indicates a damaged header, because no capture is
slower than one frame per second."""
_MAX_DEPTH_JOINTS = 256
"""Maximum depth of the hierarchy in joints. The deepest known skeletons, with tails and ropes, have about
60."""
_MAX_JOINTS = 4096
"""Maximum number of joints: the limit of a pose in the network protocol."""
_MAX_JOINT_SAMPLES = 1 << 24
"""Maximum product of frames and joints, for example 93 minutes of 25 joints at 120 frames per second.
Rotations and positions of this size need 3 GB."""
_MAX_HEAD_BYTES = 1 << 24
"""Maximum size of a hierarchy in bytes. 4096 joints, nested 256 deep and indented by tabs, take 8 MB."""
_BLANK_PATTERN = r"(?:\s|(?:#|//)[^\n]*)*"
_WORD_PATTERN = re.compile(_BLANK_PATTERN + r"([{}:]|(?:[^\s{}:]|:(?=[^\s:]))+)")
"""Pattern of a word, including the blanks and comments before it. A colon inside a word is part of a name
such as "mixamorig:Hips"."""
_NAME_PATTERN = re.compile(r"(?:(?!\s(?:#|//))[^\n{}])*")
_COMMENT_PATTERN = re.compile(r"(?:#|//)[^\n]*")
_KEYWORDS = {
    "ROOT",
    "JOINT",
    "END",
    "ENDSITE",
    "END_SITE",
    "OFFSET",
    "CHANNELS",
    "MOTION",
    "HIERARCHY",
    "{",
    "}",
}


@dataclass
class _Hierarchy:
    """The joints of the file, in its order.

    Attributes:
        channels: for each joint, a pair (kind, axis) per channel. The kind is "p" (position) or "r"
            (rotation).
        taken: for each used name, the highest number that was appended to it.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, float, float]] = field(default_factory=list)
    channels: list[list[tuple[str, int]]] = field(default_factory=list)
    taken: dict[str, int] = field(default_factory=dict)


class _Words:
    """A tokenizer that finds each word of a file's text on request.

    Braces and colons are separate words. Comments ("# ..." or "// ...") are skipped.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._text = path, text
        self._at, self._counted, self._line = 0, 0, 1

    def peek(self) -> str:
        """Returns the next word without advancing, or an empty string at the end."""
        match = _WORD_PATTERN.match(self._text, self._at)
        return match[1] if match else ""

    def next(self, expected: str) -> str:
        """Returns the next word and advances. At the end of the file, raises InputError with the description
        ``expected``."""
        match = _WORD_PATTERN.match(self._text, self._at)
        if match is None:
            raise InputError(f"the file ends where {expected} should be", where=str(self._path))
        self._at = match.end()
        return match[1]

    def rest_of_name(self) -> str:
        """Returns the words up to a brace or the end of the line."""
        match = _NAME_PATTERN.match(self._text, self._at)
        self._at = match.end() if match else self._at
        return " ".join(match[0].split()) if match else ""

    def read_until_keyword(self) -> list[str]:
        """Returns the words up to the next keyword or brace."""
        words = list[str]()
        while (word := self.peek()) and word.upper() not in _KEYWORDS:
            words.append(self.next(""))
        return words

    def read_remaining_text(self) -> tuple[int, str]:
        """Returns the number of the line after the last word, and the text after that word."""
        return self.line, self._text[self._at :]

    @property
    def line(self) -> int:
        """The line of the last word."""
        self._line += self._text.count("\n", self._counted, self._at)
        self._counted = self._at
        return self._line

    def create_error(self, what: str, remedy: str = "", line: int | None = None) -> InputError:
        location = f"{self._path}, line {self.line if line is None else line}"
        return InputError(what, where=location, remedy=remedy)

    def parse_numbers(self, words: list[str], count: int, of: str, line: int) -> list[float]:
        try:
            values = [float(word) for word in words]
        except ValueError:
            problem = f"{of} has a word that is not a number: {' '.join(words)[:60]}"
            raise self.create_error(problem, line=line) from None
        if len(values) != count:
            raise self.create_error(f"{of} has {len(values)} numbers, expected {count}", line=line)
        if not all(math.isfinite(value) for value in values):
            raise self.create_error(f"{of} has a number that is not finite", line=line)
        return values


def read_bvh(path: Path | str) -> Capture:
    """Reads a BVH file. The result is in the unit and axes of the file.

    Keywords may be in any case, and lines may be wrapped between words. If the file has fewer or more frames
    than its header states, all existing frames are read, and a note is added.

    Raises:
        InputError: if the file cannot be read or is not a BVH file. The message names the wrong line.
    """
    path = Path(path)
    with open_file(path) as file:
        head = file.read(_MAX_HEAD_BYTES)
    if len(head) == _MAX_HEAD_BYTES and "MOTION" not in decode_text(head).upper():
        # If the hierarchy fills the whole read limit, it must contain a wrong line. Parse only this part,
        # which is enough to find and report the line.
        words = _Words(path, decode_text(head))
        _begin_file(words)
        _read_hierarchy(words)
    return parse_bvh(decode_text(read_file(path)), path)


def parse_bvh(text: str, path: Path = Path("bvh")) -> Capture:
    """Parses the text of a BVH file. ``path`` is used in error messages."""
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    words = _Words(path, text)
    _begin_file(words)
    tree = _read_hierarchy(words)
    promised, seconds = _read_header(words)
    rows, notes = _read_rows(words, tree, promised)
    offsets, rotations = _local_motion(tree, rows)
    positions, world = forward_kinematics(tuple(tree.parents), offsets, rotations)
    return Capture(tuple(tree.names), tuple(tree.parents), positions, world, seconds, notes)


def _begin_file(words: _Words) -> None:
    if words.peek().upper() != "HIERARCHY":
        raise words.create_error("the first line is not HIERARCHY", "Check that the file is a BVH file.")
    words.next("HIERARCHY")


def _read_hierarchy(words: _Words) -> _Hierarchy:
    """Reads the hierarchy, up to the word MOTION."""
    tree, chain = _Hierarchy(), list[int]()
    while True:
        word = words.next("MOTION")
        line = words.line
        match word.upper():
            case "MOTION":
                break
            case "ROOT" | "JOINT" | "END" | "ENDSITE" | "END_SITE" as kind:
                _begin_joint(words, tree, chain, "End" if kind.startswith("END") else kind, line)
            case "OFFSET" if chain:
                x, y, z = words.parse_numbers(words.read_until_keyword(), 3, "an OFFSET", line)
                tree.offsets[chain[-1]] = (x, y, z)
            case "CHANNELS" if chain:
                tree.channels[chain[-1]] = _joint_channels(words, words.read_until_keyword(), line)
            case "}" if chain:
                chain.pop()
            case _:
                raise words.create_error(f"the word {word[:60]!r} is not allowed here")
    if chain or not tree.names:
        raise words.create_error("MOTION comes before the hierarchy is complete")
    return tree


def _begin_joint(words: _Words, tree: _Hierarchy, chain: list[int], kind: str, line: int) -> None:
    """Reads the name of a joint and the brace after it."""
    name = words.rest_of_name()
    if (kind == "ROOT") != (not chain):
        raise words.create_error(f"{kind} {name} is not allowed here", line=line)
    parent = chain[-1] if chain else -1
    if kind == "End":
        name = f"{tree.names[parent]} end"
    if not name and words.peek() not in ("", "{"):
        name = words.next("a name")
    if not name:
        raise words.create_error(f"{kind} has no name", line=line)
    if len(chain) >= _MAX_DEPTH_JOINTS or len(tree.names) >= _MAX_JOINTS:
        excess = (
            f"is deeper than {_MAX_DEPTH_JOINTS}"
            if len(chain) >= _MAX_DEPTH_JOINTS
            else f"has more than {_MAX_JOINTS}"
        )
        problem = f"the hierarchy {excess} joints"
        raise words.create_error(problem, "Check the skeleton, and export the file again.", line)
    chain.append(len(tree.names))
    tree.names.append(_find_unused_name(name, tree.taken))
    tree.parents.append(parent)
    tree.offsets.append((0.0, 0.0, 0.0))
    tree.channels.append([])
    if words.next("{") != "{":
        raise words.create_error(f"'{{' is missing after {name}")


def _find_unused_name(name: str, taken: dict[str, int]) -> str:
    """Returns a name that no other joint has: the given name, or the name with the first free number. Names
    may repeat, for example if a wrist has two ends.
    """
    base_name, number = name, taken.get(name, 1)
    while name in taken:
        number += 1
        name = f"{base_name} {number}"
    taken[base_name] = number
    taken.setdefault(name, 1)
    return name


def _joint_channels(words: _Words, given: list[str], line: int) -> list[tuple[str, int]]:
    """Parses the channels of a joint from their count and names. Returns (kind, axis) of each."""
    channel_kinds = {
        f"{axis}{kind}".lower(): (kind[0], _AXES[axis]) for axis in _AXES for kind in ("position", "rotation")
    }
    count, kinds = (given[0], given[1:]) if given else ("nothing", [])
    unknown = [kind for kind in kinds if kind.lower() not in channel_kinds]
    if unknown:
        raise words.create_error(
            f"the channel {unknown[0]} does not exist",
            "Known channels: Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation.",
            line,
        )
    if not _is_count(count) or int(count) != len(kinds):
        raise words.create_error(f"CHANNELS states {count[:20]} channels but names {len(kinds)}", line=line)
    return [channel_kinds[kind.lower()] for kind in kinds]


def _is_count(word: str) -> bool:
    """Returns True if a word is a whole number of at most nine plain digits."""
    return word.isascii() and word.isdigit() and len(word) < 10


def _read_header(words: _Words) -> tuple[int, float]:
    """Reads the number of frames, and the seconds between them, from the header."""
    count = _after_label(words, "frames", "'Frames:' and the number of frames")
    if not _is_count(count):
        raise words.create_error("expected 'Frames:' and the number of frames")
    time = _after_label(words, "frametime", "'Frame Time:' and a time in seconds")
    (seconds,) = words.parse_numbers([time], 1, "Frame Time", words.line)
    if not 0.0 < seconds <= _MAX_FRAME_TIME_S:
        raise words.create_error(
            f"the frame time is {seconds} s, but must be above 0 and at most {_MAX_FRAME_TIME_S:g} s"
        )
    return int(count), seconds


def _after_label(words: _Words, label: str, expected: str) -> str:
    """Reads a label such as "Frame Time:", with any blanks and any case, and returns the word after it."""
    label_read, value = "", ""
    while len(label_read) < len(label) and not value:
        word, _, value = words.next(expected).partition(":")
        label_read += word.lower()
    if label_read != label:
        raise words.create_error(f"expected {expected}")
    if words.peek() == ":":
        words.next(expected)
    return value or words.next(expected)


def _read_rows(words: _Words, tree: _Hierarchy, promised: int) -> tuple[Float, tuple[str, ...]]:
    """Reads the frames. Returns the value (F, C) of each channel in each frame, and notes about unusual
    content.

    A frame may extend over several lines, and a line may contain several frames.
    """
    width, joints = sum(map(len, tree.channels)), len(tree.names)
    first_line, text = words.read_remaining_text()
    max_frames = _MAX_JOINT_SAMPLES // joints
    body = _COMMENT_PATTERN.sub("", text).encode()
    value_blocks, counts, lines = list[Float](), list[Int](), list[Int]()
    total = 0
    for offset, block in split_into_blocks(body):
        lines_before = first_line + body.count(b"\n", 0, offset)
        try:
            numbers = parse_numbers(block)
        except WrongWordError as error:
            frame = total // max(width, 1) + 1
            problem = f"near frame {frame}, a word is not a number: {error.what}"
            raise words.create_error(problem, line=lines_before + error.line) from None
        line_numbers = word_lines(block, word_starts(block))
        if not np.isfinite(numbers).all():
            line = lines_before + int(line_numbers[np.argmin(np.isfinite(numbers))])
            raise words.create_error("a frame has a number that is not finite", line=line)
        row_lines, row_counts = np.unique(line_numbers, return_counts=True)
        value_blocks.append(numbers)
        lines.append(row_lines + lines_before)
        counts.append(row_counts)
        total += len(numbers)
        if total > max_frames * width:
            problem = f"the motion has more than {max_frames} frames, the maximum for {joints} joints"
            raise words.create_error(problem, "Split the motion into several files.", line=lines_before)
    if total == 0 or width == 0:
        raise words.create_error("the file has no frames" if width else "no joint has a channel")
    _check_rows(words, np.concatenate(counts), np.concatenate(lines), width, promised)
    frames = total // width
    notes = () if frames == promised else (f"the header states {promised} frames, but the file has {frames}",)
    return np.concatenate(value_blocks).reshape(frames, width), notes


def _check_rows(words: _Words, counts: Int, lines: Int, width: int, promised: int) -> None:
    """Raises InputError if a frame has a wrong number of values. A frame that extends over several lines must
    begin at the start of a line.

    Args:
        counts: (L,) number of values in each non-empty line.
        lines: (L,) line numbers of these lines.
    """
    total = int(counts.sum())
    if (counts == width).all() or total == promised * width:
        return
    starts = np.cumsum(counts) - counts
    if total % width == 0 and np.isin(np.arange(0, total, width), starts).all():
        return
    row = int(np.argmax(counts != width))
    problem = f"frame {row + 1} has {counts[row]} numbers, expected {width}"
    raise words.create_error(problem, line=int(lines[row]))


def _local_motion(tree: _Hierarchy, rows: Float) -> tuple[Float, Float]:
    """Converts channel values to offsets (F, N, 3) and rotations (F, N, 3, 3) of each joint in its parent's
    frame.

    If a joint has position channels, they replace its offset.
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
                rotations[:, j] = rotations[:, j] @ axis_rotations(axis, np.radians(values))
    return offsets, rotations


def axis_rotations(axis: int, angles: Float) -> Float:
    """Returns the rotations (F, 3, 3) by ``angles`` (F,), radians, about the X (0), Y (1) or Z (2) axis."""
    second_axis, third_axis = (axis + 1) % 3, (axis + 2) % 3
    turned = np.zeros((len(angles), 3, 3))
    turned[:, axis, axis] = 1.0
    turned[:, second_axis, second_axis] = turned[:, third_axis, third_axis] = np.cos(angles)
    turned[:, third_axis, second_axis], turned[:, second_axis, third_axis] = np.sin(angles), -np.sin(angles)
    return turned
