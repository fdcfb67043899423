"""Prepares a mesh from a file for performers: scale, placement and refinement."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float
from enliven.meshes import Mesh, fit_height, refine
from enliven.person import Body
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.likeness.finding import find_person_in_mesh
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.possession.likeness.standing_person import (
    PERSON_HEIGHT_M,
    TRUNK_JOINTS,
    fit_standing_person,
    make_standing_figure,
)
from enliven.possession.placement import rotation_about_y
from enliven.similarity import fit_similarity

log = logging.getLogger(__name__)

_MAX_EDGE_M = 0.04
"""Maximum edge length, metres. Longer edges are split, because triangles must be narrower than a limb for the
limb to bend."""


class PreparedMesh(NamedTuple):
    """A mesh that is ready for the stage, with the parameters of its actor.

    Attributes:
        mesh: the mesh, in metres of its rest space.
        settings: the settings of the actor, including the limb ends and joints of this mesh.
        size: metres of the mesh as modelled per metre of its rest space.
        height: height of the person that the mesh shows, metres, even if the mesh is only a part of the
            person. 0 means the height of the mesh.
    """

    mesh: Mesh
    settings: ActorSettings
    size: float
    height: float


def prepare_for_actor(
    mesh: Mesh,
    settings: ActorSettings,
    *,
    fit: bool = True,
    ends: Float | None = None,
    joints: Float | None = None,
) -> PreparedMesh:
    """Prepares a mesh and its settings for an actor.

    Args:
        fit: True scales the mesh to a person's size, as :func:`prepare_mesh` does. False keeps it as
            modelled.
        ends: (5, 3) the ends of head, left and right hand, left and right foot in metres of the given mesh,
            if known. Otherwise the ends in the settings are kept.
        joints: (20, 3) the joints of the person that the mesh shows, in metres of the given mesh, if known.
    """
    vertices, size, height = mesh.vertices, 1.0, 0.0
    end_vertices = (
        [] if ends is None else [int(np.linalg.norm(vertices - end, axis=1).argmin()) for end in ends]
    )
    if fit:
        mesh, size = prepare_mesh(mesh, settings, end_vertices, joints)
        joints = (
            joints
            if joints is None
            else apply_vertex_motion(joints, vertices, mesh.vertices[: len(vertices)])
        )
    if end_vertices:
        settings = replace(settings, ends=tuple(map(tuple, mesh.vertices[end_vertices].tolist())))
    if joints is not None and len(joints):
        settings = replace(settings, joints=tuple(map(tuple, joints.tolist())))
        # Compute the person's height from the joints. If only a part of the person was in view, the mesh is
        # lower than the person.
        height = Body(0, joints, np.ones(len(joints))).height
    return PreparedMesh(mesh, settings, size, height)


def prepare_mesh(
    mesh: Mesh, settings: ActorSettings, ends: Sequence[int] = (), joints: Float | None = None
) -> tuple[Mesh, float]:
    """Prepares an upright mesh for the stage. Returns the mesh, and its scale in metres as modelled per metre
    of the result.

    If the settings place the mesh at its performer (``place = "meet"``), there are three steps. The mesh is
    scaled to a person's height. It is moved so that a standing person at the origin fits into it. It is
    refined if its triangles are too large for limbs to bend. A mesh that stays fixed is returned unchanged.
    The original vertices keep their indices.

    Args:
        ends: the vertices at the ends of head, left and right hand, left and right foot, if they are known.
        joints: (20, 3) the joints of the person that the mesh shows, in metres of the mesh, if they are
            known.
    """
    if settings.place == "fixed":
        return mesh, 1.0
    # A performer's height differs from this height only by a small factor.
    size, vertices = float(np.ptp(mesh.vertices[:, 1])) / PERSON_HEIGHT_M, mesh.vertices
    mesh = fit_height(mesh, PERSON_HEIGHT_M)
    if settings.stand == "fitted":
        if joints is not None and len(joints):
            person = BodyInMesh.from_joints(apply_vertex_motion(joints, vertices, mesh.vertices))
        else:
            person = find_person_in_mesh(mesh, mesh.vertices[list(ends)])
        if person is not None and (person.is_certain or len(ends)):
            mesh = _align_with_figure(mesh, person)
            log.info(
                "%s: the mesh was moved so that its back is at the back of a standing performer", mesh.name
            )
        else:
            mesh, fit = fit_standing_person(mesh)
            log.info(
                "%s: the mesh was moved so that a standing performer fits into it (fit: %.0f %%)",
                mesh.name,
                100 * fit,
            )
    return refine(mesh, _MAX_EDGE_M), size


def apply_vertex_motion(points: Float, old_vertices: Float, new_vertices: Float) -> Float:
    """Applies to points (N, 3) the similarity transform that maps ``old_vertices`` (V, 3) to
    ``new_vertices``.
    """
    return fit_similarity(old_vertices, new_vertices).transform(points)


def _align_with_figure(mesh: Mesh, person: BodyInMesh) -> Mesh:
    """Rotates the mesh so that its front is +Z, and moves its trunk to the trunk of a figure that stands at
    the origin.
    """
    rotation_matrix = rotation_about_y(person.yaw)
    trunk = (person.joints @ rotation_matrix)[TRUNK_JOINTS].mean(0)
    offset = make_standing_figure()[TRUNK_JOINTS].mean(0) - trunk
    return replace(mesh, vertices=mesh.vertices @ rotation_matrix + offset * [1.0, 0.0, 1.0])
