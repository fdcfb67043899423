"""Evaluates the nodes and the vertices of a graph shape at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import GraphCharacter, GraphLayer, GraphPart, Pose, PoseStream, Project, smooth_take
from enliven.errors import InputError
from enliven.modeling.mesh.meshes import blend_vertices
from enliven.rotation import conjugate, from_matrix, multiply, rotate, to_matrix

_MIRROR_SIGNS = np.array([-1.0, 1.0, 1.0])
"""The diagonal of the reflection in the plane x = 0."""


def graph_pose(project: Project, shape: GraphCharacter, time: float) -> tuple[Float, Float]:
    """Returns the linear maps (N, 3, 3) and the positions (N, 3) in metres of the nodes of a shape.

    Both are interpolated linearly between frames. A part with a ride follows its carrier rigidly (see
    :class:`enliven.document.Ride`). Layers on top deform the rest pose (see
    :class:`enliven.document.GraphLayer`).

    Raises:
        InputError: if the time is not finite.
    """
    if not np.isfinite(time):
        raise InputError(
            f"the time {time} is not a finite number",
            where=shape.where,
            remedy="Pass a finite number of seconds.",
        )
    linear, positions = np.empty((len(shape.positions), 3, 3)), np.empty((len(shape.positions), 3))
    over = [_layer_at(project, layer, len(shape.positions), time) for layer in shape.over]
    for part, start in zip(shape.parts, shape.starts, strict=False):
        maps, places = _part_maps_at(smooth_take(project.streams[part.take], part.smooth), part, time)
        if part.mirrored:
            maps, places = maps * _MIRROR_SIGNS * _MIRROR_SIGNS[:, None], places * _MIRROR_SIGNS
        places = part.size * places
        turn, move = part.turn, part.place
        rows = slice(start, start + len(part.nodes))
        if part.ride is not None:
            # Layers that move this part must not also move the part that carries it. So the carrier is
            # evaluated without these layers.
            carriers = [layer for layer in over if not layer.moves[rows].any()]
            node = np.array([part.ride.node])
            carrier = _apply_layers((linear[node], positions[node]), carriers, node)
            carry = multiply(from_matrix(carrier[0][0]), conjugate(part.ride.turn))
            move = rotate(carry, move - part.ride.place) + carrier[1][0]
            turn = multiply(carry, turn)
        linear[rows] = to_matrix(turn) @ maps @ to_matrix(conjugate(part.axes))
        positions[rows] = rotate(turn, places) + move
    return _apply_layers((linear, positions), over, np.arange(len(positions)))


def evaluate_layer(
    project: Project, shape: GraphCharacter, number: int, node: int, time: float
) -> tuple[Float, Float, float]:
    """Evaluates a layer on top of a shape at a time, for one of the shape's nodes.

    Args:
        number: index of the layer among the layers on top.

    Returns:
        (3, 3) the map from a displacement at rest, as the layer gives it, to the node's displacement in the
        world; (3,) metres, the node's position; and the weight of the layer.
    """
    layer = shape.over[number]
    outer = shape.with_changes(over=shape.over[:number])
    linear = graph_pose(project, outer, time)[0][node]
    position = graph_pose(project, shape, time)[1][node]
    weight = layer.moment(time, project.length_of(layer)).weight
    return linear, position, 0.0 if layer.muted else layer.weight * weight


def graph_vertices(shape: GraphCharacter, linear: Float, positions: Float) -> Float:
    """Returns the vertices (V, 3) in metres for nodes with linear maps (N, 3, 3) at positions (N, 3)."""
    return blend_vertices(shape.mesh.vertices, shape.skin, shape.positions, linear, positions)


def pose_of_graph(project: Project, shape: GraphCharacter, time: float) -> Pose:
    """Returns the pose of a graph shape for the network and the viewer."""
    linear, positions = graph_pose(project, shape, time)
    return Pose(shape.id, round(time * 1e9), linear.astype(np.float32), positions.astype(np.float32))


@dataclass(frozen=True)
class _LayerMotion:
    """The motion that one layer adds to the nodes of a shape in the rest pose.

    Attributes:
        moves: (N,) True for nodes that the layer moves.
        linear, apart: (N, 3, 3) linear maps, and (N, 3) metres, displacements: a node moves from r to r +
            apart.
    """

    moves: Bool
    linear: Float
    apart: Float


def compose_with_base(base: tuple[Float, Float], linear: Float, apart: Float) -> tuple[Float, Float]:
    """Returns the composition of two motions of N nodes: first the motion of the rest pose by ``linear`` (N,
    3, 3) and ``apart`` (N, 3), then the motion ``base`` (maps and positions)."""
    return base[0] @ linear, base[1] + np.einsum("nij,nj->ni", base[0], apart)


def _apply_layers(base: tuple[Float, Float], over: Sequence[_LayerMotion], nodes: Int) -> tuple[Float, Float]:
    """Returns the maps (K, 3, 3) and positions (K, 3) of ``nodes`` (K,) with the layers on top applied."""
    for layer in over:
        base = compose_with_base(base, layer.linear[nodes], layer.apart[nodes])
    return base


def _layer_at(project: Project, layer: GraphLayer, count: int, time: float) -> _LayerMotion:
    """Evaluates a layer at a time for the ``count`` nodes of its shape."""
    linear, offsets = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    moves = np.zeros(count, bool)
    moves[layer.own] = True
    stream = smooth_take(project.streams[layer.take], layer.smooth)
    second = layer.moment(time, stream.duration)
    weight = 0.0 if layer.muted else second.weight * layer.weight
    if weight > 0.0:
        maps, places = _compute_recorded_maps_at(stream, layer.nodes, second.second)
        if second.share > 0.0:
            maps, places = _interpolate_maps(
                (maps, places), _compute_recorded_maps_at(stream, layer.nodes, second.other), second.share
            )
        flip, axes = _MIRROR_SIGNS if layer.mirrored else np.ones(3), to_matrix(layer.axes)
        maps = axes @ (maps * flip * flip[:, None]) @ axes.T
        offsets[layer.own] = weight * layer.size * ((places - layer.rest[layer.nodes]) * flip) @ axes.T
        linear[layer.own] += weight * (maps - np.eye(3))
    return _LayerMotion(moves, linear, offsets)


def _part_maps_at(stream: PoseStream, part: GraphPart, time: float) -> tuple[Float, Float]:
    """Returns the recorded linear maps (K, 3, 3) and positions (K, 3) of a part's nodes at a time. For a
    muted part they are taken from its first frame.
    """
    if part.muted:
        return _compute_recorded_maps_at(stream, part.nodes, 0.0)
    second = part.moment(time, stream.duration)
    recorded = _compute_recorded_maps_at(stream, part.nodes, second.second)
    if second.share > 0.0:
        recorded = _interpolate_maps(
            recorded, _compute_recorded_maps_at(stream, part.nodes, second.other), second.share
        )
    return (
        recorded
        if second.weight == 1.0
        else _interpolate_maps(_compute_recorded_maps_at(stream, part.nodes, 0.0), recorded, second.weight)
    )


def _compute_recorded_maps_at(stream: PoseStream, nodes: Int, second: float) -> tuple[Float, Float]:
    """Returns the recorded maps (K, 3, 3) and positions (K, 3) of ``nodes`` (K,), at the time ``second`` of
    the stream."""
    last = len(stream.positions) - 1
    frame = min(second / stream.step, float(last))
    previous = min(int(frame), max(last - 1, 0))
    after = min(previous + 1, last)
    pairs = (stream.linear, stream.positions)
    earlier, later = (tuple(rows[k, nodes] for rows in pairs) for k in (previous, after))
    return _interpolate_maps(earlier, later, frame - previous)


def _interpolate_maps(
    one: tuple[Float, ...], other: tuple[Float, ...], fraction: float
) -> tuple[Float, Float]:
    linear, positions = ((1 - fraction) * a + fraction * b for a, b in zip(one, other, strict=True))
    return linear, positions
