"""Finds a person's skeleton in a mesh, or the nearest equivalent in a mesh that is not human-like."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph import DeformationGraph, limb_ends
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.possession.likeness.any_mesh import body_from_extremities
from enliven.possession.likeness.five_ends import find_five_ends, five_ends_from_points
from enliven.possession.likeness.human import human_from_ends
from enliven.possession.likeness.skeleton import BodyInMesh

_NODE_COUNT = 500
"""Number of nodes of the net. On a person their spacing is 6 cm, and parts within half of it are merged."""
_MAX_PERSON_COST = 70.0
"""Cost of five ends above which a mesh is not a person: twice the cost of a man with a large belly."""
_MAX_FLOOR_HEIGHT = 0.15
"""Fraction of the height below which a hand is on the floor. An animal on four feet is not a person."""


def find_person_in_mesh(mesh: Mesh, ends: Float | None = None) -> BodyInMesh | None:
    """Returns the skeleton of a person in an upright mesh that is built as a person is; None for any other
    mesh.

    Args:
        ends: (5, 3) metres, the ends of head, left and right hand, left and right foot, if they are known.
            None or an empty array searches for them.

    Raises:
        InputError: if the number of ends is not five, or the mesh has no area.
    """
    if ends is not None and len(ends):
        if np.shape(ends) != (5, 3):
            mend = "Name head, left hand, right hand, left foot and right foot, in this order, or none."
            problem = f"there are {len(ends)} ends, expected 5"
            raise InputError(problem, where=f"the mesh {mesh.name!r}", mend=mend)
        extremities = limb_ends(mesh, nodes=_NODE_COUNT)
        return human_from_ends(extremities, five_ends_from_points(extremities, np.asarray(ends, np.float64)))
    extremities = limb_ends(mesh, nodes=_NODE_COUNT)
    best = find_five_ends(extremities, _MAX_PERSON_COST)
    if best is None:
        return None
    low, high = mesh.bounds
    if best.points[1:3, 1].max() < low[1] + _MAX_FLOOR_HEIGHT * (high[1] - low[1]):
        return None
    return human_from_ends(extremities, best)


def find_body_in_mesh(mesh: Mesh, graph: DeformationGraph, ends: Float | None = None) -> BodyInMesh:
    """Returns the skeleton of a person in an upright mesh, or of the parts that resemble one most.

    Args:
        graph: of the mesh.
        ends: as in :func:`find_person_in_mesh`.

    Raises:
        InputError: if the number of ends is not five, or the mesh has no area.
    """
    return find_person_in_mesh(mesh, ends) or body_from_extremities(graph)
