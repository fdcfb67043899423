"""Interpolation of poses: linear maps by polar decomposition, positions and joints linearly.

A map M = R S is blended as slerp(R0, R1) lerp(S0, S1) (Shoemake and Duff, "Matrix animation and polar
decomposition", 1992). So a limb that swings between two frames keeps its length.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Pose, Props
from enliven.matching import MatchList, MatchRow
from enliven.person import Body
from enliven.rotation import from_matrix, slerp, to_matrix

_MAX_FLIGHT_M = 0.6
"""Distance in metres between two moments above which an object was moved instantly instead of flying."""


def blend_poses(before: Pose, after: Pose, fraction: float, time_ns: int) -> Pose:
    """Returns the pose at ``fraction`` in [0, 1] from ``before`` to ``after``.

    If the numbers of transforms differ (the character was changed), returns the nearer pose instead of a
    blend.
    """
    if before.linear.shape != after.linear.shape:
        return before if fraction < 0.5 else after
    linear = blend_linear(before.linear.astype(np.float64), after.linear.astype(np.float64), fraction)
    positions = before.positions + (after.positions - before.positions) * np.float32(fraction)
    return Pose(before.character, time_ns, linear.astype(np.float32), np.asarray(positions, np.float32))


def blend_linear(before: Float, after: Float, fraction: float) -> Float:
    """Returns (J, 3, 3) maps blended between two sets of (J, 3, 3).

    Maps without a rotation part are blended linearly.
    """
    straight = before + (after - before) * fraction
    ok = (np.linalg.det(before) > 1e-6) & (np.linalg.det(after) > 1e-6)
    if not ok.any():
        return straight
    first, last = from_matrix(before[ok]), from_matrix(after[ok])
    turn = to_matrix(slerp(first, last, np.full(len(first), fraction)))
    stretch_first = np.swapaxes(to_matrix(first), 1, 2) @ before[ok]
    stretch_last = np.swapaxes(to_matrix(last), 1, 2) @ after[ok]
    straight[ok] = turn @ (stretch_first + (stretch_last - stretch_first) * fraction)
    return straight


def _blend_body(before: Body, after: Body, fraction: float) -> Body:
    """Returns a person between two moments.

    Values that exist at only one moment are taken from the nearer moment.
    """
    nearer = before if fraction < 0.5 else after
    turns, contacts = nearer.orientations, nearer.contacts
    if before.orientations is not None and after.orientations is not None:
        turns = slerp(before.orientations, after.orientations, np.array(fraction))
    if before.contacts is not None and after.contacts is not None:
        contacts = before.contacts + (after.contacts - before.contacts) * fraction
    joints = before.joints + (after.joints - before.joints) * fraction
    confidence = before.confidence + (after.confidence - before.confidence) * fraction
    return Body(before.id, joints, confidence, turns, contacts, nearer.stature)


def blend_bodies(before: tuple[Body, ...], after: tuple[Body, ...], fraction: float) -> tuple[Body, ...]:
    """Returns the bodies between two moments, matched by id.

    A body that exists at only one moment is shown if that is the nearer moment.
    """
    later = {body.id: body for body in after}
    blended = []
    for body in before:
        other = later.pop(body.id, None)
        if other is not None:
            blended.append(_blend_body(body, other, fraction))
        elif fraction < 0.5:
            blended.append(body)
    return tuple(blended) + (tuple(later.values()) if fraction >= 0.5 else ())


def blend_props(before: Props | None, after: Props | None, fraction: float, time_ns: int) -> Props | None:
    """Returns the props between two moments, by id.

    Props that exist at only one moment, or that have jumped, are taken from the nearer moment.

    If one of the moments has no props, returns those of the other.
    """
    if before is None or after is None:
        return before or after
    nearer, other = (before, after) if fraction < 0.5 else (after, before)
    _, mine, theirs = np.intersect1d(nearer.ids, other.ids, return_indices=True)
    step = other.positions[theirs] - nearer.positions[mine]
    flown = np.linalg.norm(step, axis=1) <= _MAX_FLIGHT_M
    mine, theirs, step = mine[flown], theirs[flown], step[flown]
    part = min(fraction, 1.0 - fraction)
    positions, turns = nearer.positions.copy(), nearer.turns.copy()
    positions[mine] += part * step
    turns[mine] = slerp(nearer.turns[mine], other.turns[theirs], np.full(len(mine), part))
    return replace(nearer, time_ns=time_ns, positions=positions, turns=turns)


def blend_boards(
    before: dict[str, MatchList], after: dict[str, MatchList], fraction: float
) -> dict[str, MatchList]:
    """Returns the match lists between two moments: the earlier ones.

    Their lines are interpolated if both moments have them.
    """
    boards = dict(before)
    for name, first in before.items():
        last = after.get(name)
        if last is None or (first.state, len(first.rows)) != (last.state, len(last.rows)):
            continue
        rows = tuple(_blend_row(a, b, fraction) for a, b in zip(first.rows, last.rows, strict=True))
        boards[name] = replace(first, rows=rows)
    return boards


def _blend_row(first: MatchRow, last: MatchRow, fraction: float) -> MatchRow:
    """Returns a match row between two moments; the earlier one if the limbs differ."""
    if [len(line) for line in first.lines] != [len(line) for line in last.lines]:
        return first
    pairs = list(zip(first.lines, last.lines, strict=True))
    if any(np.abs(a - b).max(initial=0.0) > _MAX_FLIGHT_M for a, b in pairs):
        return first
    return replace(first, lines=tuple(a + fraction * (b - a) for a, b in pairs))
