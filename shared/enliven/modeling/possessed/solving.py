"""Computes the motion of a possessed mesh from its performers, detects outdated results, and computes them
again.

The stream of a part is a cached result. It has a checksum of its inputs: the mesh, its nodes, the performers'
take, the attachments and the settings. If the whole shape is moved, rotated, scaled or mirrored, the stream
is transformed too, and the checksum stays valid. A cut, a merge or an edit of the mesh makes it invalid.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Float32
from enliven.deformation.graph.graph import DeformationGraph, graph_from_character
from enliven.document import (
    BodyTake,
    Character,
    GraphCharacter,
    GraphPart,
    Pose,
    PoseStream,
    Possession,
    Project,
    SkinWeights,
    are_identical,
    unused,
)
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.possessed.even_steps import stream_at_even_steps
from enliven.possession import replay
from enliven.rotation import to_matrix

_GRID_SIZE_M = 1e-5
"""Grid size in metres to which coordinates are rounded for comparing meshes. Scaling a mesh and back causes
rounding errors of 1e-15."""
_GRID_OFFSET = 0.31830988618
"""Offset of the grid as a fraction of its size. It keeps round numbers away from the boundaries between grid
cells."""


def stale(project: Project, shape: GraphCharacter) -> bool:
    """Returns True if a motion of a shape was computed from inputs that have changed since."""
    return any(
        _motion_checksum(project, shape, n) != how.solved for n, _, how in _find_possessed_parts(shape)
    )


def has_missing_motion(shape: GraphCharacter) -> bool:
    """Returns True if a motion of a shape is missing, for example after its file was damaged."""
    return any(not how.solved for _, _, how in _find_possessed_parts(shape))


def solve_lost(project: Project, progress: Callable[[float], None] | None = None) -> Project:
    """Computes all missing motion of a project. Outdated motion is not changed.

    Raises:
        InputError: if performers cannot attach to any point of a part.
    """
    for name, shape in project.graphs.items():
        if has_missing_motion(shape):
            project = solve_again(project, name, progress)
    return project


def mark_as_solved(project: Project, shape_id: str) -> Project:
    """Marks the streams of a shape as computed from the current inputs."""
    shape, parts = project.graph(shape_id), list(project.graph(shape_id).parts)
    for number, part, how in _find_possessed_parts(shape):
        parts[number] = replace(
            part, possession=replace(how, solved=_motion_checksum(project, shape, number))
        )
    return project.with_characters(shape.with_changes(parts=tuple(parts)))


def with_possession(project: Project, shape_id: str, possession: Possession) -> Project:
    """Replaces the possession of the first part that performers moved. Its motion is then outdated.

    Raises:
        InputError: if the shape does not exist, or performers moved no part of it.
    """
    shape = project.graph(shape_id)
    for number, part, how in _find_possessed_parts(shape):
        new_possession = replace(possession, rest=how.rest, solved=how.solved)
        parts = (*shape.parts[:number], replace(part, possession=new_possession), *shape.parts[number + 1 :])
        return project.with_characters(shape.with_changes(parts=parts))
    raise InputError(
        "no performer has moved a part of this mesh",
        where=shape.where,
        remedy="Choose a mesh that a performer has moved.",
    )


def possess_mesh(
    project: Project,
    mesh: Mesh,
    take: BodyTake,
    possession: Possession,
    *,
    nodes: int = 128,
    progress: Callable[[float], None] | None = None,
    notes: list[str] | None = None,
) -> tuple[Project, str]:
    """Adds a mesh that the performers of a take move, and returns the project and the mesh's id.

    Args:
        mesh: prepared for the stage (:func:`enliven.possession.prepared`).
        possession: the attachments and settings. Its take and its rest pose are replaced by the other
            arguments.
        nodes: number of nodes of the deformation graph.
        progress, notes: as in :func:`solve_again`.

    Raises:
        InputError: if the performers cannot attach to any point of the mesh.
    """
    if take.id in project.bodies and not are_identical(project.bodies[take.id], take):
        take = replace(take, id=unused(take.id, project.bodies))
    graph, name = DeformationGraph.build(mesh, nodes), unused(mesh.name or "mesh", project.characters)
    rest = graph.positions
    rest_motion = np.tile(np.eye(3), (1, len(rest), 1, 1)), rest[None]
    stream = PoseStream(unused(name, project.streams), *rest_motion, 1.0)
    part = GraphPart(
        stream.id, np.arange(len(rest)), possession=replace(possession, take=take.id, rest=rest, solved="")
    )
    shape = GraphCharacter(name, rest, graph.edges, mesh, graph.skin(mesh), (part,))
    project = project.with_bodies(take).with_streams(stream).with_characters(shape)
    return solve_again(project, name, progress, notes), name


def solve_again(
    project: Project,
    shape_id: str,
    progress: Callable[[float], None] | None = None,
    notes: list[str] | None = None,
) -> Project:
    """Computes a shape's outdated motion again from the performers and the current inputs.

    The placement and timing of the shape do not change.

    Args:
        progress: a function that is called with the completed fraction, from 0 to 1.
        notes: a list that receives a sentence about each attachment that failed.

    Raises:
        InputError: if the shape does not exist, or its performers cannot attach to any point of a part.
    """
    shape = project.graph(shape_id)
    due = [
        entry
        for entry in _find_possessed_parts(shape)
        if _motion_checksum(project, shape, entry[0]) != entry[2].solved
    ]
    parts = list(shape.parts)
    for finished_count, (number, part, how) in enumerate(due):
        (bare, rest), take, poses = (
            extract_part_at_rest(shape, number),
            project.bodies[how.take],
            list[Pose](),
        )
        for pose in replay(bare, graph_from_character(bare), take, how, notes):
            poses.append(pose)
            if progress is not None:
                fraction = (pose.time_ns * 1e-9 - how.start) / max(how.last(take) - how.start, 1e-9)
                progress(min((finished_count + fraction) / len(due), 1.0))
        users = [layer for character in project.characters.values() for layer in character.playing]
        is_only_user = sum(layer.take == part.take for layer in users if layer.source == part.source) == 1
        stream = stream_at_even_steps(
            bare, poses, part.take if is_only_user else unused(shape_id, project.streams)
        )
        solved = replace(how, rest=rest, solved=_motion_checksum(project, shape, number))
        parts[number] = replace(part, take=stream.id, nodes=np.arange(len(rest)), possession=solved)
        shape = shape.with_changes(parts=tuple(parts))
        streams = {**project.streams, stream.id: stream}
        characters = {**project.characters, shape_id: shape}
        project = replace(project, streams=streams, characters=characters)
    return project


def _find_possessed_parts(shape: GraphCharacter) -> list[tuple[int, GraphPart, Possession]]:
    """Returns the parts of a shape that performers moved, with their numbers."""
    parts = enumerate(shape.parts)
    return [(n, part, part.possession) for n, part in parts if part.possession is not None]


def extract_part_at_rest(shape: GraphCharacter, number: int) -> tuple[Character, Float]:
    """Returns a part of a shape in the state in which it was possessed: in the rest pose of its recording,
    without the other parts.

    Returns:
        The character, and (K, 3) metres, the positions of its nodes in full precision.
    """
    part, start = shape.parts[number], shape.starts[number]
    assert part.possession is not None
    own_nodes = np.arange(start, start + len(part.nodes))
    flip = np.array([-1.0 if part.mirrored else 1.0, 1.0, 1.0])
    turn = to_matrix(part.axes)
    linear = part.size * turn * flip
    middle = shape.positions[own_nodes].mean(0) - linear @ part.possession.rest[part.nodes].mean(0)

    def back(points: Float) -> Float:
        return np.asarray((points - middle) @ turn / part.size * flip)

    vertices, faces, skin, painted = _part_surface(shape, own_nodes)
    is_own_edge = np.isin(shape.edges, own_nodes).all(1)
    rest, faces = back(shape.positions[own_nodes]), faces[:, ::-1] if part.mirrored else faces
    places = back(vertices).astype(np.float32), rest.astype(np.float32)
    edges = shape.edges[is_own_edge] - np.int32(start)
    bare = Character(shape.id, places[0], faces, skin, places[1], edges, stiffness=painted)
    return bare, rest


def _part_surface(
    shape: GraphCharacter, own_nodes: AnyArray
) -> tuple[Float, AnyArray, SkinWeights, Float32 | None]:
    """Returns vertices (V, 3), faces (F, 3), skin and stiffness (V,) of the surface that mostly follows
    ``own_nodes`` (K,). If no face follows these nodes, all faces are used."""
    mesh, skin = shape.mesh, shape.skin
    if len(own_nodes) == len(shape.positions):
        return mesh.vertices, mesh.faces, skin, mesh.stiffness
    is_own: Bool = np.isin(skin.indices, own_nodes)
    mine = (skin.weights * is_own).sum(1) > 0.5
    faces = mesh.faces[mine[mesh.faces].all(1)]
    faces = faces if len(faces) else mesh.faces
    used = np.unique(faces)
    weights = np.where(is_own, skin.weights, 0.0)[used]
    weights = weights / np.maximum(weights.sum(1, keepdims=True), 1e-9)
    indices = np.where(is_own, skin.indices - own_nodes[0], 0)[used]
    number = np.zeros(len(mesh.vertices), np.int32)
    number[used] = np.arange(len(used))
    own_skin = SkinWeights(indices.astype(np.uint16), weights.astype(np.float32))
    return mesh.vertices[used], number[faces], own_skin, mesh.paint_at(used)[1]


def _motion_checksum(project: Project, shape: GraphCharacter, number: int) -> str:
    """Returns a checksum of all inputs of a part's motion."""
    part = shape.parts[number]
    assert part.possession is not None
    (bare, _), digest = extract_part_at_rest(shape, number), hashlib.blake2b(digest_size=16)
    for points in (bare.vertices, bare.pivots):
        digest.update(
            np.floor(points.astype(np.float64) / _GRID_SIZE_M + _GRID_OFFSET).astype(np.int64).tobytes()
        )
    for numbers in (bare.faces, bare.edges, bare.skin.indices):
        digest.update(np.ascontiguousarray(numbers, np.int64).tobytes())
    if bare.stiffness is not None:
        digest.update(bare.stiffness.tobytes())
    take: BodyTake = project.bodies[part.possession.take]
    for array in (take.seconds, take.people, take.joints, take.confidence, take.present, take.stature):
        digest.update(b"" if array is None else np.ascontiguousarray(array).tobytes())
    how = part.possession
    digest.update(
        repr((how.holds, how.settings, how.height, how.size, how.place, how.start, how.end)).encode()
    )
    return digest.hexdigest()
