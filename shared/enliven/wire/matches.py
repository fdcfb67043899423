"""Converts between lists of pose matches and network messages."""

from __future__ import annotations

import itertools

import numpy as np

from enliven.arrays import Float
from enliven.matching.match_list import MatchList, MatchRow
from enliven.wire.convert import JOINT_STEP
from enliven.wire.streams import MatchesMessage, PackedMatch

_MAX_ROWS = 16
"""Maximum number of matches in a message. It is the limit of the field, and more than a screen shows."""
_MAX_JOINTS = 1024
"""Maximum number of joints of a match in a message, so that the message stays below its topic's limit."""


def board_to_message(board: MatchList) -> MatchesMessage:
    """Returns the message of a match list. It contains at most sixteen matches, and positions are rounded to
    a quarter of a millimetre."""
    rows = board.rows[:_MAX_ROWS]
    shown_index = board.shown if board.shown < len(rows) else -1
    return MatchesMessage(
        board.character,
        board.state,
        board.body,
        board.time_ns,
        shown_index,
        [_pack_match(row) for row in rows],
        board.total,
        float(np.clip(board.held, 0.0, 1.0)),
    )


def message_to_board(message: MatchesMessage) -> MatchList:
    """Decodes the match list of a message."""
    return MatchList(
        message.character,
        message.state,
        message.body,
        message.time_ns,
        message.shown,
        tuple(_unpack_match(match) for match in message.matches),
        message.total,
        message.held,
    )


def _pack_match(row: MatchRow) -> PackedMatch:
    room, lines = _MAX_JOINTS, list[Float]()
    for line in row.lines[:64]:
        lines.append(line[: min(room, 255)])
        room -= len(lines[-1])
    points = np.concatenate([np.zeros((0, 3)), *lines])
    steps = np.clip(np.rint(np.nan_to_num(points) / JOINT_STEP), -32768, 32767).astype("<i2")
    sizes = bytes(len(line) for line in lines)
    limbs = bytes(limb % 256 for limb in row.limbs[: len(sizes)])
    limb_bytes = limbs if len(limbs) == len(sizes) else b""
    return PackedMatch(
        row.name[:64] or "?", row.place, row.score, sizes, steps.tobytes(), limb_bytes, row.body
    )


def _unpack_match(match: PackedMatch) -> MatchRow:
    points = np.frombuffer(match.points, "<i2").reshape(-1, 3) * JOINT_STEP
    ends = np.cumsum([0, *match.sizes])
    lines = tuple(points[a:b] for a, b in itertools.pairwise(ends))
    return MatchRow(match.name, match.place, match.score, lines, tuple(match.limbs), match.body)
