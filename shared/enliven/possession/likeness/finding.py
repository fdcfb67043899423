"""Finds a person's skeleton in a mesh. If the mesh is not human-like, finds the parts that resemble a
person's limbs most."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.graph import DeformationGraph
from enliven.deformation.graph.surface_ends import find_limb_ends
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.possession.likeness.any_mesh import body_from_extremities
from enliven.possession.likeness.five_ends import find_five_ends, five_ends_from_points
from enliven.possession.likeness.human import human_from_ends
from enliven.possession.likeness.skeleton import BodyInMesh

_NODE_COUNT = 500
"""Number of nodes of the graph for geodesic distances. On a person, their spacing is 6 cm. Mesh parts that
are nearer than half of the spacing are merged."""
_MAX_PERSON_COST = 70.0
"""Maximum cost of the five ends of a person-like mesh. It is twice the cost of a man with a large belly."""
_MAX_FLOOR_HEIGHT = 0.15
"""Maximum height of a hand that counts as on the floor, as a fraction of body height. A mesh with both hands
on the floor is an animal on four feet."""


def find_person_in_mesh(mesh: Mesh, ends: Float | None = None) -> BodyInMesh | None:
    """Finds the skeleton of a person in an upright, human-like mesh. Returns None for any other mesh.

    Args:
        ends: (5, 3) the ends of head, left and right hand, left and right foot, metres, if they are known.
            None or an empty array searches for them.

    Raises:
        InputError: if the number of ends is not five, or the mesh has no area.
    """
    if ends is not None and len(ends):
        if np.shape(ends) != (5, 3):
            advice = "Set head, left hand, right hand, left foot and right foot, in this order, or none."
            problem = f"the number of ends is {len(ends)}, expected 5"
            raise InputError(problem, where=f"the mesh {mesh.name!r}", remedy=advice)
        extremities = find_limb_ends(mesh, nodes=_NODE_COUNT)
        return human_from_ends(extremities, five_ends_from_points(extremities, np.asarray(ends, np.float64)))
    extremities = find_limb_ends(mesh, nodes=_NODE_COUNT)
    best = find_five_ends(extremities, _MAX_PERSON_COST)
    if best is None:
        return None
    low, high = mesh.bounds
    if best.points[1:3, 1].max() < low[1] + _MAX_FLOOR_HEIGHT * (high[1] - low[1]):
        return None
    return human_from_ends(extremities, best)


def find_body_in_mesh(mesh: Mesh, graph: DeformationGraph, ends: Float | None = None) -> BodyInMesh:
    """Finds the skeleton of a person in an upright mesh, or that of the parts that resemble a person most.

    Args:
        graph: deformation graph of the mesh.
        ends: (5, 3) the ends of the limbs, if they are known; see :func:`find_person_in_mesh`.

    Raises:
        InputError: if the number of ends is not five, or the mesh has no area.
    """
    return find_person_in_mesh(mesh, ends) or body_from_extremities(graph)
