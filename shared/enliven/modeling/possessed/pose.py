"""Where the nodes and the vertices of a graph shape are at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import GraphLayer, GraphPart, GraphShape, Pose, PoseStream, Project, smoothed
from enliven.errors import InputError
from enliven.modeling.mesh import blended
from enliven.rotation import conjugate, from_matrix, multiply, rotate, to_matrix

_MIRRORED = np.array([-1.0, 1.0, 1.0])
"""The diagonal of the reflection in the plane x = 0."""


def graph_pose(project: Project, shape: GraphShape, time: float) -> tuple[Float, Float]:
    """(N, 3, 3) the linear maps and (N, 3) the positions in metres of the nodes of a shape.

    Between two frames both are mixed in proportion. A part that rides is carried rigidly; see
    :class:`enliven.document.Ride`. What was performed over it comes within that; see
    :class:`enliven.document.GraphLayer`.

    Raises:
        InputError: for a time that is not finite.
    """
    if not np.isfinite(time):
        raise InputError(f"the time is {time}", where=shape.where, mend="Give seconds.")
    linear, positions = np.empty((len(shape.positions), 3, 3)), np.empty((len(shape.positions), 3))
    over = [_layer_at(project, layer, len(shape.positions), time) for layer in shape.over]
    for part, start in zip(shape.parts, shape.starts, strict=False):
        maps, places = _played(smoothed(project.streams[part.take], part.smooth), part, time)
        if part.mirrored:
            maps, places = maps * _MIRRORED * _MIRRORED[:, None], places * _MIRRORED
        places = part.size * places
        turn, move = part.turn, part.place
        here = slice(start, start + len(part.nodes))
        if part.ride is not None:
            # What was performed over both reaches the part itself; what carries it is without that.
            carriers = [one for one in over if not one.moves[here].any()]
            node = np.array([part.ride.node])
            held = _layered((linear[node], positions[node]), carriers, node)
            carry = multiply(from_matrix(held[0][0]), conjugate(part.ride.turn))
            move = rotate(carry, move - part.ride.place) + held[1][0]
            turn = multiply(carry, turn)
        linear[here] = to_matrix(turn) @ maps @ to_matrix(conjugate(part.axes))
        positions[here] = rotate(turn, places) + move
    return _layered((linear, positions), over, np.arange(len(positions)))


def within_layer(
    project: Project, shape: GraphShape, number: int, node: int, time: float
) -> tuple[Float, Float, float]:
    """What a layer over a shape does for one of its nodes at a time.

    Args:
        number: of the layer among those over it.

    Returns:
        (3, 3) by how much the node goes for a way within the rest that the layer gives it, (3,) metres where
        it is, and how far the layer is heard.
    """
    layer = shape.over[number]
    outer = shape.with_changes(over=shape.over[:number])
    linear = graph_pose(project, outer, time)[0][node]
    seen = graph_pose(project, shape, time)[1][node]
    weight = layer.moment(time, project.length_of(layer)).weight
    return linear, seen, 0.0 if layer.muted else layer.weight * weight


def graph_vertices(shape: GraphShape, linear: Float, positions: Float) -> Float:
    """(V, 3) metres, the vertices for nodes with linear maps (N, 3, 3) at positions (N, 3)."""
    return blended(shape.mesh.vertices, shape.skin, shape.positions, linear, positions)


def pose_of_graph(project: Project, shape: GraphShape, time: float) -> Pose:
    """The pose of a graph shape for the wire and the viewer."""
    linear, positions = graph_pose(project, shape, time)
    return Pose(shape.id, round(time * 1e9), linear.astype(np.float32), positions.astype(np.float32))


@dataclass(frozen=True)
class _Within:
    """What a layer does with the nodes of a shape within its rest.

    Attributes:
        moves: (N,) which nodes it moves.
        linear, apart: (N, 3, 3) and (N, 3) metres: the node at r goes to r + apart.
    """

    moves: Bool
    linear: Float
    apart: Float


def over_base(base: tuple[Float, Float], linear: Float, apart: Float) -> tuple[Float, Float]:
    """Linear maps (N, 3, 3) and positions (N, 3) with a motion within the rest put under them."""
    return base[0] @ linear, base[1] + np.einsum("nij,nj->ni", base[0], apart)


def _layered(base: tuple[Float, Float], over: Sequence[_Within], nodes: Int) -> tuple[Float, Float]:
    """The maps and positions of some nodes, with what was performed over them."""
    for one in over:
        base = over_base(base, one.linear[nodes], one.apart[nodes])
    return base


def _layer_at(project: Project, layer: GraphLayer, count: int, time: float) -> _Within:
    """What a layer does at a time with the ``count`` nodes of its shape."""
    linear, apart = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    moves = np.zeros(count, bool)
    moves[layer.own] = True
    stream = smoothed(project.streams[layer.take], layer.smooth)
    at = layer.moment(time, stream.duration)
    weight = 0.0 if layer.muted else at.weight * layer.weight
    if weight > 0.0:
        maps, places = _recorded(stream, layer.nodes, at.second)
        if at.share > 0.0:
            maps, places = _mixed((maps, places), _recorded(stream, layer.nodes, at.other), at.share)
        flip, axes = _MIRRORED if layer.mirrored else np.ones(3), to_matrix(layer.axes)
        maps = axes @ (maps * flip * flip[:, None]) @ axes.T
        apart[layer.own] = weight * layer.size * ((places - layer.rest[layer.nodes]) * flip) @ axes.T
        linear[layer.own] += weight * (maps - np.eye(3))
    return _Within(moves, linear, apart)


def _played(stream: PoseStream, part: GraphPart, time: float) -> tuple[Float, Float]:
    """(K, 3, 3) and (K, 3) of a part's nodes as recorded; as at its first frame where nothing is played."""
    if part.muted:
        return _recorded(stream, part.nodes, 0.0)
    at = part.moment(time, stream.duration)
    found = _recorded(stream, part.nodes, at.second)
    if at.share > 0.0:
        found = _mixed(found, _recorded(stream, part.nodes, at.other), at.share)
    return found if at.weight == 1.0 else _mixed(_recorded(stream, part.nodes, 0.0), found, at.weight)


def _recorded(stream: PoseStream, nodes: Int, second: float) -> tuple[Float, Float]:
    """The same at a second of the stream."""
    last = len(stream.positions) - 1
    frame = min(second / stream.step, float(last))
    before = min(int(frame), max(last - 1, 0))
    after = min(before + 1, last)
    pairs = (stream.linear, stream.positions)
    one, other = (tuple(rows[k, nodes] for rows in pairs) for k in (before, after))
    return _mixed(one, other, frame - before)


def _mixed(one: tuple[Float, ...], other: tuple[Float, ...], share: float) -> tuple[Float, Float]:
    linear, positions = ((1 - share) * a + share * b for a, b in zip(one, other, strict=True))
    return linear, positions
