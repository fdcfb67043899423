"""Symmetric control points: finds the mirror image of a vertex, of a control point, and of positions."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, Plane
from enliven.examples.symmetric import reflect_points
from enliven_viewer.studio.puppets.mesh_cache import build_vertex_tree, find_mesh_plane, measure_mesh

_MIRROR_TOLERANCE = 0.05
"""Maximum error of a mirror image, as a fraction of the mesh's size."""


def find_plane(puppet: ExampleCharacter) -> Plane | None:
    """Returns the plane of symmetry of the puppet, otherwise that of its mesh, or None if there is none."""
    return puppet.symmetry if puppet.symmetry is not None else find_mesh_plane(puppet.mesh)


def find_partner_vertex(puppet: ExampleCharacter, vertex: int) -> int | None:
    """Returns the vertex nearest to a vertex's mirror image, or None. For a vertex near the plane, returns
    the vertex itself.
    """
    plane = find_plane(puppet)
    if plane is None:
        return None
    (tree, used), max_error = build_vertex_tree(puppet.mesh), _MIRROR_TOLERANCE * measure_mesh(puppet.mesh)
    image = _mirror_point(puppet.mesh.vertices[vertex], plane)
    if np.linalg.norm(image - puppet.mesh.vertices[vertex]) <= max_error:
        return vertex
    distances, nearest = tree.query(image)
    return int(used[nearest]) if distances <= max_error else None


def find_partner_point(puppet: ExampleCharacter, point: int) -> int | None:
    """Returns the mirror point of a control point, or None. For a point on the plane, returns the point
    itself.
    """
    plane = find_plane(puppet)
    if plane is None:
        return None
    distances = np.linalg.norm(puppet.rest - _mirror_point(puppet.rest[point], plane), axis=1)
    nearest = int(distances.argmin())
    return nearest if distances[nearest] <= _MIRROR_TOLERANCE * measure_mesh(puppet.mesh) else None


def mirror_places(puppet: ExampleCharacter, places: Float, point: int) -> Float:
    """Returns (P, 3) positions in which the movement of ``point`` is mirrored to its mirror point. Movements
    are measured from the rest positions. A control point on the plane moves only within the plane.
    """
    plane, other = find_plane(puppet), find_partner_point(puppet, point)
    if plane is None or other is None:
        return places
    new_places, movement = np.array(places), places[point] - puppet.rest[point]
    mirrored = reflect_points(movement, np.zeros(3), np.asarray(plane.normal))
    new_places[other] = puppet.rest[other] + ((mirrored + movement) / 2 if other == point else mirrored)
    return new_places


def _mirror_point(place: Float, plane: Plane) -> Float:
    return reflect_points(place, np.asarray(plane.point), np.asarray(plane.normal))
