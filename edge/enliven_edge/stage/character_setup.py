"""Character setup: builds an actor of the stage from a mesh file or from a mesh that ships."""

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
    needs_person_search,
    prepare_for_actor,
)
from enliven.samples import load_sample

log = logging.getLogger(__name__)

MADE: tuple[Literal["chair", "lamp"], ...] = ("chair", "lamp")
"""The meshes that ship with enliven, which are given by name instead of by path."""
_OWN_PARTS = {"lamp": "hip and right arm"}
"""The body parts that a shipped mesh is designed for. Other meshes are held with all parts."""


def create_actor(
    spec: str, nodes: int = 128, settings: ActorSettings | None = None, up: Axis | None = None, name: str = ""
) -> EmbeddedActor:
    """Returns the actor of a mesh file, or of a mesh that ships.

    A mesh that meets its performer is scaled to a person's height and moved to where a standing person fits
    into it. Triangles that are too large to bend are refined. A mesh that stays fixed keeps its modelled
    position and size, in metres.

    Args:
        spec: a path, or a name of :data:`MADE`.
        nodes: number of nodes of the deformation graph.
        up: the axis of the mesh that points up. If None, it is guessed.
        name: the character's id. If empty, the file's stem is used.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    for sample in MADE:
        if spec == sample:
            return create_mesh_actor(load_sample(sample), name or sample, nodes, settings, fit=False)
    from enliven.meshes import load_upright

    mesh, notes = load_upright(spec, up)
    for note in notes:
        log.info("%s: %s", spec, note)
    return create_mesh_actor(mesh, name or name_of(spec), nodes, settings)


def create_mesh_actor(
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
    """Returns the actor of a mesh, like :func:`create_actor`. Without ``fit`` the mesh keeps its modelled
    place.

    Args:
        ends: (5, 3) metres, in the coordinates of the given mesh: the ends of head, left and right hand, left
            and right foot. If None, those of the settings are used.
        joints: (20, 3) metres, in the coordinates of the given mesh: the joints of the person that it shows,
            if known.
        like: the actor of the mesh before an edit. If no person was found in that mesh and the faces are
            unchanged, the search is skipped: moving vertices does not turn a mesh into a person.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    prepared = prepare_for_actor(mesh, settings or ActorSettings(), fit=fit, ends=ends, joints=joints)
    mesh, settings = prepared.mesh, prepared.settings
    no_person = like is not None and like.likeness is None and _same_faces(like, mesh)
    searches_person = needs_person_search(settings) and not settings.joints and not no_person
    with ThreadPoolExecutor(1) as background:  # Run both in parallel, because they take about the same time.
        person = background.submit(_person_in, mesh, settings) if searches_person else None
        character = character_from(mesh, DeformationGraph.build(mesh, nodes=nodes), name)
        search_result = None if person is None else person.result
        if no_person:
            search_result = lambda: None  # noqa: E731
        actor = EmbeddedActor(
            character, graph_of(character), settings, prepared.size, prepared.height or None, search_result
        )
    for doubt in actor.likeness.doubts if actor.likeness else ():
        mend = "Look at how it moves, or name its five ends (in the studio, or as ends under [actor])."
        log.warning("%s: %s %s", name, doubt, mend)
    return actor


def _person_in(mesh: Mesh, settings: ActorSettings) -> BodyInMesh | None:
    """Returns the person found in the mesh. The vertices are rounded to float32, as viewers receive them."""
    sent = replace(mesh, vertices=mesh.vertices.astype(np.float32).astype(np.float64))
    return find_person_in_mesh(sent, np.array(settings.ends, np.float64))


def _same_faces(like: EmbeddedActor, mesh: Mesh) -> bool:
    """Returns True if an actor's mesh has the same faces as `mesh`, so that an edit can only have moved
    vertices."""
    return np.array_equal(like.character.faces, mesh.faces)


def parts_for(spec: str) -> str:
    """Returns the body parts that hold a mesh if the user names none."""
    return _OWN_PARTS.get(spec, "all")


def name_of(spec: str) -> str:
    """Returns a short id for a character: the file's stem, reduced to letters, digits, '-' and '_'."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", Path(spec).stem)[:40].strip("-") or "mesh"
