"""Computes a person's joints in a human-like mesh from its five ends.

A limb's joints lie in the middle of its rings of equal geodesic distance from its end, at typical human
fractions of its length. Left and right follow from the front. Feet, bent knees and bent elbows indicate the
front.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.surface_ends import LimbEnds
from enliven.person import J, Joint
from enliven.possession.likeness.five_ends import FiveEnds
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.rotation import unit

_ARM_FRACTIONS = (0.86, 0.52, 0.2, 0.06)
"""Positions of shoulder, elbow, wrist and hand: distances from the limb's end as fractions of the arm's
length. They were measured on randomly generated bodies."""
_LEG_FRACTIONS = (1.03, 0.6, 0.21, 0.04)
"""Positions of hip, knee, ankle and foot: distances from the limb's end as fractions of the leg's length."""
_SKULL_FRACTION = 0.85
"""Length of the skull from the head's end, as a fraction of the head's length. The head joint is the mean
over the skull."""
_RING_HALF_WIDTH = 0.07
"""Half the width of a ring, as a fraction of the limb's length."""
_WAIST_POSITION = 0.44
"""Position at which the trunk bends, as a fraction of its length from the hips."""
_HIP_CENTRE_HEIGHT = 0.12
"""Height of the hip centre above the hip joints, as a fraction of the trunk."""
_MAX_LIFTED_COSINE = 0.6
"""Maximum cosine of the angle between thigh and trunk of a lifted leg. The rings around a lifted leg end in
the lap."""
_MIN_FRONT_EVIDENCE = 0.015
"""Minimum front/back evidence, as a fraction of body height. If there is less, the front is reported as
uncertain."""
_ELBOW_WEIGHT = 0.5
"""Weight of the elbows' distance behind the arms as evidence of the front. The distances of toes and knees
ahead of the legs have weight 1."""
_HAND_WEIGHT = 0.1
"""Weight of the hands' distance ahead of the shoulders as evidence of the front. It is low, because hands may
be anywhere."""
_MODELLED_FRONT_BIAS = 0.03
"""Bias, as a fraction of the height, towards +Z as the front. Most meshes are modelled facing +Z."""
_MIN_COST_MARGIN = 2.0
"""Minimum cost difference to the next best choice of ends. If it is smaller, the choice is reported as
uncertain."""


def human_from_ends(limb_ends: LimbEnds, ends: FiveEnds) -> BodyInMesh:
    """Computes the skeleton of a person in a mesh with these five ends."""
    limbs = _Limbs(limb_ends, ends)
    arms = np.array(
        [
            [limbs.find_cross_section_centre(k, fraction, ends.tree.arm) for fraction in _ARM_FRACTIONS]
            for k in (1, 2)
        ]
    )
    legs = np.array(
        [
            [limbs.find_cross_section_centre(k, fraction, ends.tree.leg) for fraction in _LEG_FRACTIONS]
            for k in (3, 4)
        ]
    )
    for leg in legs:
        leg[0] = _hip_at_trunk(leg[0], leg[1], arms[:, 0].mean(0), limbs.find_trunk_centre())
    if (arms[0, 0] - arms[1, 0]) @ (legs[0, 0] - legs[1, 0]) < 0.0:
        legs = legs[::-1]
    height = float(np.ptp(limb_ends.points[:, 1])) or 1.0
    up = arms[:, 0].mean(0) - legs[:, 0].mean(0)
    left = _perpendicular_unit(arms[0, 0] - arms[1, 0] + legs[0, 0] - legs[1, 0], up)
    ahead = np.cross(left, unit(up))
    front_evidence = _collect_front_evidence(arms, legs, ahead) / height + _MODELLED_FRONT_BIAS * ahead[2]
    if front_evidence < 0.0:
        arms, legs, ahead = arms[::-1], legs[::-1], -ahead
    joints = _list_all_joints(arms, legs, limbs.find_skull_centre(_SKULL_FRACTION * ends.tree.head))
    order = _order_ends(ends.points, joints)
    return BodyInMesh(
        joints,
        float(np.arctan2(ahead[0], ahead[2])),
        human=True,
        ends=ends.points[order],
        doubts=_make_doubt_sentences(ends, abs(front_evidence)),
        strangeness=ends.cost,
    )


class _Limbs:
    """The limbs that end in the five ends. Each point of the surface belongs to at most one limb. If limbs
    overlap, it belongs to the limb in which it is deepest.
    """

    def __init__(self, limb_ends: LimbEnds, ends: FiveEnds) -> None:
        tree = ends.tree
        length = np.array([tree.head, tree.arm, tree.arm, tree.leg, tree.leg])
        self._points, self._distances = limb_ends.points, ends.distances
        overshoot = ends.distances - length[:, None]
        self._owner, self._beyond = overshoot.argmin(0), (overshoot > 0).all(0)

    def find_cross_section_centre(self, limb: int, fraction: float, length: float) -> Float:
        """Returns the centre (3,), in metres, of a limb's cross section at a fraction of its length from its
        end.
        """
        offset = self._distances[limb] - fraction * length
        is_own = self._owner == limb
        weights = np.exp(-0.5 * (offset[is_own] / (_RING_HALF_WIDTH * length)) ** 2) + 1e-12
        weights /= weights.sum()
        mean, centre = float(weights @ offset[is_own]), weights @ self._points[is_own]
        spread = float(weights @ (offset[is_own] - mean) ** 2)
        slope = (weights * (offset[is_own] - mean)) @ (self._points[is_own] - centre) / max(spread, 1e-12)
        return np.asarray(
            centre + slope * np.clip(-mean, -_RING_HALF_WIDTH * length, _RING_HALF_WIDTH * length)
        )

    def find_trunk_centre(self) -> Float:
        """Returns the centre (3,) of the points that belong to no limb, metres. If every point belongs to a
        limb, returns the centre of all points.
        """
        is_trunk = self._beyond
        return np.asarray(self._points[is_trunk if is_trunk.any() else slice(None)].mean(0))

    def find_skull_centre(self, deep: float) -> Float:
        """Returns the centre (3,) of the points within ``deep`` metres of the head's end, metres."""
        in_skull = self._distances[0] < deep
        return np.asarray(
            self._points[in_skull].mean(0) if in_skull.any() else self._points[self._distances[0].argmin()]
        )


def _hip_at_trunk(hip: Float, knee: Float, neck: Float, middle: Float) -> Float:
    """Returns the corrected hip joint (3,), metres. If the leg is lifted, the joint is moved along the thigh
    to the trunk's axis.
    """
    thigh, trunk = unit(hip - knee), unit(middle - neck)
    along = float(thigh @ trunk)
    if abs(along) > _MAX_LIFTED_COSINE:
        return hip
    to_trunk = middle - hip
    further = float(to_trunk @ thigh - along * (to_trunk @ trunk)) / (1.0 - along * along)
    return np.asarray(hip + max(further, 0.0) * thigh)


def _perpendicular_unit(vector: Float, up: Float) -> Float:
    """Returns the direction (3,) of the component of ``vector`` that is perpendicular to ``up``, as a unit
    vector.
    """
    perpendicular = vector - up * float(vector @ up) / max(float(up @ up), 1e-12)
    return unit(perpendicular)


def _collect_front_evidence(arms: Float, legs: Float, ahead: Float) -> float:
    """Returns the evidence, metres, that ``ahead`` is the front. It is positive if toes, knees and hands are
    ahead and elbows behind.
    """
    toes = (legs[:, 3] - legs[:, 2]).mean(0)
    knees = (legs[:, 1] - (legs[:, 0] + legs[:, 2]) / 2).mean(0)
    elbows = ((arms[:, 0] + arms[:, 2]) / 2 - arms[:, 1]).mean(0)
    hands = (arms[:, 3] - arms[:, 0]).mean(0)
    return float((toes + knees + _ELBOW_WEIGHT * elbows + _HAND_WEIGHT * hands) @ ahead)


def _list_all_joints(arms: Float, legs: Float, skull: Float) -> Float:
    """Returns all joints (20, 3), metres, from the joints of arms and legs (2, 4, 3 each, left first) and the
    centre of the skull.
    """
    joints = np.empty((J, 3))
    joints[Joint.SHOULDER_LEFT : Joint.SHOULDER_RIGHT], joints[Joint.SHOULDER_RIGHT : Joint.HIP_LEFT] = arms
    joints[Joint.HIP_LEFT : Joint.HIP_RIGHT], joints[Joint.HIP_RIGHT :] = legs
    neck, hips = arms[:, 0].mean(0), legs[:, 0].mean(0)
    joints[Joint.SHOULDER_CENTER], joints[Joint.HEAD] = neck, skull
    joints[Joint.HIP_CENTER] = hips + _HIP_CENTRE_HEIGHT * (neck - hips)
    joints[Joint.SPINE] = hips + _WAIST_POSITION * (neck - hips)
    return joints


def _order_ends(points: Float, joints: Float) -> list[int]:
    """Returns the indices of the five ends as head, left hand, right hand, left foot, right foot."""
    order = [0]
    for first, left in ((1, Joint.HAND_LEFT), (3, Joint.FOOT_LEFT)):
        distances = [float(np.linalg.norm(points[first + k] - joints[left])) for k in (0, 1)]
        order += [first, first + 1] if distances[0] <= distances[1] else [first + 1, first]
    return order


def _make_doubt_sentences(ends: FiveEnds, sure: float) -> tuple[str, ...]:
    """Returns a sentence about each property that is uncertain."""
    doubts = []
    if ends.margin < _MIN_COST_MARGIN:
        doubts.append("The head, hands and feet of the mesh are uncertain.")
    if sure < _MIN_FRONT_EVIDENCE:
        doubts.append("The front side of the mesh is uncertain.")
    return tuple(doubts)
