"""Symmetric control points: the mirror image of a vertex, of a control point, and of positions."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Plane, Puppet
from enliven.examples import reflect_points
from enliven_viewer.studio.puppets.mesh_cache import plane_of, size_of, tree_of

_MIRROR_TOLERANCE = 0.05
"""Maximum error of a mirror image, as a fraction of the mesh's size."""


def plane_for(puppet: Puppet) -> Plane | None:
    """Returns the puppet's own plane of symmetry, or else that of its mesh; None if there is none."""
    return puppet.symmetry if puppet.symmetry is not None else plane_of(puppet.mesh)


def partner_vertex(puppet: Puppet, vertex: int) -> int | None:
    """Returns the vertex nearest to a vertex's mirror image, or None.

    Near the plane it is the vertex itself.
    """
    plane = plane_for(puppet)
    if plane is None:
        return None
    (tree, used), most = tree_of(puppet.mesh), _MIRROR_TOLERANCE * size_of(puppet.mesh)
    image = _image(puppet.mesh.vertices[vertex], plane)
    if np.linalg.norm(image - puppet.mesh.vertices[vertex]) <= most:
        return vertex
    away, nearest = tree.query(image)
    return int(used[nearest]) if away <= most else None


def partner_point(puppet: Puppet, point: int) -> int | None:
    """Returns the control point that mirrors another one, or None. On the plane it is the point itself."""
    plane = plane_for(puppet)
    if plane is None:
        return None
    away = np.linalg.norm(puppet.rest - _image(puppet.rest[point], plane), axis=1)
    nearest = int(away.argmin())
    return nearest if away[nearest] <= _MIRROR_TOLERANCE * size_of(puppet.mesh) else None


def mirrored_places(puppet: Puppet, places: Float, point: int) -> Float:
    """Returns (P, 3) positions with the movement of ``point`` mirrored to its partner.

    Movements are measured from the rest positions.

    A control point that is its own partner moves only within the plane.
    """
    plane, other = plane_for(puppet), partner_point(puppet, point)
    if plane is None or other is None:
        return places
    new_places, way = np.array(places), places[point] - puppet.rest[point]
    mirrored = reflect_points(way, np.zeros(3), np.asarray(plane.normal))
    new_places[other] = puppet.rest[other] + ((mirrored + way) / 2 if other == point else mirrored)
    return new_places


def _image(place: Float, plane: Plane) -> Float:
    return reflect_points(place, np.asarray(plane.point), np.asarray(plane.normal))
