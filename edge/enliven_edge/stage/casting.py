"""Casting makes an actor on the stage from a mesh file or from a mesh that ships."""

from __future__ import annotations

import logging
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph import DeformationGraph, character_from, graph_of
from enliven.meshes import Axis, Mesh
from enliven.possession import (
    ActorSettings,
    BodyInMesh,
    EmbeddedActor,
    find_person_in_mesh,
    prepared_as,
    seeks_person,
)
from enliven.samples import load_sample

log = logging.getLogger(__name__)

MADE: tuple[Literal["chair", "lamp"], ...] = ("chair", "lamp")
"""The meshes that ship, by name instead of by path."""
_OWN_PARTS = {"lamp": "hip and right arm"}
"""The parts of the body that a shipped mesh is made to be held with; others are held with all."""


def cast(
    spec: str, nodes: int = 128, settings: ActorSettings | None = None, up: Axis | None = None, name: str = ""
) -> EmbeddedActor:
    """The actor of a mesh file, or of a mesh that ships.

    A mesh that meets its performer is scaled to a person's height, moved to where a standing person fits into
    it, and refined where its triangles are too large to bend; one that stays fixed is taken as modelled, in
    metres.

    Args:
        spec: a path, or a name of :data:`MADE`.
        nodes: of the deformation graph.
        up: the mesh's own axis that points up; None guesses it.
        name: the character's id; empty: the file's stem.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    for made in MADE:
        if spec == made:
            return cast_mesh(load_sample(made), name or made, nodes, settings, fit=False)
    from enliven.meshes import GLTF_SUFFIXES, load_upright

    mesh, notes = load_upright(spec, up)
    for note in notes:
        log.info("%s: %s", spec, note)
    if Path(spec).suffix.lower() in GLTF_SUFFIXES:
        from enliven.formats.gltf import with_materials

        mesh = with_materials(mesh, spec, bind_pose=up is None)
    return cast_mesh(mesh, name or name_of(spec), nodes, settings)


def cast_mesh(
    mesh: Mesh,
    name: str,
    nodes: int = 128,
    settings: ActorSettings | None = None,
    *,
    fit: bool = True,
    ends: Float | None = None,
    joints: Float | None = None,
    like: EmbeddedActor | None = None,
) -> EmbeddedActor:
    """Returns the actor of a mesh, as :func:`cast` does; without ``fit`` the mesh is taken as modelled.

    Args:
        ends: (5, 3) metres of the mesh as given, the ends of head, left and right hand, left and right foot
            where they are known; else the settings' are taken.
        joints: (20, 3) metres of the mesh as given, of the person that it shows, where they are known.
        like: the actor of the mesh as it was before an edit. Where no person was found in that, none is
            looked for in a mesh of the same faces: an edit that moves vertices makes none.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    made = prepared_as(mesh, settings or ActorSettings(), fit=fit, ends=ends, joints=joints)
    mesh, settings = made.mesh, made.settings
    none_there = like is not None and like.likeness is None and _same_faces(like, mesh)
    seeks = seeks_person(settings) and not settings.joints and not none_there
    with ThreadPoolExecutor(1) as beside:  # the search takes as long as the graph does, most of it in kernels
        person = beside.submit(_person_in, mesh, settings) if seeks else None
        character = character_from(mesh, DeformationGraph.build(mesh, nodes=nodes), name)
        found = None if person is None else person.result
        if none_there:
            found = lambda: None  # noqa: E731
        actor = EmbeddedActor(character, graph_of(character), settings, made.size, made.height or None, found)
    for doubt in actor.likeness.doubts if actor.likeness else ():
        mend = "Look at how it moves, or name its five ends (in the studio, or as ends under [actor])."
        log.warning("%s: %s %s", name, doubt, mend)
    return actor


def _person_in(mesh: Mesh, settings: ActorSettings) -> BodyInMesh | None:
    """Returns the person that an actor of the mesh finds in it, which has its vertices as they are sent."""
    sent = replace(mesh, vertices=mesh.vertices.astype(np.float32).astype(np.float64))
    return find_person_in_mesh(sent, np.array(settings.ends, np.float64))


def _same_faces(like: EmbeddedActor, mesh: Mesh) -> bool:
    """Returns whether an actor has the faces of a mesh, so that an edit moved vertices at most."""
    return np.array_equal(like.character.faces, mesh.faces)


def parts_for(spec: str) -> str:
    """Returns the parts of the body that hold a mesh where the user names none."""
    return _OWN_PARTS.get(spec, "all")


def name_of(spec: str) -> str:
    """A short id for a character: the file's stem, of letters, digits, '-' and '_'."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", Path(spec).stem)[:40].strip("-") or "mesh"
