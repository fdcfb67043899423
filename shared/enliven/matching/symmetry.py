"""Equal limbs: a motion that one of them was given can be offered to all (wished for in AniMesh, section 8).

A *limb* is a joint with all that hangs on it, seen from the joint it hangs on. Limbs of one joint are equal
if a rotation about an axis through that joint, or a reflection in a plane through it, puts one on the other,
joint on joint: tentacles around a squid's head, left and right of anything. A skeleton is as symmetric as
its modeler's hand was steady, so places may differ by a share of the limb's reach.

The axis of several limbs is the normal of the plane that their middles lie in (through three middles at equal
distance from the joint there is one circle); two limbs have the plane half-way between their middles.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.matching.limb_shapes import LimbShapes
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.settings import setting

_MOST = 0.75
"""Share of the limbs that are alike from which on a rotation is no accident: of a spider's eight legs, some
three are always turned copies of one another."""


@dataclass(frozen=True)
class SymmetrySettings:
    """What counts as equal."""

    tolerance: float = setting(
        0.08,
        "Joints of equal limbs are apart by less than this share of the limb's reach, as a root mean square, "
        "and none by more than twice that.",
        low=0.0,
        high=0.5,
    )
    shortest: float = setting(
        0.02, "Limbs shorter than this share of the longest are not looked at.", low=0.0, high=1.0
    )


@dataclass(frozen=True, eq=False)
class EqualLimb:
    """One of a group of equal limbs.

    Attributes:
        joints: the limb's, in the order of the group's other limbs; the first hangs on the group's joint.
        linear: (3, 3) what turns the group's first limb into this one, about the group's joint.
        error: how far joints are apart then (root mean square), as a share of the limb's reach.
    """

    joints: tuple[int, ...]
    linear: Float
    error: float


@dataclass(frozen=True, eq=False)
class EqualLimbs:
    """Limbs of one joint that are equal.

    Attributes:
        kind: "rotation": each is another turned about the axis; "mirror": two, left and right of a plane.
        joint: the one that they hang on.
        axis: (3,) unit vector along the axis, or across the plane; both go through the joint.
        limbs: two or more, by angle about the axis.
    """

    kind: Literal["rotation", "mirror"]
    joint: int
    axis: Float
    limbs: tuple[EqualLimb, ...]

    def limb_of(self, joint: int) -> int:
        """Which limb a joint is of, or -1."""
        return next((i for i, limb in enumerate(self.limbs) if joint in limb.joints), -1)

    def between(self, start: int, end: int) -> Float:
        """(3, 3) what turns limb ``start`` into limb ``end``."""
        return np.asarray(self.limbs[end].linear @ self.limbs[start].linear.T)

    def joint_map(self, start: int, end: int) -> dict[int, int]:
        """Joint by joint from limb ``start`` to limb ``end``; the group's joint stays."""
        pairs = zip(self.limbs[start].joints, self.limbs[end].joints, strict=True)
        return {self.joint: self.joint, **dict(pairs)}


def equal_limbs(skeleton: Skeleton, settings: SymmetrySettings | None = None) -> tuple[EqualLimbs, ...]:
    """All groups of equal limbs, those of most limbs first; of the pairs, those of the body's own plane.

    Three limbs or more that a rotation makes equal are one group; so are two where no plane does. A limb may
    be in two groups, a turned and a mirrored one: the legs of a table are both of one another.
    """
    settings = settings or SymmetrySettings()
    body = LimbShapes(skeleton)
    alike = list(body.alike(settings.tolerance, settings.shortest))
    turned = [group for joint, like in alike for group in _turned(body, joint, like, settings)]
    mirrored = [group for joint, like in alike for group in _mirrored(body, joint, like, settings)]
    paired = {frozenset(limb.joints[0] for limb in group.limbs) for group in mirrored}
    turned = [
        g for g in turned if len(g.limbs) > 2 or frozenset(limb.joints[0] for limb in g.limbs) not in paired
    ]
    return tuple(sorted([*_by_plane(mirrored, body), *turned], key=lambda group: -len(group.limbs)))


def _turned(body: LimbShapes, joint: int, like: list[int], settings: SymmetrySettings) -> list[EqualLimbs]:
    """The group that a rotation makes of most of the limbs that are alike."""
    found: EqualLimbs | None = None
    for axis in _axes(body, joint, like):
        made = _around(body, joint, like, axis, settings)
        if made is not None and (found is None or len(made.limbs) > len(found.limbs)):
            found = made
        if found is not None and len(found.limbs) == len(like):
            break
    return [found] if found is not None and len(found.limbs) >= _MOST * len(like) else []


def _axes(body: LimbShapes, joint: int, limbs: list[int]) -> list[Float]:
    """Axes about which limbs may turn into one another: of all of them, of each three, of each two."""
    middles = body.middle[limbs] - body.at[joint]
    if len(limbs) == 2:
        return [axis for axis in [_unit(middles.sum(0))] if axis is not None]
    about = middles - middles.mean(0)
    axes = [np.linalg.eigh(about.T @ about)[1][:, 0]]
    # A few are enough: a circle of three or more limbs holds three that follow one another in a list.
    for a, b, c in itertools.islice(itertools.combinations(middles, 3), 200):
        axis = _unit(np.cross(b - a, c - a))
        if axis is not None:
            axes.append(axis)
    return axes


def _around(
    body: LimbShapes, joint: int, limbs: list[int], axis: Float, settings: SymmetrySettings
) -> EqualLimbs | None:
    """The limbs that are the first one turned about an axis, or None without any."""
    if axis[int(np.argmax(np.abs(axis)))] < 0.0:
        axis = -axis
    best: list[EqualLimb] = []
    for first in limbs[: max(1, len(limbs) - 2)]:
        made = []
        for other in limbs:
            angle = _angle(body.middle[first] - body.at[joint], body.middle[other] - body.at[joint], axis)
            linear = to_matrix(from_rotation_vector(angle * axis))
            matched = body.matched(joint, first, other, linear, settings.tolerance)
            if matched is not None:
                made.append((angle % (2 * np.pi - 1e-9), matched, linear))
        if len(made) > len(best):
            order = [pair[0] for pair in made[0][1].pairs]
            best = [
                EqualLimb(tuple(dict(matched.pairs)[j] for j in order), linear, matched.error)
                for _, matched, linear in sorted(made, key=lambda entry: entry[0])
            ]
        if len(best) == len(limbs):
            break
    return EqualLimbs("rotation", joint, axis, tuple(best)) if len(best) > 1 else None


def _angle(start: Float, end: Float, axis: Float) -> float:
    """Radians about the axis from one direction to another, in [0, 2 pi)."""
    a, b = start - (start @ axis) * axis, end - (end @ axis) * axis
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b) % (2 * np.pi))


def _mirrored(body: LimbShapes, joint: int, like: list[int], settings: SymmetrySettings) -> list[EqualLimbs]:
    """Every pair that a plane through the joint makes equal."""
    groups = []
    for a, b in itertools.combinations(like, 2):
        across = _unit(body.middle[a] - body.middle[b])
        if across is None:
            continue
        if across[int(np.argmax(np.abs(across)))] < 0.0:
            across = -across
        linear = np.eye(3) - 2.0 * np.outer(across, across)
        matched = body.matched(joint, a, b, linear, settings.tolerance)
        if matched is not None:
            limbs = (
                EqualLimb(tuple(one for one, _ in matched.pairs), np.eye(3), 0.0),
                EqualLimb(tuple(other for _, other in matched.pairs), linear, matched.error),
            )
            groups.append(EqualLimbs("mirror", joint, across, limbs))
    return groups


def _by_plane(groups: list[EqualLimbs], body: LimbShapes) -> list[EqualLimbs]:
    """Mirrored pairs, each limb once: those of the plane that the most bone agrees on before the others."""
    axes = np.array([group.axis for group in groups]).reshape(-1, 3)
    weights = np.array([body.length[group.limbs[0].joints[0]] for group in groups])
    agree = (np.abs(axes @ axes.T) > 0.98) @ weights
    kept, taken = [], set[int]()
    for i in sorted(range(len(groups)), key=lambda i: (-round(float(agree[i]), 9), groups[i].joint)):
        ends = {limb.joints[0] for limb in groups[i].limbs}
        if not ends & taken:
            kept.append(groups[i])
            taken |= ends
    return kept


def _unit(vector: Float) -> Float | None:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else None
