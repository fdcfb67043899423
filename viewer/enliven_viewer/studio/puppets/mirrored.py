"""Symmetric control points: which vertex and which control point is the mirror image of another."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Float
from enliven.examples.symmetric import reflected
from enliven.mesh import Mesh
from enliven.modeling.mirror_plane import plane_of_symmetry
from enliven.puppet import Plane, Puppet

_OFF = 0.05
"""Part of the mesh's size that a mirror image may be off."""
_KEPT = 8

_planes: OrderedDict[int, tuple[Mesh, Plane | None]] = OrderedDict()


def plane_for(puppet: Puppet) -> Plane | None:
    """The plane of symmetry that the puppet has, or else its mesh's, found once; None where it has none."""
    if puppet.symmetry is not None:
        return puppet.symmetry
    known = _planes.get(id(puppet.mesh))
    if known is None or known[0] is not puppet.mesh:
        known = (puppet.mesh, plane_of_symmetry(puppet.mesh))
        _planes[id(puppet.mesh)] = known
        while len(_planes) > _KEPT:
            _planes.popitem(last=False)
    return known[1]


def partner_vertex(puppet: Puppet, vertex: int) -> int | None:
    """The vertex nearest to the mirror image of one; None where there is none."""
    plane = plane_for(puppet)
    if plane is None:
        return None
    used = np.unique(puppet.mesh.faces)
    vertices = puppet.mesh.vertices
    away, nearest = cKDTree(vertices[used]).query(_image(vertices[vertex], plane))
    return int(used[nearest]) if away <= _OFF * _size(puppet) else None


def partner_point(puppet: Puppet, point: int) -> int | None:
    """The control point that is the mirror image of one, itself where it is on the plane; None for none."""
    plane = plane_for(puppet)
    if plane is None:
        return None
    away = np.linalg.norm(puppet.rest - _image(puppet.rest[point], plane), axis=1)
    nearest = int(away.argmin())
    return nearest if away[nearest] <= _OFF * _size(puppet) else None


def mirrored_places(puppet: Puppet, places: Float, point: int) -> Float:
    """(P, 3) places, the partner of ``point`` at its mirror image; on the plane it stays on it."""
    plane, other = plane_for(puppet), partner_point(puppet, point)
    if plane is None or other is None:
        return places
    made = np.array(places)
    image = _image(places[point], plane)
    made[other] = (image + places[point]) / 2 if other == point else image
    return made


def _image(place: Float, plane: Plane) -> Float:
    return reflected(place, np.asarray(plane.point), np.asarray(plane.normal))


def _size(puppet: Puppet) -> float:
    return float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
