"""Creates the actor of an uploaded character. This module is imported at the first upload."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from enliven.character_store.prepared import PreparedCharacter, prepare_once
from enliven.character_store.store import compute_cache_key
from enliven.document import ExampleCharacter, GraphCharacter, Project, RiggedCharacter
from enliven.errors import InputError
from enliven.formats.project.file import parse_project
from enliven.possession import Actor, EmbeddedActor
from enliven.wire import PutCharacter, check_character
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage.character_setup import create_stage_actor, prepare_character

_MAX_UNPACKED_BYTES = 256 * 1024 * 1024
"""Maximum bytes of an uploaded character after decompression. It is enough for a million vertices and a
puppet's takes."""
_MAX_NODES = 1024
"""Maximum number of nodes of an uploaded mesh. Memory grows with their square, and each frame moves all of
them."""
_MAX_DISTANCE_M = 1e3
"""Maximum distance of an uploaded mesh's vertices from the origin in metres. No stage is larger."""
_MAX_DISTANCE_UNFITTED = 1e9
"""Maximum coordinate, in any unit, of a mesh that is scaled to a performer: a house in micrometres."""


@dataclass(frozen=True)
class Upload:
    """A character that a viewer sent.

    Attributes:
        project: a project with only the character and the takes that it needs.
        character: the character, which has a mesh and its id on the stage.
        order: the request.
        settings: the settings of the edge.
        previous: the actor with the same id on the stage before an edit, or None.
        digest: the checksum of the uploaded data.
    """

    project: Project
    character: Any
    order: PutCharacter
    settings: EdgeSettings
    previous: Actor | None = None
    digest: str = ""


def create_uploaded_actor(
    data: bytes, order: PutCharacter, settings: EdgeSettings, previous: Actor | None = None
) -> Actor:
    """Returns the actor of an uploaded character, ready for its first frame.

    Args:
        previous: the actor with the same id on the stage, which is the state before an edit, or None.

    Raises:
        InputError: for data that is not a project of one character, or a character that cannot be moved.
    """
    where = f"character {order.id!r}"
    project = parse_project(data, where, _MAX_UNPACKED_BYTES)
    if len(project.characters) != 1:
        problem = f"{len(project.characters)} characters were sent as one character"
        raise InputError(problem, where=where, remedy="Send each character by itself.")
    (character,) = project.characters.values()
    mesh = character.mesh
    if mesh is None or not len(mesh.faces):
        raise InputError("the character has no mesh", where=where, remedy="Add a mesh to the character.")
    farthest = _MAX_DISTANCE_UNFITTED if order.fit else _MAX_DISTANCE_M
    if not (np.abs(mesh.vertices) < farthest).all():
        problem = f"a vertex is {farthest:g} from the origin, or not finite"
        raise InputError(problem, where=where, remedy="Scale the mesh to metres.")
    digest = hashlib.sha256(data).hexdigest()
    upload = Upload(project, character.with_changes(id=order.id), order, settings, previous, digest)
    actor = ACTORS.get(character.kind, _surface_actor)(upload)
    check_character(actor.character)  # This raises an error now if the character cannot be sent to viewers.
    actor.warm_up()
    return actor


def _surface_actor(upload: Upload, *, fit: bool = False) -> Actor:
    """Returns the actor of a mesh that has no rig on the stage: performers possess its surface.

    Args:
        fit: whether to scale the mesh to a performer even if the request does not ask for it.
    """
    character, settings = upload.character, upload.settings
    fit = fit or upload.order.fit

    def prepare() -> PreparedCharacter:
        return prepare_character(character.mesh, character.id, settings.nodes, settings.actor, fit=fit)

    return _read_stored_actor(upload, prepare, settings.nodes, fit)


def _graph_actor(upload: Upload) -> Actor:
    """Returns the actor of a possessed mesh, with the nodes and joints of its first possession."""
    shape, settings = upload.character, upload.settings
    nodes = len(shape.positions) if len(shape.positions) > 1 else settings.nodes
    if nodes > _MAX_NODES:
        remedy = f"Use at most {_MAX_NODES} nodes."
        raise InputError(f"the deformation graph has {nodes} nodes", where=shape.where, remedy=remedy)
    unedited = upload.previous if isinstance(upload.previous, EmbeddedActor) and not len(shape.ends) else None

    def prepare() -> PreparedCharacter:
        return prepare_character(
            *(shape.mesh, shape.id, nodes, settings.actor),
            fit=upload.order.fit,
            like=unedited,
            ends=shape.ends,
            joints=shape.joints,
        )

    if unedited is not None:
        return create_stage_actor(
            prepare()
        )  # Do not store a mesh that is being edited, because it soon changes again.
    return _read_stored_actor(upload, prepare, nodes, upload.order.fit)


def _read_stored_actor(
    upload: Upload, prepare: Callable[[], PreparedCharacter], nodes: int, fit: bool
) -> EmbeddedActor:
    """Returns the actor of a mesh from the store of prepared characters, or prepares and stores it."""
    inputs = (upload.digest, upload.order.id, upload.character.kind, fit, nodes, upload.settings.actor)
    return create_stage_actor(prepare_once(compute_cache_key("upload", *inputs), prepare))


def _rig_actor(upload: Upload) -> Actor:
    """Returns the actor of a character with bones."""
    from enliven_edge.stage.rig.rig_actor import RigActor

    return RigActor(upload.character, upload.settings.matching)


def _puppet_actor(upload: Upload) -> Actor:
    """Returns the actor of an example-driven character. Without examples, performers possess its surface."""
    if upload.character.is_possessable:
        return _surface_actor(upload, fit=True)
    from enliven_edge.stage.puppet.puppet_setup import create_actor_from_project

    return create_actor_from_project(upload.project, upload.character, upload.settings.puppet)


ACTORS: dict[str, Callable[[Upload], Actor]] = {
    GraphCharacter.kind: _graph_actor,
    RiggedCharacter.kind: _rig_actor,
    ExampleCharacter.kind: _puppet_actor,
}
"""The function that creates the actor of each kind of rig. Add further kinds here. If a kind has no entry,
performers possess the surface."""
