"""Reads the surfaces of a glTF file: each primitive with the nodes that its vertices follow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float, Int, Int32, UInt8
from enliven.meshes.gltf.colours import Colours
from enliven.meshes.gltf.extensions import INSTANCING
from enliven.meshes.gltf.file import GltfFile, compose_matrices
from enliven.meshes.gltf.gltf_json import MAX_ELEMENTS
from enliven.meshes.gltf.materials import Corners, Materials
from enliven.meshes.gltf.motion import zero_scale_nodes

_MODE_TRIANGLES = 4
"""glTF's mode of a list of separate triangles (section 3.7.2.1). Points and lines are left out."""
_MODE_STRIP = 5
"""glTF's mode of a triangle strip: each vertex after the second forms a triangle with the two vertices before
it."""
_MODE_FAN = 6
"""glTF's mode of a triangle fan: each vertex after the second forms a triangle with the vertex before it and
the first vertex."""
_INSTANCE_COLUMNS = {
    "TRANSLATION": [0.0, 0.0, 0.0],
    "ROTATION": [0.0, 0.0, 0.0, 1.0],
    "SCALE": [1.0, 1.0, 1.0],
}
"""The columns of a table of instances, with the default value of a missing column."""


@dataclass
class GltfPart:
    """A primitive of a mesh, with values as in the file.

    Attributes:
        vertices: (V, 3) in the mesh's own space.
        faces: (F, 3) vertex numbers.
        nodes: (V, 4) the nodes that each vertex follows, the strongest first.
        weights: (V, 4) float64, each row sums to one.
        colours: (V, 3) sRGB, or None if the file has no colour.
        skin: the number of its skin. -1 if the primitive is rigidly attached to the node ``carrier``.
        carrier: the node in the file that contains the mesh.
        material: the number of its material among the stored materials, or -1.
        corners: texture coordinates and colours of its vertices.
    """

    vertices: Float
    faces: Int32
    nodes: Int
    weights: Float
    colours: UInt8 | None
    skin: int
    carrier: int
    material: int
    corners: Corners


def read_parts(file: GltfFile, notes: list[str]) -> tuple[list[GltfPart], Materials]:
    """Returns all visible primitives with triangles of the scene, and their materials.

    Args:
        notes: receives a sentence about each primitive that is left out.
    """
    colours, materials, parts = Colours(file), Materials(file), list[GltfPart]()
    notes.extend(file.notes)
    zero_nodes, hidden = zero_scale_nodes(file), file.hidden
    for number in find_visible_nodes(file):
        node = file.document.nodes[number]
        if node.mesh is None:
            continue
        if number in hidden or (number in zero_nodes and node.skin is None):
            reason = "hidden by the file" if number in hidden else "always scaled to size 0"
            notes.append(f"the node {file.name(number)!r} is ignored, because it is {reason}")
            continue
        for primitive in file.document.meshes[node.mesh].primitives:
            mode = _MODE_TRIANGLES if primitive.mode is None else primitive.mode
            if mode not in (_MODE_TRIANGLES, _MODE_STRIP, _MODE_FAN) or primitive.attributes.POSITION is None:
                notes.append(f"the lines or points of the node {file.name(number)!r} are ignored")
                continue
            if primitive.targets:
                notes.append(f"the morph targets of the node {file.name(number)!r} are not animated")
            parts.append(_read_part(file, colours, materials, primitive, mode, number))
    notes.extend(colours.notes + materials.notes)
    return [part for part in parts if len(part.faces)], materials


def find_visible_nodes(file: GltfFile) -> list[int]:
    """Returns the visible nodes of the default scene, parents first. If the file has no default scene,
    returns the nodes of the whole file.
    """
    document = file.document
    if document.scenes:
        number = document.scene or 0
        roots = list(document.scenes[number if number < len(document.scenes) else 0].nodes or [])
    else:
        roots = [n for n, parent in enumerate(file.parents) if parent < 0]
    return _nodes_with_subtrees(file, roots)


def find_moving_nodes(file: GltfFile, parts: list[GltfPart]) -> list[int]:
    """Returns the visible nodes of the scene, and then the nodes of joint trees outside of the scene. Parents
    come before their children.
    """
    shown = find_visible_nodes(file)
    listed, roots = set(shown), list[int]()
    for skin in dict.fromkeys(part.skin for part in parts if part.skin >= 0):
        for node in file.document.skins[skin].joints:
            while node not in listed and file.parents[node] >= 0:
                node = file.parents[node]
            if node not in listed:
                listed.add(node)
                roots.append(node)
    return shown + _nodes_with_subtrees(file, roots)


def _nodes_with_subtrees(file: GltfFile, roots: list[int]) -> list[int]:
    """Returns the nodes ``roots`` and all their descendants, parents first."""
    document = file.document
    nodes, waiting = list[int](), roots[::-1]
    while waiting:
        node = waiting.pop()
        nodes.append(node)
        waiting.extend(reversed(document.nodes[node].children or []))
    return nodes


def _read_part(
    file: GltfFile, colours: Colours, materials: Materials, primitive: Any, mode: int, carrier: int
) -> GltfPart:
    node = file.document.nodes[carrier]
    file.decompress(primitive)
    vertices = np.asarray(file.accessor(primitive.attributes.POSITION), np.float64)
    if vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise file.create_error(
            f"a vertex position of the node {file.name(carrier)!r} is not finite or not 3D"
        )
    vertices = _apply_morphs(file, vertices, primitive, node)
    if primitive.indices is None:
        order = np.arange(len(vertices))
    else:
        order = file.accessor(primitive.indices)[:, 0].astype(np.int64)
    if len(order) and order.max() >= len(vertices):
        raise file.create_error(
            f"a face of the node {file.name(carrier)!r} refers to vertex {order.max()}, but only "
            f"{len(vertices)} vertices exist"
        )
    faces = _list_triangles(order, mode)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]
    joints, weights = _joint_influences(file, primitive.attributes, len(vertices))
    if node.skin is None or joints is None or weights is None:
        joints = np.full((len(vertices), 1), carrier)
        weights, skin = np.ones((len(vertices), 1)), -1
    else:
        skin = int(node.skin)
        skin_joints = np.array(file.document.skins[skin].joints, np.int64)
        if len(joints) and joints[weights > 0].max(initial=0) >= len(skin_joints):
            raise file.create_error(
                f"a vertex of the node {file.name(carrier)!r} refers to joint {joints.max()}, but the "
                f"skin has only {len(skin_joints)} joints"
            )
        joints = skin_joints[np.minimum(joints, len(skin_joints) - 1)]
    four, four_weights = find_strongest_influences(joints, weights)
    corners = materials.corners(primitive, len(vertices))
    other_values = (
        colours.compute_vertex_colours(primitive),
        skin,
        carrier,
        materials.number(primitive),
        corners,
    )
    part = GltfPart(vertices, faces.astype(np.int32), four, four_weights, *other_values)
    table = getattr(getattr(node.extensions, INSTANCING, None), "attributes", None)
    if table is None:
        return part
    return instance_part(part, instance_transforms(file, vars(table), max(len(vertices), len(order))))


def _apply_morphs(file: GltfFile, vertices: Float, primitive: Any, node: Any) -> Float:
    """Applies the morph targets that are active in the rest pose. Returns (V, 3) vertices."""
    weights = node.weights or file.document.meshes[node.mesh].weights or []
    for weight, target in zip(weights, primitive.targets or [], strict=False):
        if weight and target.POSITION is not None:
            offsets = np.asarray(file.accessor(target.POSITION), np.float64)
            if offsets.shape != vertices.shape or not np.isfinite(weight * offsets).all():
                raise file.create_error(
                    f"a morph target of mesh {node.mesh} does not match the vertices of the mesh"
                )
            vertices = vertices + weight * offsets
    return vertices


def instance_transforms(file: GltfFile, table: dict[str, int], size: int) -> Float:
    """Returns the transforms (K, 4, 4) node_from_mesh of the instances in the instancing table of a node.

    Raises:
        InputError: if the columns differ in length or are not finite, or if all instances together (``size``
            vertices or corners each) exceed the reader's limits.
    """
    accessors = file.document.accessors
    max_instances = max(
        (accessors[accessor].count for name, accessor in table.items() if name in _INSTANCE_COLUMNS),
        default=1,
    )
    if max_instances * max(size, 1) > MAX_ELEMENTS:
        raise file.create_error(
            f"the file has too many instances: {max_instances} of a mesh with {size} vertices or corners"
        )
    columns = {
        name: np.asarray(file.accessor(accessor), np.float64)
        for name, accessor in table.items()
        if name in _INSTANCE_COLUMNS
    }
    count = max((len(values) for values in columns.values()), default=1)
    filled = [columns.get(name, np.tile(usual, (count, 1))) for name, usual in _INSTANCE_COLUMNS.items()]
    fits = all(
        column.shape == (count, len(usual))
        for column, usual in zip(filled, _INSTANCE_COLUMNS.values(), strict=True)
    )
    if not fits or not all(np.isfinite(values).all() for values in filled):
        raise file.create_error("the columns of an instance table have different lengths or invalid values")
    length = np.linalg.norm(filled[1], axis=1, keepdims=True)
    filled[1] = np.where(length > 0.0, filled[1] / np.where(length > 0.0, length, 1.0), [0.0, 0.0, 0.0, 1.0])
    return compose_matrices(*filled)


def instance_part(part: GltfPart, transforms: Float) -> GltfPart:
    """Returns a part that contains one transformed copy for each of the transforms (K, 4, 4). Faces of
    mirrored copies are flipped.
    """
    count, size = len(transforms), len(part.vertices)
    transformed = np.einsum("kab,vb->kva", transforms[:, :3, :3], part.vertices) + transforms[:, None, :3, 3]
    mirrored = np.linalg.det(transforms[:, :3, :3]) < 0
    faces = [
        (part.faces[:, ::-1] if is_mirrored else part.faces) + number * size
        for number, is_mirrored in enumerate(mirrored)
    ]

    def again(values: AnyArray) -> AnyArray:
        return np.tile(values, (count, *(1,) * (values.ndim - 1)))

    uvs, tints = part.corners
    return replace(
        part,
        vertices=transformed.reshape(-1, 3),
        faces=np.concatenate([part.faces[:0], *faces]).astype(np.int32),
        nodes=again(part.nodes),
        weights=again(part.weights),
        colours=None if part.colours is None else again(part.colours),
        corners=(again(uvs), None if tints is None else again(tints)),
    )


def _joint_influences(file: GltfFile, attributes: Any, count: int) -> tuple[Int | None, Float | None]:
    """Combines the attributes JOINTS_0, JOINTS_1, ... and their weights. Returns (V, 4k) joint numbers in the
    skin, and (V, 4k) weights.
    """
    joints, weights = [], []
    for k in range(8):
        joint_accessor, weight_accessor = (
            getattr(attributes, f"JOINTS_{k}", None),
            getattr(attributes, f"WEIGHTS_{k}", None),
        )
        if joint_accessor is None or weight_accessor is None:
            break
        joints.append(file.accessor(joint_accessor).astype(np.int64))
        weights.append(np.asarray(file.accessor(weight_accessor), np.float64))
    if not joints:
        return None, None
    return np.concatenate(joints, 1), np.nan_to_num(np.maximum(np.concatenate(weights, 1), 0.0))


def find_strongest_influences(joints: Int, weights: Float) -> tuple[Int, Float]:
    """Returns (V, 4) joints and (V, 4) weights: the four largest of each vertex, with a sum of one.

    Repeated joints are merged.

    A vertex without any weight follows its first joint.
    """
    count, width = joints.shape
    joints, weights = joints.copy(), weights.copy()
    for b in range(1, width):
        for a in range(b):
            is_repeated = joints[:, a] == joints[:, b]
            weights[is_repeated, a] += weights[is_repeated, b]
            weights[is_repeated, b] = 0.0
    order = np.argsort(-weights, 1, kind="stable")[:, :4]
    four, strongest_weights = np.take_along_axis(joints, order, 1), np.take_along_axis(weights, order, 1)
    if width < 4:
        four = np.concatenate([four, np.repeat(four[:, :1], 4 - width, 1)], 1)
        strongest_weights = np.concatenate([strongest_weights, np.zeros((count, 4 - width))], 1)
    total = strongest_weights.sum(1, keepdims=True)
    strongest_weights = np.where(
        total > 0, strongest_weights / np.where(total > 0, total, 1.0), [[1.0, 0.0, 0.0, 0.0]]
    )
    return np.where(strongest_weights > 0, four, four[:, :1]), strongest_weights


def _list_triangles(order: Int, mode: int) -> Int:
    """Converts a triangle list, strip or fan to (F, 3) triangles (glTF 2.0, section 3.7.2.1)."""
    if mode == _MODE_TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    if len(order) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == _MODE_FAN:
        return np.stack([order[1:-1], order[2:], np.full(len(order) - 2, order[0])], 1)
    faces = np.stack([order[:-2], order[1:-1], order[2:]], 1)
    faces[1::2] = faces[1::2, [0, 2, 1]]
    return faces
