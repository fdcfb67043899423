"""Interpolation of poses. Linear maps are interpolated by polar decomposition, positions and joints linearly.

A map M = R S is blended as slerp(R0, R1) lerp(S0, S1) (Shoemake and Duff, "Matrix animation and polar
decomposition", 1992). So a limb that swings between two frames keeps its length.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Pose, Props
from enliven.matching.match_list import MatchList, MatchRow
from enliven.person import Body
from enliven.rotation import from_matrix, slerp, to_matrix

_MAX_FLIGHT_M = 0.6
"""An object that moves farther than this in metres between two moments was repositioned, so its motion is not
interpolated.
"""


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
    """Returns (J, 3, 3) linear maps interpolated between two sets of (J, 3, 3) maps.

    Maps without a rotation part are blended linearly.
    """
    straight = before + (after - before) * fraction
    ok = (np.linalg.det(before) > 1e-6) & (np.linalg.det(after) > 1e-6)
    if not ok.any():
        return straight
    first, last = from_matrix(before[ok]), from_matrix(after[ok])
    rotation = to_matrix(slerp(first, last, np.full(len(first), fraction)))
    stretch_first = np.swapaxes(to_matrix(first), 1, 2) @ before[ok]
    stretch_last = np.swapaxes(to_matrix(last), 1, 2) @ after[ok]
    straight[ok] = rotation @ (stretch_first + (stretch_last - stretch_first) * fraction)
    return straight


def _blend_body(before: Body, after: Body, fraction: float) -> Body:
    """Returns a person between two moments.

    Values that exist at only one moment are taken from the nearer moment.
    """
    nearer = before if fraction < 0.5 else after
    orientations, contacts = nearer.orientations, nearer.contacts
    if before.orientations is not None and after.orientations is not None:
        orientations = slerp(before.orientations, after.orientations, np.array(fraction))
    if before.contacts is not None and after.contacts is not None:
        contacts = before.contacts + (after.contacts - before.contacts) * fraction
    joints = before.joints + (after.joints - before.joints) * fraction
    confidence = before.confidence + (after.confidence - before.confidence) * fraction
    return Body(before.id, joints, confidence, orientations, contacts, nearer.stature)


def blend_bodies(before: tuple[Body, ...], after: tuple[Body, ...], fraction: float) -> tuple[Body, ...]:
    """Returns the bodies between two moments, matched by id.

    A body that exists at only one moment is shown if that is the nearer moment.
    """
    bodies_after = {body.id: body for body in after}
    blended_bodies = []
    for body in before:
        body_after = bodies_after.pop(body.id, None)
        if body_after is not None:
            blended_bodies.append(_blend_body(body, body_after, fraction))
        elif fraction < 0.5:
            blended_bodies.append(body)
    return tuple(blended_bodies) + (tuple(bodies_after.values()) if fraction >= 0.5 else ())


def blend_props(before: Props | None, after: Props | None, fraction: float, time_ns: int) -> Props | None:
    """Returns the props between two moments, by id.

    Props that exist at only one moment, or that have jumped, are taken from the nearer moment.

    If one of the moments has no props, returns the other moment's props.
    """
    if before is None or after is None:
        return before or after
    nearer, farther = (before, after) if fraction < 0.5 else (after, before)
    _, nearer_indices, farther_indices = np.intersect1d(nearer.ids, farther.ids, return_indices=True)
    step = farther.positions[farther_indices] - nearer.positions[nearer_indices]
    flown = np.linalg.norm(step, axis=1) <= _MAX_FLIGHT_M
    nearer_indices, farther_indices, step = nearer_indices[flown], farther_indices[flown], step[flown]
    part = min(fraction, 1.0 - fraction)
    positions, rotations = nearer.positions.copy(), nearer.turns.copy()
    positions[nearer_indices] += part * step
    rotations[nearer_indices] = slerp(
        nearer.turns[nearer_indices], farther.turns[farther_indices], np.full(len(nearer_indices), part)
    )
    return replace(nearer, time_ns=time_ns, positions=positions, turns=rotations)


def blend_boards(
    before: dict[str, MatchList], after: dict[str, MatchList], fraction: float
) -> dict[str, MatchList]:
    """Returns the match lists between two moments: the lists of the earlier moment.

    Their lines are interpolated if both moments contain them.
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
    """Returns a match between two moments, or the earlier one if the limbs differ."""
    if [len(line) for line in first.lines] != [len(line) for line in last.lines]:
        return first
    pairs = list(zip(first.lines, last.lines, strict=True))
    if any(np.abs(a - b).max(initial=0.0) > _MAX_FLIGHT_M for a, b in pairs):
        return first
    return replace(first, lines=tuple(a + fraction * (b - a) for a, b in pairs))
