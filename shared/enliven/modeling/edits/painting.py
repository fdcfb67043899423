"""Paints stiffness onto a mesh with a brush (the per-node weights of KinÊtre, set by hand)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import scipy

from enliven.arrays import Float, Float32
from enliven.document import Plane, Project
from enliven.errors import InputError
from enliven.examples.symmetric import reflect_points
from enliven.meshes import Mesh

Brush = Literal["stiffer", "softer", "erase"]
"""Effect of a stroke on the vertices under it. "stiffer" and "softer" change the stiffness, and "erase"
resets it to 1."""
MAX_DOUBLINGS = 4.0
"""Maximum number of doublings or halvings of the stiffness: a factor of 16, at which a limb is practically
rigid."""
_DOUBLINGS_PER_STROKE = 2.0
"""Number of doublings or halvings that one stroke causes along its middle. Two strokes reach the limit."""
_MIN_DOUBLINGS = 1e-3
"""Vertices with fewer doublings or halvings than this count as unpainted."""


def brush_stiffness(
    mesh: Mesh, stroke: Float, radius: float, brush: Brush, mirror: Plane | None = None
) -> Float32 | None:
    """Returns the stiffness (V,) of a mesh after one stroke, or None if no vertex is painted.

    A stroke acts once at each vertex, however slowly it was drawn. Its effect is full along its middle and
    fades to zero at its radius.

    Args:
        stroke: (P, 3) metres, points at rest that the brush passed.
        radius: metres.
        mirror: the plane in which the stroke is mirrored, or None to paint one side only.
    """
    doublings = np.zeros(len(mesh.vertices))
    if mesh.stiffness is not None:
        doublings = np.log2(mesh.stiffness, dtype=np.float64)
    if mirror is not None:
        mirrored_stroke = reflect_points(stroke, np.asarray(mirror.point), np.asarray(mirror.normal))
        stroke = np.concatenate([stroke, mirrored_stroke])
    near = 1.0 - np.minimum(scipy.spatial.cKDTree(stroke).query(mesh.vertices)[0] / radius, 1.0)
    strength = near * near * (3.0 - 2.0 * near)
    if brush == "erase":
        after = doublings * (1.0 - strength)
    else:
        after = (
            doublings + (_DOUBLINGS_PER_STROKE if brush == "stiffer" else -_DOUBLINGS_PER_STROKE) * strength
        )
    after = np.clip(after, -MAX_DOUBLINGS, MAX_DOUBLINGS)
    after[np.abs(after) < _MIN_DOUBLINGS] = 0.0
    painted = np.where(strength > 0, np.exp2(after), 1.0 if mesh.stiffness is None else mesh.stiffness)
    return painted.astype(np.float32) if (painted != 1.0).any() else None


def paint_character(
    project: Project,
    character_id: str,
    stroke: Float,
    radius: float,
    brush: Brush,
    mirror: Plane | None = None,
) -> Project:
    """Paints one stroke onto a character; see :func:`brush_stiffness`.

    Raises:
        InputError: if the character does not exist, or it has no surface.
    """
    mesh = _mesh_of(project, character_id)
    return _with_stiffness(project, character_id, brush_stiffness(mesh, stroke, radius, brush, mirror))


def unpaint_character(project: Project, character_id: str) -> Project:
    """Removes all painted stiffness from a character.

    Raises:
        InputError: if the character does not exist, or it has no surface.
    """
    _mesh_of(project, character_id)
    return _with_stiffness(project, character_id, None)


def _mesh_of(project: Project, character_id: str) -> Mesh:
    character = project.character(character_id)
    if character.mesh is None:
        raise InputError(
            "the character has no surface to paint on",
            where=character.where,
            remedy="Choose a character with a mesh.",
        )
    return character.mesh


def _with_stiffness(project: Project, character_id: str, stiffness: Float32 | None) -> Project:
    character = project.character(character_id)
    assert character.mesh is not None
    return project.with_characters(character.with_changes(mesh=replace(character.mesh, stiffness=stiffness)))
