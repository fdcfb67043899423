"""The matched bones drawn on the model: a tube along each chain of bones, with one colour per limb."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32
from enliven.matching.body_limbs import joints_of_limb
from enliven.matching.match_list import MatchList, MatchRow
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.theme import LIMB_COLOURS

Tint = tuple[float, float, float]
"""Red, green and blue, sRGB in [0, 1]."""
_TUBE_RADIUS = 0.012
"""Tube radius as a fraction of the longest chain. It is halved once the chain is driven."""
_VISIBLE_DEPTH = 0.3
"""Depth below the surface up to which a tube is visible, as a fraction of the longest chain. It includes the
bone of a thick limb.
"""


def make_match_rows(boards: dict[str, MatchList]) -> tuple[Float32, float]:
    """Returns (N, 12) rows for ``Tubes``, and the depth in metres below a surface up to which they are
    visible.
    """
    rows, deepest = [np.zeros((0, 12), np.float32)], 0.0
    for board in boards.values():
        for row in find_highlighted_rows(board):
            lengths = [float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in row.lines]
            fraction = 0.5 if board.state == "playing" else 1.0
            radius = fraction * _TUBE_RADIUS * max(lengths, default=0.0)
            deepest = max(deepest, fraction * _VISIBLE_DEPTH * max(lengths, default=0.0))
            for line, tint in zip(row.lines, find_tints(row), strict=True):
                rows += _make_tubes(line, radius, np.power(tint, 2.2, dtype=np.float32))
    return np.concatenate(rows), deepest


def find_highlighted_rows(board: MatchList) -> tuple[MatchRow, ...]:
    """Returns the match that drives the character, or the highlighted candidate, as a tuple. It is empty if
    there is neither.
    """
    if board.state == "off" or board.shown < 0:
        return ()
    return board.rows if board.state == "playing" else board.rows[board.shown : board.shown + 1]


def find_tints(row: MatchRow) -> tuple[Tint, ...]:
    """Returns the colour of each line of a match: the colour of the performer's limb, or a colour by index if
    the limb is unknown.
    """
    limbs = row.limbs if len(row.limbs) == len(row.lines) else range(len(row.lines))
    tints = [(red, green, blue) for red, green, blue in LIMB_COLOURS]
    return tuple(tints[limb % len(tints)] for limb in limbs)


def find_limb_tints(boards: dict[str, MatchList]) -> dict[int, dict[int, Tint]]:
    """Returns the colours of bones as shown on the model, by performer id and by the bone's outer joint."""
    tints: dict[int, dict[int, Tint]] = {}
    for row in (row for board in boards.values() for row in find_highlighted_rows(board)):
        if len(row.limbs) != len(row.lines):
            continue
        for limb, line, tint in zip(row.limbs, row.lines, find_tints(row), strict=True):
            if len(line):  # A limb that drives nothing has an empty line.
                tints.setdefault(row.body, {}).update(dict.fromkeys(joints_of_limb(limb), tint))
    return tints


def _make_tubes(line: Float, radius: float, tint: Float32) -> list[Float32]:
    """Returns one tube per bone and one ball per joint."""
    if len(line) < 2:
        return []
    radii, tints = np.full(len(line), radius), np.tile(tint, (len(line), 1))
    return [
        make_tube_rows(line[:-1], line[1:], radii[1:], tints[1:]),
        make_tube_rows(line, line, 1.7 * radii, tints),
    ]
