"""Character setup: creates an actor of the stage from a mesh file or from a shipped mesh."""

from __future__ import annotations

import hashlib
import logging
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.character_store.prepared import PreparedCharacter, prepare_once
from enliven.character_store.store import compute_cache_key
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph, graph_from_character
from enliven.errors import InputError
from enliven.files import read_file
from enliven.meshes import Axis, Mesh
from enliven.possession import (
    ActorSettings,
    BodyInMesh,
    EmbeddedActor,
    find_person_in_mesh,
    needs_person_search,
    prepare_for_actor,
)
from enliven.samples.shipped import default_parts as default_parts
from enliven.samples.shipped import load_sample

log = logging.getLogger(__name__)

SHIPPED_MESHES: tuple[Literal["chair", "lamp"], ...] = ("chair", "lamp")
"""Names of the shipped meshes. They can be given instead of a path."""


def create_actor(
    spec: str, nodes: int = 128, settings: ActorSettings | None = None, up: Axis | None = None, name: str = ""
) -> EmbeddedActor:
    """Returns the actor of a mesh file, or of a shipped mesh.

    If the settings fit the mesh to its performer, it is scaled to a person's height and moved so that a
    standing person fits into it. Otherwise it keeps its modelled position and its size in metres. Triangles
    that are too large to bend are refined.

    Args:
        spec: a path, or a name of :data:`SHIPPED_MESHES`.
        nodes: number of nodes of the deformation graph.
        up: the axis of the mesh that points up. If None, it is guessed.
        name: the character's id. If empty, the file's stem is used.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    settings, name = settings or ActorSettings(), name or make_character_id(spec)
    inputs = (up, nodes, settings, name)
    source = _mesh_source(spec)
    if source is None:
        prepared = _prepare_spec(spec, *inputs)
    else:
        key = compute_cache_key("mesh file", source, *inputs)
        prepared = prepare_once(key, lambda: _prepare_spec(spec, *inputs), Path(spec).parent)
    for note in prepared.notes:
        log.info("%s: %s", spec, note)
    return create_stage_actor(prepared)


def _mesh_source(spec: str) -> tuple[str, str] | None:
    """Returns the name of a shipped mesh, or digest and format of a file. Returns None if the file cannot be
    read.
    """
    if spec in SHIPPED_MESHES:
        return "sample", spec
    try:
        return hashlib.sha256(read_file(Path(spec))).hexdigest(), Path(spec).suffix.lower()
    except InputError:
        return None  # The mesh reader reports the problem later.


def _prepare_spec(
    spec: str, up: Axis | None, nodes: int, settings: ActorSettings, name: str
) -> PreparedCharacter:
    """Prepares a mesh file, or a shipped mesh, as :func:`create_actor` describes."""
    for sample in SHIPPED_MESHES:
        if spec == sample:
            return prepare_character(load_sample(sample), name, nodes, settings, fit=False)
    from enliven.meshes import load_upright

    mesh, notes = load_upright(spec, up)
    return replace(prepare_character(mesh, name, nodes, settings), notes=tuple(notes))


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
    """Returns the actor of a mesh, like :func:`create_actor`. If ``fit`` is False, the mesh keeps its
    modelled position.

    Args:
        ends: (5, 3) metres, in the coordinates of the given mesh: the ends of head, left and right hand, left
            and right foot. If None, those of the settings are used.
        joints: (20, 3) metres, in the coordinates of the given mesh: the joints of the person that the mesh
            represents, if known.
        like: the actor of the mesh before an edit. The search for a person is skipped if none was found in
            that mesh and the faces are unchanged. Moving vertices does not turn a mesh into a person.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    return create_stage_actor(
        prepare_character(mesh, name, nodes, settings, fit=fit, ends=ends, joints=joints, like=like)
    )


def create_stage_actor(prepared: PreparedCharacter) -> EmbeddedActor:
    """Returns the actor of a prepared character. Logs doubts about the person found in the mesh."""
    character = prepared.character
    actor = EmbeddedActor(
        character, graph_from_character(character), prepared.settings, prepared.size, prepared.height or None
    )
    actor.set_likeness(prepared.likeness)
    for doubt in prepared.likeness.doubts if prepared.likeness else ():
        remedy = (
            "Check how the character moves. If it moves wrongly, set its head, hands and feet in the "
            "studio (or ends under [actor])."
        )
        log.warning("%s: %s %s", character.id, doubt, remedy)
    return actor


def prepare_character(
    mesh: Mesh,
    name: str,
    nodes: int = 128,
    settings: ActorSettings | None = None,
    *,
    fit: bool = True,
    ends: Float | None = None,
    joints: Float | None = None,
    like: EmbeddedActor | None = None,
) -> PreparedCharacter:
    """Prepares a mesh for its actor, with the arguments of :func:`create_mesh_actor`.

    Raises:
        InputError: for a mesh that cannot be used.
    """
    prepared = prepare_for_actor(mesh, settings or ActorSettings(), fit=fit, ends=ends, joints=joints)
    mesh, settings = prepared.mesh, prepared.settings
    no_person = like is not None and like.likeness is None and _has_same_faces(like, mesh)
    searches_person = needs_person_search(settings) and not settings.joints and not no_person
    with ThreadPoolExecutor(1) as background:  # Run both in parallel, because they take about the same time.
        person = background.submit(_find_person, mesh, settings) if searches_person else None
        character = character_from_graph(mesh, DeformationGraph.build(mesh, nodes=nodes), name)
        search_result = None if person is None else person.result
        if no_person:
            search_result = lambda: None  # noqa: E731
        height = prepared.height or None
        actor = EmbeddedActor(
            character, graph_from_character(character), settings, prepared.size, height, search_result
        )
        likeness = actor.likeness
    return PreparedCharacter(character, settings, prepared.size, prepared.height, likeness)


def _find_person(mesh: Mesh, settings: ActorSettings) -> BodyInMesh | None:
    """Returns the person found in the mesh, or None.

    The vertices are first rounded to float32, because viewers receive them like that.
    """
    sent = replace(mesh, vertices=mesh.vertices.astype(np.float32).astype(np.float64))
    return find_person_in_mesh(sent, np.array(settings.ends, np.float64))


def _has_same_faces(like: EmbeddedActor, mesh: Mesh) -> bool:
    """Returns True if an actor's mesh has the same faces as ``mesh``: an edit only moved vertices."""
    return np.array_equal(like.character.faces, mesh.faces)


def make_character_id(spec: str) -> str:
    """Returns a short id for a character: the file's stem, reduced to letters, digits, '-' and '_'."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", Path(spec).stem)[:40].strip("-") or "mesh"
