"""Converts the joints of a glTF file to rigid bodies. A body has a rest position, a motion over time, and a
part of the surface that it moves.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.formats.rig.rig_links import LinkBody
from enliven.meshes.gltf.parts import GltfPart
from enliven.meshes.gltf.surface import GltfSurface
from enliven.rotation import from_matrix, hencky_strain

_MAX_ROUNDING_STRETCH = 1e-4
"""Maximum deviation of a joint's stretch from 1 that counts as a rounding error. A larger deviation is a
scale animation."""


def measure_bodies(surface: GltfSurface, chosen: list[int], world: Float) -> list[LinkBody]:
    """Measures the rest position, motion and surface of each joint, and returns a body for each.

    Args:
        surface: the surface of the file, with its bind pose.
        chosen: the nodes that are joints.
        world: (F, n, 4, 4) transforms from node to world in the frames of all animations.
    """
    file, bind = surface.file, surface.bind
    number = {node: k for k, node in enumerate(chosen)}
    bodies = list[LinkBody]()
    for node in chosen:
        from_bind = world[:, node] @ np.linalg.inv(bind.world[node])
        mirrors = np.where(np.linalg.det(from_bind[:, :3, :3]) < 0, -1.0, 1.0)
        from_bind[:, :3, :3] *= mirrors[:, None, None]
        turns = from_matrix(from_bind[:, :3, :3]) if len(from_bind) else np.zeros((0, 4))
        is_scaled = _compute_largest_stretch(from_bind[:, :3, :3]) > _MAX_ROUNDING_STRETCH
        strains = hencky_strain(from_bind[:, :3, :3], turns) if is_scaled else None
        ancestor = file.parents[node]
        while ancestor >= 0 and ancestor not in number:
            ancestor = file.parents[ancestor]
        leaves = [
            (file.name(child), bind.world[child][:3, 3])
            for child in file.document.nodes[node].children or []
            if child not in number and file.document.nodes[child].mesh is None
        ]
        body = LinkBody(
            file.name(node), number.get(ancestor, -1), bind.world[node][:3, 3], turns, world[:, node, :3, 3]
        )
        body.leaves, body.strains = leaves, strains
        body.mirrors = mirrors if (mirrors < 0).any() else None
        bodies.append(body)
    _measure_bodies(bodies, number, surface.parts, surface.rest)
    return bodies


def _compute_largest_stretch(linear: Float) -> float:
    """Returns the largest stretch of linear maps (F, 3, 3) minus 1, which is 0 for rotations."""
    if not len(linear):
        return 0.0
    return float(np.abs(np.linalg.svd(linear, compute_uv=False) - 1.0).max())


def _measure_bodies(
    bodies: list[LinkBody], number: dict[int, int], parts: list[GltfPart], rest: list[Float]
) -> None:
    """Computes the area of the surface that each body moves, and the far end of this surface. Stores both in
    the bodies."""
    vertices = np.concatenate(rest)
    nodes = np.concatenate([part.nodes for part in parts])
    weights = np.concatenate([part.weights for part in parts])
    area = np.concatenate(
        [_vertex_areas(part, part_vertices) for part, part_vertices in zip(parts, rest, strict=True)]
    )
    for node, k in number.items():
        node_weight = np.where(nodes == node, weights, 0.0).sum(1)
        bodies[k].mass = float(node_weight @ area)
        body_vertices = (
            vertices[node_weight > 0.5] if (node_weight > 0.5).any() else vertices[node_weight > 0]
        )
        if len(body_vertices):
            bodies[k].reach = _find_far_end(bodies[k].rest, body_vertices)


def _vertex_areas(part: GltfPart, vertices: Float) -> Float:
    """Returns the area (V,) of each vertex in m^2, which is a third of the area of its faces and always above
    zero.
    """
    a, b, c = (vertices[part.faces[:, k]] for k in range(3))
    third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
    return np.asarray(np.bincount(part.faces.ravel(), np.repeat(third, 3), len(vertices)) + 1e-12, np.float64)


def _find_far_end(start: Float, vertices: Float) -> Float:
    """Returns the end (3,) of a bone that leads from ``start`` through the middle of its vertices.

    The bone is as long as the extent of the vertices in this direction.
    """
    to_centre = (vertices.min(0) + vertices.max(0)) / 2 - start
    length = float(np.linalg.norm(to_centre))
    if length < 1e-9:
        return start
    direction = to_centre / length
    return np.asarray(start + direction * max(float(((vertices - start) @ direction).max()), 0.0))
