"""Cuts and merges possessed meshes: both the deformation graph and its motion.

A cut or merge changes the set of nodes and the nodes that carry other parts, but never the recorded streams.
So no motion is lost: if a possessed chair is cut in two, both halves still walk.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import GraphCharacter, GraphLayer, GraphPart, Project, Ride, SkinWeights, unused
from enliven.errors import InputError
from enliven.modeling.mesh.cut_pieces import Piece
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.mesh.joining import SkinnedSurface, join_surfaces
from enliven.modeling.mesh.mesh_cut import cut_by_stroke
from enliven.modeling.mesh.seam import smooth_seam
from enliven.modeling.possessed.pose import graph_pose, graph_vertices
from enliven.modeling.rig import Merge
from enliven.rotation import conjugate, from_matrix, multiply, normalized, rotate, to_matrix


def cut_graph(
    project: Project, shape_id: str, stroke: CutSurface, time: float, *, notes: list[str] | None = None
) -> tuple[Project, tuple[str, str]]:
    """Cuts a possessed mesh in two along a stroke, in its pose at ``time``. Both parts keep moving.

    Each side keeps the nodes that its vertices follow. Nodes near the cut are kept on both sides. So every
    node and vertex keeps its position at every time, not only at ``time``.

    Args:
        stroke: a ``StrokeCut`` or ``PlaneCut`` in world metres.
        notes: a list that receives sentences about the closing of the mesh.

    Returns:
        The project, and the ids of both sides. The larger side keeps ``shape_id``, and the other side gets a
            new id. If both have the same size, the near side keeps it.

    Raises:
        InputError: if the shape does not exist, or the stroke cuts nothing off.
    """
    shape = project.graph(shape_id)
    posed = graph_vertices(shape, *graph_pose(project, shape, time))
    cut = cut_by_stroke(shape.mesh, shape.skin, stroke, posed)
    off_id = unused(shape_id, project.characters)
    larger, smaller = cut.larger_first
    if notes is not None:
        notes.extend(cut.notes)
    sides = _cut_side(shape, larger, shape_id), _cut_side(shape, smaller, off_id)
    return project.with_characters(*sides), (shape_id, off_id)


def merge_graphs(project: Project, merge: Merge) -> Project:
    """Merges two possessed meshes in their poses at a time: attaches the graft to the host.

    At that time, both keep their positions. At other times, the graft rigidly follows a node of the host,
    with its own motion on top. The meshes are united in their poses at that time. The graft's rest pose is
    aligned with the host's rest pose, so that the two meet at the node as they do at that time. The motion of
    the graft's vertices relative to its nodes does not change.

    Raises:
        InputError: if the node does not exist, or the union of the meshes fails.
    """
    host, graft = project.graph(merge.host), project.graph(merge.graft)
    host_nodes, graft_nodes = graph_pose(project, host, merge.time), graph_pose(project, graft, merge.time)
    node, root = _find_meeting_nodes(host, host_nodes[1], graft_nodes[1], merge.node)
    turn, place = from_matrix(host_nodes[0][node]), host_nodes[1][node]
    axes = multiply(conjugate(turn), from_matrix(graft_nodes[0][root]))
    to = host.positions[node] + rotate(conjugate(turn), graft_nodes[1][root] - place)
    moved = _rotate_rest_pose(graft, normalized(axes), graft.positions[root], to)
    ride, first = Ride(node, turn, place), len(host.positions)
    parts = [_part_of_graft(part, ride, first) for part in moved.parts]
    edges = np.concatenate([host.edges, moved.edges + first, [[node, first + root]]])
    turned = graft_nodes[0] @ to_matrix(conjugate(axes))
    maps = np.concatenate(
        [
            _world_from_rest(host_nodes[0], host_nodes[1], host.positions),
            _world_from_rest(turned, graft_nodes[1], moved.positions),
        ]
    )
    numbers = SkinWeights((graft.skin.indices + first).astype(np.uint16), graft.skin.weights)
    mesh, skin = join_surfaces(
        SkinnedSurface(host.mesh, host.skin, graph_vertices(host, *host_nodes)),
        SkinnedSurface(moved.mesh, numbers, graph_vertices(graft, *graft_nodes)),
        maps,
        lambda mesh, skin, where: (smooth_seam(mesh, where, merge.seam), skin),
        loose=merge.loose,
        notes=merge.notes,
        where=host.where,
    )
    merged = GraphCharacter(
        host.id,
        np.concatenate([host.positions, moved.positions]),
        edges.astype(np.int32),
        mesh,
        skin,
        (*host.parts, *parts),
        (*host.over, *(replace(layer, own=layer.own + first) for layer in moved.over)),
    )
    return project.drop_character(graft.id).with_characters(merged)


def _cut_side(shape: GraphCharacter, piece: Piece, side_id: str) -> GraphCharacter:
    """Returns one side of a cut, with the nodes that its vertices follow and the nodes that carry their
    parts."""
    assert piece.skin is not None
    is_kept = np.zeros(len(shape.positions), bool)
    is_kept[piece.skin.indices[piece.skin.weights > 0]] = True
    for part, start in reversed(list(zip(shape.parts, shape.starts, strict=False))):
        if part.ride is not None and is_kept[start : start + len(part.nodes)].any():
            is_kept[part.ride.node] = True
    number = np.where(is_kept, np.cumsum(is_kept) - 1, 0)
    parts = [
        _part_with(part, is_kept[start:][: len(part.nodes)], number)
        for part, start in _parts_with_starts(shape)
    ]
    edges = shape.edges[is_kept[shape.edges].all(1)]
    return GraphCharacter(
        side_id,
        shape.positions[is_kept],
        number[edges].astype(np.int32),
        piece.mesh,
        SkinWeights(number[piece.skin.indices].astype(np.uint16), piece.skin.weights),
        tuple(part for part in parts if len(part.nodes)),
        tuple(_layer_with(layer, is_kept, number) for layer in shape.over if is_kept[layer.own].any()),
    )


def _parts_with_starts(shape: GraphCharacter) -> list[tuple[GraphPart, int]]:
    """Returns the parts, each with the number of its first node."""
    return list(zip(shape.parts, shape.starts, strict=False))


def _part_with(part: GraphPart, is_kept: Bool, number: Int) -> GraphPart:
    """Returns a part with the nodes for which ``is_kept`` is True, and its ride with the new ``number`` of
    the carrying node."""
    ride = None if part.ride is None else replace(part.ride, node=int(number[part.ride.node]))
    return replace(part, nodes=part.nodes[is_kept], ride=ride)


def _layer_with(layer: GraphLayer, kept: Bool, number: Int) -> GraphLayer:
    """Returns a layer for the subset of its nodes that is kept, with their new numbers."""
    is_kept = kept[layer.own]
    return replace(layer, nodes=layer.nodes[is_kept], own=number[layer.own[is_kept]])


def _find_meeting_nodes(
    host: GraphCharacter, ours: Float, theirs: Float, node: int | str | None
) -> tuple[int, int]:
    """Returns the host's node that carries the graft, and the graft's node nearest to it."""
    distances = np.linalg.norm(ours[:, None] - theirs[None], axis=2)
    if node is None:
        node = int(distances.min(1).argmin())
    if isinstance(node, str) or not 0 <= node < len(ours):
        remedy = "Pass the number of an existing node."
        raise InputError(
            f"node {node} does not exist: the mesh has {len(ours)} nodes, numbered from 0",
            where=host.where,
            remedy=remedy,
        )
    return node, int(distances[node].argmin())


def _rotate_rest_pose(shape: GraphCharacter, axes: Float, root: Float, to: Float) -> GraphCharacter:
    """Rotates the rest pose of a shape by ``axes`` about ``root``, and moves that point to ``to``. The motion
    in the world does not change."""
    positions = to + rotate(axes, shape.positions - root)
    vertices = to + rotate(axes, shape.mesh.vertices - root)
    back = conjugate(axes)
    parts = []
    for part in shape.parts:
        ride = part.ride
        if ride is not None:
            # The map of a node is from the old rest pose to the world. So its rotation at the time of the
            # merge must also contain the change of the rest pose.
            ride = replace(ride, turn=normalized(multiply(ride.turn, back)))
        parts.append(replace(part, axes=normalized(multiply(axes, part.axes)), ride=ride))
    mesh = replace(shape.mesh, vertices=vertices)
    over = tuple(replace(layer, axes=normalized(multiply(axes, layer.axes))) for layer in shape.over)
    return shape.with_changes(positions=positions, mesh=mesh, parts=tuple(parts), over=over)


def _part_of_graft(part: GraphPart, ride: Ride, first: int) -> GraphPart:
    """Returns a part of the graft for the merged shape, in which the numbers of its nodes start at
    ``first``.
    """
    if part.ride is None:
        return replace(part, ride=ride)
    return replace(part, ride=replace(part.ride, node=part.ride.node + first))


def _world_from_rest(linear: Float, positions: Float, rest: Float) -> Float:
    """Returns the affine map (N, 3, 4) of each node from rest to the world, in metres."""
    offset = positions - np.einsum("nab,nb->na", linear, rest)
    return np.concatenate([linear, offset[..., None]], -1)
