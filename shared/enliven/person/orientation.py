"""Reads turns of the head and twists of the forearms from the orientations of a body.

The frames are those of ``Body``: all are the identity for a person who stands upright facing +Z with hanging
arms, so a rotation relative to the parent bone is the rotation of the joint between them.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.person.body import Body
from enliven.person.joints import MIRROR, PARENTS, Joint
from enliven.rotation import conjugate, multiply

_MIRROR = np.array(MIRROR)
_PARENTS = np.array([max(p, 0) for p in PARENTS])

_UP = np.array([0.0, 1.0, 0.0])
_HALF_TURN = np.array([0.0, 1.0, 0.0, 0.0])
"""(4,) about x."""


def local(orientations: AnyArray) -> Float:
    """Returns (20, 4) parent_from_bone of (20, 4) world_from_bone; the root's stays world_from_bone."""
    turns = multiply(conjugate(orientations[_PARENTS]), orientations)
    turns[0] = orientations[0]
    return turns


def twist(turn: AnyArray, axis: AnyArray) -> Float:
    """(...) radians in [-pi, pi] that the rotations (..., 4) turn about the unit ``axis`` (3,) itself.

    It is the angle of the rotation about the axis that is nearest to each rotation; 0 where every one is as
    near (a half turn about a line at right angles to the axis).
    """
    turn = np.asarray(turn, np.float64)
    along = turn[..., 1:] @ np.asarray(axis, np.float64)
    angle = 2 * np.arctan2(along, turn[..., 0])
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def head_turn(body: Body) -> float | None:
    """Radians that the head is turned to its left, relative to the shoulders; None without orientations."""
    if body.orientations is None:
        return None
    chest, head = body.orientations[Joint.SHOULDER_CENTER], body.orientations[Joint.HEAD]
    return float(twist(multiply(conjugate(chest), head), _UP))


def forearm_twist(body: Body, side: str) -> float | None:
    """Radians that the hand is turned relative to the upper arm; positive turns a hanging thumb to the body's
    left; None without orientations.

    Args:
        side: "left" or "right".
    """
    if body.orientations is None:
        return None
    elbow, hand = (Joint[f"{name}_{side.upper()}"] for name in ("ELBOW", "HAND"))
    turn = multiply(conjugate(body.orientations[elbow]), body.orientations[hand])
    return float(twist(turn, _UP))


def mirrored(body: Body, point: AnyArray, normal: AnyArray) -> Body:
    """Returns the body reflected in a plane, left and right exchanged; twice is the body itself.

    A frame's front and length are reflected; its left hand becomes a right one, so the third axis is turned
    back: a rotation stays a rotation.

    Args:
        point: (3,) any point of the mirror, metres, world frame.
        normal: (3,) unit normal of the mirror.
    """
    normal = np.asarray(normal, np.float64)
    behind = (body.joints - np.asarray(point, np.float64)) @ normal
    joints = (body.joints - 2.0 * behind[:, None] * normal)[_MIRROR]
    orientations = None
    if body.orientations is not None:
        # A reflection is minus a half turn, whose quaternion is (0, axis): M R D = turn(n, pi) R turn(x, pi).
        half = np.concatenate([[0.0], normal])
        orientations = multiply(multiply(half, body.orientations), _HALF_TURN)[_MIRROR]
    contacts = None if body.contacts is None else body.contacts[::-1].copy()
    return Body(body.id, joints, body.confidence[_MIRROR], orientations, contacts, body.stature)
