"""Finds the roles of a motion capture's joints (such as the left elbow) by their names and their positions in
the joint tree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.formats.motion.capture import Capture

_ELBOWS = ("forearm", "lowerarm", "elbow")
_KNEES = ("knee", "lowerleg", "shin", "calf", "leg")
_WRISTS = ("hand", "wrist")
_ANKLES = ("foot", "ankle")
_TOES = ("toebase", "toes", "toe", "ball")
_SIDES = (("left", "l"), ("right", "r"))


@dataclass(frozen=True)
class JointRoles:
    """Indices of a capture's joints by role. In a pair, the left joint comes first.

    Attributes:
        root: the joint at which trunk and legs branch.
        spine: the joints from the root to the joint at which the arms branch, both included.
        tips: the joints beyond the wrists, or the wrist itself if it has no child.
        toes: the joints beyond the ankles.
    """

    root: int
    spine: tuple[int, ...]
    head: int
    shoulders: tuple[int, int]
    elbows: tuple[int, int]
    wrists: tuple[int, int]
    tips: tuple[int, int]
    hips: tuple[int, int]
    knees: tuple[int, int]
    ankles: tuple[int, int]
    toes: tuple[int, int]


def find_roles(capture: Capture) -> JointRoles:
    """Finds the roles of a capture's joints.

    Raises:
        InputError: if a joint is missing. The message lists the existing joints.
    """
    names = [re.sub(r"[^a-z0-9]", "", name.split(":")[-1].lower()) for name in capture.names]
    elbows = _find_matching_pair(capture, names, _ELBOWS, "elbow")
    knees = _find_matching_pair(capture, names, _KNEES, "knee")
    head = next((j for j, name in enumerate(names) if name == "head"), -1)
    if head < 0:
        raise _make_missing_role_error(capture, "head")
    shoulders = capture.parents[elbows[0]], capture.parents[elbows[1]]
    hips = capture.parents[knees[0]], capture.parents[knees[1]]
    if min(*shoulders, *hips) < 0:
        raise _make_missing_role_error(capture, "shoulder or hip")
    wrists = _find_matching_children(capture, names, elbows, _WRISTS)
    ankles = _find_matching_children(capture, names, knees, _ANKLES)
    trunk = _find_common_ancestors(capture, (*shoulders, head))
    root = _find_common_ancestors(capture, (*hips, trunk[-1]))[-1]
    return JointRoles(
        root=root,
        spine=tuple(trunk[trunk.index(root) :]),
        head=head,
        shoulders=shoulders,
        elbows=elbows,
        wrists=wrists,
        tips=(
            _next_descendant(capture, names, wrists[0], ()),
            _next_descendant(capture, names, wrists[1], ()),
        ),
        hips=hips,
        knees=knees,
        ankles=ankles,
        toes=(
            _next_descendant(capture, names, ankles[0], _TOES),
            _next_descendant(capture, names, ankles[1], _TOES),
        ),
    )


def _find_matching_pair(
    capture: Capture, names: list[str], parts: tuple[str, ...], role: str
) -> tuple[int, int]:
    """Returns the left and the right joint with the same name part. The first of ``parts`` that matches on
    both sides is used.
    """
    for part in parts:
        sides = [
            next((names.index(n) for n in (w + part, part + w, s + part, part + s) if n in names), -1)
            for w, s in _SIDES
        ]
        if min(sides) >= 0:
            return sides[0], sides[1]
    raise _make_missing_role_error(capture, role)


def _make_missing_role_error(capture: Capture, role: str) -> InputError:
    article = "an" if role[0] in "aeiou" else "a"
    return InputError(
        f"no joint is named as {article} {role}",
        where="motion capture",
        remedy=f"Names of the joints: {', '.join(capture.names[:40])}.",
    )


def _ancestors(capture: Capture, joint: int) -> list[int]:
    """Returns the joints on the path from the file's root to ``joint``."""
    chain = [joint]
    while capture.parents[chain[-1]] >= 0:
        chain.append(capture.parents[chain[-1]])
    return chain[::-1]


def _find_common_ancestors(capture: Capture, joints: tuple[int, ...]) -> list[int]:
    """Returns the common ancestors of all the joints."""
    chains = [_ancestors(capture, j) for j in joints]
    return [j for j in chains[0] if all(j in chain for chain in chains)]


def _children_of(capture: Capture, joint: int) -> list[int]:
    return [j for j, parent in enumerate(capture.parents) if parent == joint]


def _find_matching_children(
    capture: Capture, names: list[str], joints: tuple[int, int], parts: tuple[str, ...]
) -> tuple[int, int]:
    """Returns for each of two joints the child with a matching name, or otherwise the first child."""
    children = []
    for joint in joints:
        below = _children_of(capture, joint)
        if not below:
            raise _make_missing_role_error(capture, f"{parts[0]} below {capture.names[joint]}")
        matching = [j for part in parts for j in below if part in names[j]]
        children.append((matching or below)[0])
    return children[0], children[1]


def _next_descendant(capture: Capture, names: list[str], joint: int, parts: tuple[str, ...]) -> int:
    """Returns the nearest descendant at a different position that is not a thumb. If there is none, returns
    the joint itself.
    """
    frontier = [joint]
    while frontier:
        frontier = [j for f in frontier for j in _children_of(capture, f) if "thumb" not in names[j]]
        distant = [j for j in frontier if _distance_between(capture.positions, joint, j) > 1e-3]
        matching = [j for part in parts for j in distant if part in names[j]]
        if matching or distant:
            return (matching or distant)[0]
    return joint


def _distance_between(positions: Float, a: int, b: int) -> float:
    return float(np.median(np.linalg.norm(positions[:, a] - positions[:, b], axis=-1)))
