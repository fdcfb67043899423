"""Finds a person's joints in an arbitrary mesh. The extremities of the mesh are interpreted as head, hands
and feet.

An extremity (tip) is a local maximum of the geodesic distance from the middle, as in AniMesh. A limb is the
part of the mesh around a tip. A limb's joints lie in the middle of its rings of equal geodesic distance from
the tip. For example, a horse's hind legs become legs, its forelegs arms and its neck the head. The legs and
the back of a chair are interpreted in the same way. A lamp gets only a spine and an arm.
"""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Int, Int32
from enliven.deformation.graph.graph import DeformationGraph
from enliven.person import J, Joint
from enliven.possession.likeness.skeleton import BodyInMesh

_MAX_TIPS = 8
"""Maximum number of tips (extremities) of a mesh."""
_MIN_LIMB_LENGTH = 0.08
"""Minimum length of a limb, as a fraction of the longest geodesic distance from the middle."""
_MAX_FOOT_HEIGHT = 0.15
"""Maximum height of a tip that counts as a foot, as a fraction of the mesh's height."""
_MIN_LONG_RATIO = 1.5
"""Minimum ratio of length to width of a long mesh. The front of a long mesh is the end with its head."""
_MIN_HEAD_LEAD = 0.15
"""Minimum horizontal distance of the head from the middle at which the head determines the front, as a
fraction of the height. Only in a body that is not upright is the distance larger."""
_LEG_JOINTS = (
    (Joint.HIP_LEFT, 0.95),
    (Joint.KNEE_LEFT, 0.5),
    (Joint.ANKLE_LEFT, 0.12),
    (Joint.FOOT_LEFT, 0.0),
)
"""Joints of a leg, and their distance from the tip as a fraction of the limb's length, approximately as in a
person."""
_ARM_JOINTS = (
    (Joint.SHOULDER_LEFT, 0.95),
    (Joint.ELBOW_LEFT, 0.5),
    (Joint.WRIST_LEFT, 0.15),
    (Joint.HAND_LEFT, 0.0),
)
"""Joints of an arm, and their distance from the tip as a fraction of the limb's length."""
_RIGHT_JOINT_OFFSET = 4
"""Difference between the numbers of a right joint and the corresponding left joint."""


def body_from_extremities(graph: DeformationGraph) -> BodyInMesh:
    """Finds the skeleton of a person in the mesh of a graph, based on its extremities."""
    limbs = _Limbs(graph.positions, *find_extremities(graph))
    floor, height = limbs.positions[:, 1].min(), np.ptp(limbs.positions[:, 1]) or 1.0
    level = (limbs.at[:, 1] - floor) / height
    feet, free = np.flatnonzero(level < _MAX_FOOT_HEIGHT), np.flatnonzero(level >= _MAX_FOOT_HEIGHT)
    free = free[np.argsort(-level[free])]
    heads = free[level[free] > level[free].max(initial=0.0) - 0.1][:2] if len(free) else free
    yaw = _estimate_front_yaw(limbs, heads, feet)
    left, ahead = np.array([np.cos(yaw), 0, -np.sin(yaw)]), np.array([np.sin(yaw), 0, np.cos(yaw)])
    joints = np.full((J, 3), np.nan)
    legs, arms = _assign_limbs(
        limbs.at,
        feet,
        sorted(set(free.tolist()) - set(heads.tolist()), key=lambda t: -limbs.out[t]),
        left,
        ahead,
    )
    _write_limb_joints(joints, limbs, _LEG_JOINTS, legs)
    _write_limb_joints(joints, limbs, _ARM_JOINTS, arms)
    _write_trunk_joints(joints, limbs, heads, floor, height)
    return BodyInMesh(joints, yaw)


def find_extremities(graph: DeformationGraph) -> tuple[Int, Float, Float]:
    """Finds the tips of the mesh, the lengths of their limbs, and the geodesic distances from them.

    A tip is a local maximum of the geodesic distance from the middle. Its limb extends down to a saddle that
    is much nearer to the middle (persistence of the superlevel sets).

    Returns:
        (T,) tip nodes, the farthest first; (T,) limb lengths, metres; (T, N) geodesic distances from each
        tip, metres.
    """
    distances = _GeodesicDistances(graph)
    count = len(graph.positions)
    spread_nodes, nearest_distances = [0], distances.from_node(0)
    for _ in range(min(count, 48) - 1):
        spread_nodes.append(int(np.argmax(nearest_distances)))
        nearest_distances = np.minimum(nearest_distances, distances.from_node(spread_nodes[-1]))
    middle_node = int(np.argmin(np.mean([distances.from_node(node) for node in spread_nodes], axis=0)))
    tips, lengths = _find_prominent_peaks(distances.from_node(middle_node), graph.edges)
    return tips, lengths, np.stack([distances.from_node(int(tip)) for tip in tips])


def _find_prominent_peaks(height: Float, edges: Int32) -> tuple[Int, Float]:
    """Returns the prominent peaks (T,), highest first, and the prominence (T,) of each.

    The prominence is the height of a peak above the saddle at which its group of nodes merges with the group
    of a higher peak.
    """
    min_prominence = _MIN_LIMB_LENGTH * float(height.max())
    neighbours: list[list[int]] = [[] for _ in height]
    for a, b in edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    # peak contains the union-find parent of each processed node. The root of a group is its highest node.
    peak: dict[int, int] = {}
    length: dict[int, float] = {}
    for node in np.argsort(-height, kind="stable").tolist():
        neighbour_peaks = sorted(
            {_find_highest_node(peak, n) for n in neighbours[node] if n in peak}, key=lambda n: -height[n]
        )
        peak[node] = neighbour_peaks[0] if neighbour_peaks else node
        for top in neighbour_peaks[1:]:
            if height[top] - height[node] >= min_prominence:
                length[top] = height[top] - height[node]
                length.setdefault(neighbour_peaks[0], height[neighbour_peaks[0]] - height[node])
            peak[top] = neighbour_peaks[0]
    highest = int(np.argmax(height))
    length.setdefault(highest, float(height[highest]))
    tips = np.array(sorted(length, key=lambda n: -height[n])[:_MAX_TIPS])
    return tips, np.array([length[int(tip)] for tip in tips])


def _find_highest_node(peak: dict[int, int], node: int) -> int:
    """Returns the highest node of the group that contains ``node``: the root of its union-find tree."""
    while peak[node] != node:
        peak[node] = peak[peak[node]]
        node = peak[node]
    return node


class _GeodesicDistances:
    """A cache of geodesic distances along the graph from a node to all others, metres."""

    def __init__(self, graph: DeformationGraph) -> None:
        a, b = graph.edges[:, 0], graph.edges[:, 1]
        lengths = np.linalg.norm(graph.positions[a] - graph.positions[b], axis=1)
        count = len(graph.positions)
        self._matrix = scipy.sparse.csr_matrix((np.maximum(lengths, 1e-9), (a, b)), (count, count))
        self._known: dict[int, Float] = {}

    def from_node(self, node: int) -> Float:
        """Returns the distances (N,) from a node, metres."""
        if node not in self._known:
            self._known[node] = scipy.sparse.csgraph.dijkstra(self._matrix, directed=False, indices=node)
        return self._known[node]


class _Limbs:
    """The parts of a mesh around its tips.

    Attributes:
        at: (T, 3) positions of the tips, metres.
        out: (T,) prominence of each tip, metres.
        length: (T,) length of each limb, metres. It is half the distance to the nearest other tip, or the
            distance to the saddle between the limb and another limb if that is larger.
    """

    def __init__(self, positions: Float, tips: Int, lengths: Float, ways: Float) -> None:
        self.positions, self.at, self._distances = positions, positions[tips], ways
        tip_distances = ways[:, tips] + np.where(np.eye(len(tips), dtype=bool), np.inf, 0.0)
        half = (
            np.where(np.isfinite(tip_distances), tip_distances, 0.0).min(
                1, where=np.isfinite(tip_distances), initial=np.inf
            )
            / 2
        )
        self.out = lengths
        self.length = np.maximum(lengths, np.where(np.isfinite(half), half, 0.0))
        self._owner = ways.argmin(0)

    def ring(self, tip: int, fraction: float) -> Float:
        """Returns the centre (3,) of the limb's cross section at a fraction of its length from the tip, by a
        local linear fit.
        """
        is_own = self._owner == tip
        offset, ring_points = (
            self._distances[tip][is_own] - fraction * self.length[tip],
            self.positions[is_own],
        )
        width = max(0.25 * self.length[tip], float(np.sort(np.abs(offset))[:6][-1]))
        weights = np.exp(-0.5 * (offset / max(0.5 * width, 1e-9)) ** 2) + 1e-9
        mean_way, centre = weights @ offset / weights.sum(), weights @ ring_points / weights.sum()
        spread = weights @ (offset - mean_way) ** 2
        slope = (
            (weights * (offset - mean_way)) @ (ring_points - centre) / spread
            if spread > 1e-12
            else np.zeros(3)
        )
        step = float(np.clip(-mean_way, -width, width))
        return np.asarray(centre + slope * step)


def _estimate_front_yaw(limbs: _Limbs, heads: Int, feet: Int) -> float:
    """Returns the heading of the front: radians about +Y from +Z.

    A long mesh on four or more feet faces along its length, towards the head. A mesh on two feet faces
    perpendicular to the line between the legs, towards the head or else the toes. All other meshes face +Z.
    If neither head nor toes distinguish the two opposite directions, the direction nearer to +Z is used.
    """
    middle = limbs.positions.mean(0)
    head = limbs.at[heads].mean(0) - middle if len(heads) else np.zeros(3)
    flat = (limbs.positions - middle)[:, [0, 2]]
    sizes, axes = np.linalg.eigh(flat.T @ flat)
    if len(feet) == 2:
        knees = np.array([limbs.ring(int(t), 0.4) for t in feet])
        front = np.array([-(knees[1] - knees[0])[2], (knees[1] - knees[0])[0]])
        toes = (limbs.at[feet] - knees).mean(0)
        leans = abs(head[[0, 2]] @ front) > _MIN_HEAD_LEAD * np.ptp(limbs.positions[:, 1]) * np.linalg.norm(
            front
        )
        ahead = head if leans else toes
    elif len(feet) >= 4 and sizes[1] > _MIN_LONG_RATIO**2 * max(sizes[0], 1e-12):
        front, ahead = axes[:, 1], head
    else:
        return 0.0
    lead = float(front @ ahead[[0, 2]]) / max(float(np.linalg.norm(front)), 1e-12)
    is_small = abs(lead) < 0.02 * np.ptp(limbs.positions[:, 1])
    if (front[1] if is_small else lead) < 0:
        front = -front
    return float(np.arctan2(front[0], front[1]))


def _assign_limbs(
    at: Float, feet: Int, others: list[int], left: Float, ahead: Float
) -> tuple[list[int], list[int]]:
    """Assigns tips to limbs. Returns pairs (left, right) of the tips of legs and of arms."""
    by_depth = sorted((int(t) for t in feet), key=lambda t: float(at[t] @ ahead))

    def sides(pair: list[int]) -> list[int]:
        return sorted(pair, key=lambda t: -float(at[t] @ left))

    legs = sides(by_depth[:2]) if len(by_depth) >= 2 else []
    arms = by_depth[-2:] if len(by_depth) >= 4 else by_depth[2:3] * 2
    if not arms and len(others) >= 2:
        arms = others[:2]
    return legs, sides(arms)


def _write_limb_joints(
    joints: Float, limbs: _Limbs, chain: tuple[tuple[Joint, float], ...], pair: list[int]
) -> None:
    """Writes the joints of a pair of limbs, the left tip first."""
    for side, tip in enumerate(pair):
        for joint, fraction in chain:
            joints[joint + _RIGHT_JOINT_OFFSET * side] = limbs.ring(tip, fraction)


def _write_trunk_joints(joints: Float, limbs: _Limbs, heads: Int, floor: float, height: float) -> None:
    """Writes hip, spine, shoulders and head: between the limbs or, without limbs, from the floor to the
    head.
    """
    hips, shoulders = (
        joints[[j, j + _RIGHT_JOINT_OFFSET]].mean(0) for j in (Joint.HIP_LEFT, Joint.SHOULDER_LEFT)
    )
    if not np.isfinite(hips).all():
        hips = limbs.positions[limbs.positions[:, 1] <= floor + _MAX_FOOT_HEIGHT * height].mean(0)
    head = limbs.positions[np.argmax(limbs.positions[:, 1])]
    neck = hips + 0.7 * (head - hips)
    if len(heads):
        head = np.mean([limbs.ring(t, 0.1) for t in heads], axis=0)
        neck = np.mean([limbs.ring(t, 1.0) for t in heads], axis=0)
    if not np.isfinite(shoulders).all():
        shoulders = neck
        for joint, position in zip(
            (j for j, _ in _ARM_JOINTS), (hips, (hips + head) / 2, head, head), strict=True
        ):
            joints[[joint, joint + _RIGHT_JOINT_OFFSET]] = position
        if np.isfinite(joints[Joint.KNEE_LEFT]).all():
            joints[[j + s for j, _ in _ARM_JOINTS for s in (0, _RIGHT_JOINT_OFFSET)]] = np.nan
    joints[Joint.HIP_CENTER], joints[Joint.SHOULDER_CENTER], joints[Joint.HEAD] = hips, shoulders, head
    joints[Joint.SPINE] = (hips + shoulders) / 2
