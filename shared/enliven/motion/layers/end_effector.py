"""End-effector mode: the end of a chain follows the end of the take's chain (AniMesh, section 8).

    bind_chain(..., mode="end")                              # or change the mode of a layer
    end_effector_chains(shape, layer, line) -> list[EndEffectorChain]    # input of the player

First the bones rotate as in the mode "turns". Then the smallest additional rotations move the end of the
chain to

    start + D (curve(b) - curve(a)) length / source length

D is the rotation of the chain's parent. curve(s) is the take's posed polyline relative to its parent, in the
layer's basis. [a, b] is the interval of the layer on this chain, so a chain that was cut follows the
corresponding part of the take's chain. A weight below 1 moves the end only by this fraction of the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int32
from enliven.document import Layer, RiggedCharacter
from enliven.kernels import njit
from enliven.motion.contact.pin import find_bend, local_turns, rebuild
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store, turn
from enliven.motion.kinematics.reaching import reach_goal
from enliven.motion.kinematics.vectors import row
from enliven.motion.layers.polyline import Polyline, locate_on_knots
from enliven.rotation import rotate

_ZERO_LENGTH = 1e-9
"""Rounding tolerance for lengths in metres that count as zero, and for differences of arc fractions that
count as equal."""


@dataclass(frozen=True, eq=False)
class EndEffectorChain:
    """A chain of a shape with an end effector that follows the end of the take's chain.

    Attributes:
        joints: (K,) int32 from the fixed joint to the end effector.
        side: (3,) the direction in which the chain bulges at rest.
        links: (S, 3) bones of the take's polyline at rest, in the target's axes, metres.
        knots: (2,) int32 knots of the take's polyline that correspond to the start and the end of the chain.
        parts: (2,) the fractions of the bones after these knots.
        scale: target length divided by source length.
        weight: weight of the layer.
    """

    joints: Int32
    side: Float
    links: Float
    knots: Int32
    parts: Float
    scale: float
    weight: float


def end_effector_chains(shape: RiggedCharacter, layer: Layer, line: Polyline) -> list[EndEffectorChain]:
    """Returns the chains of a shape that a layer in the mode "end" drives. The list is empty if the take's
    chain has only one joint.
    """
    if layer.mode != "end" or len(layer.chain) < 2:
        return []
    positions = line.clip.skeleton.positions[list(layer.chain)]
    if layer.mirrored:
        positions = positions * [-1.0, 1.0, 1.0]
    links = rotate(layer.basis, np.diff(positions, axis=0))
    return [
        driven
        for chain, start, end in _layer_chains(shape, layer.id)
        if (driven := _make_chain(shape, chain, start, end, links, line.knots, layer.weight)) is not None
    ]


def _make_chain(
    shape: RiggedCharacter,
    chain: list[int],
    start: float,
    end: float,
    links: Float,
    knots: Float,
    weight: float,
) -> EndEffectorChain | None:
    skeleton = shape.skeleton
    lengths = np.linalg.norm(links, axis=1)
    arc_length = np.concatenate([[0.0], np.cumsum(lengths)])
    knot, part = locate_on_knots(knots, np.array([start, end]))
    span = arc_length[knot] + part * lengths[knot]
    target_length, source_length = float(skeleton.lengths[chain[1:]].sum()), float(span[1] - span[0])
    if target_length <= _ZERO_LENGTH or source_length <= _ZERO_LENGTH:
        return None
    side = find_bend(skeleton, chain)[1] if len(chain) > 2 else np.zeros(3)
    return EndEffectorChain(
        np.array(chain, np.int32), side, links, knot, part, target_length / source_length, weight
    )


def _layer_chains(shape: RiggedCharacter, layer: str) -> list[tuple[list[int], float, float]]:
    """Returns the chains of joints that refer to a layer, each with the start and end of its interval of the
    layer.
    """
    intervals: dict[int, tuple[float, float]] = {}
    for bone, spans in enumerate(shape.spans):
        refs = [ref for span in spans for ref in span.refs if ref.layer == layer]
        if refs and bone > 0:
            intervals[bone] = refs[0].start, refs[-1].end
    used: set[int] = set()
    chains = []
    for bone in sorted(intervals):
        if bone in used:
            continue
        chain = [int(shape.skeleton.parents[bone]), bone]
        end = intervals[bone][1]
        while True:
            # A chain continues in the child that has an interval starting where this interval ends.
            continuations = [
                c
                for c in shape.skeleton.children[chain[-1]]
                if c in intervals and c not in used and abs(intervals[c][0] - end) < _ZERO_LENGTH
            ]
            if not continuations:
                break
            chain.append(continuations[0])
            end = intervals[continuations[0]][1]
        used.update(chain[1:])
        chains.append((chain, intervals[bone][0], end))
    return chains


def move_chain_end(
    chain: EndEffectorChain,
    knots: Float,
    layer_weights: Float,
    parents: Int32,
    vectors: Float,
    turns: Float,
    joints: Float,
) -> None:
    """Moves the end of one chain at T times, weighted by ``layer_weights`` (T,). ``knots`` (T, S + 1, 4) are
    the take's rotations.

    Rotations and joints are changed in place. ``vectors`` (T or 1, N, 3) are the vectors from each parent to
    its joint before the bone rotates, metres.
    """
    weights = chain.weight * layer_weights
    fixed = (chain.joints, chain.side, chain.links, chain.knots, chain.parts, chain.scale, weights)
    # Copy to a contiguous array, so that Numba compiles the kernel only once.
    contiguous_knots = np.ascontiguousarray(knots)
    move_end_to_target(parents, vectors, *fixed, contiguous_knots, turns, joints)


@njit(cache=True, nogil=True)
def move_end_to_target(
    parents, vectors, chain, side, links, ends, parts, scale, weights, knots, turns, joints
):
    """Moves the end of a chain to the position of the take's end, and updates its descendants.

    Args:
        vectors: (T or 1, N, 3) vector from each parent to its joint before the bone rotates, metres.
        chain: (K,) joints.
        links: (S, 3) the take's bones at rest in the target's axes.
        ends: (2,) the knots at which the chain begins and ends on the take's polyline.
        parts: (2,) the fractions of the bones after these knots.
        knots: (T, S + 1, 4) the take's rotations at its joints.
        weights: (T,) fraction of the distance to the target that the end is moved.
        turns: (T, N, 4) world rotations, changed in place.
        joints: (T, N, 3) metres, changed in place.
    """
    count = len(chain)
    local, bone_turns = np.empty((len(parents), 4)), np.empty((count - 1, 4))
    points = np.empty((count, 3))
    fixed = np.zeros(len(parents), np.bool_)
    for t in range(len(turns)):
        weight = weights[t]
        if weight == 0.0:
            continue
        q = conj(between(load(knots[t], ends[0]), load(knots[t], ends[0] + 1), parts[0]))
        a, b = (
            interpolate_polyline(links, knots[t], ends[0], parts[0]),
            interpolate_polyline(links, knots[t], ends[1], parts[1]),
        )
        way = turn(q, (b[0] - a[0]) * scale, (b[1] - a[1]) * scale, (b[2] - a[2]) * scale)
        way = turn(load(turns[t], chain[0]), way[0], way[1], way[2])
        start, end = row(joints[t], chain[0]), row(joints[t], chain[count - 1])
        goal = (
            end[0] + weight * (start[0] + way[0] - end[0]),
            end[1] + weight * (start[1] + way[1] - end[1]),
            end[2] + weight * (start[2] + way[2] - end[2]),
        )
        for i in range(count):
            points[i, 0], points[i, 1], points[i, 2] = row(joints[t], chain[i])
        bulge = turn(load(turns[t], chain[0]), side[0], side[1], side[2])
        reach_goal(points, goal, bulge, bone_turns)
        local_turns(parents, turns[t], local)
        for i in range(1, count):
            fixed[chain[i]] = True
            store(turns[t], chain[i], mul(load(bone_turns, i - 1), load(turns[t], chain[i])))
        way = vectors[min(t, len(vectors) - 1)]
        rebuild(parents, way, fixed, local, chain[0], turns[t], joints[t])


@njit(cache=True, nogil=True)
def interpolate_polyline(links, knots, knot, part):
    """Returns the position on the take's posed polyline at the fraction ``part`` of bone ``knot``, relative
    to its start.
    """
    x, y, z = 0.0, 0.0, 0.0
    for i in range(knot + 1):
        share = part if i == knot else 1.0
        a, b, c = turn(load(knots, i + 1), links[i, 0], links[i, 1], links[i, 2])
        x, y, z = x + share * a, y + share * b, z + share * c
    return x, y, z
