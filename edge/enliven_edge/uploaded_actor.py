"""Makes the actor of an uploaded character. Its modules are loaded for the first one."""

from __future__ import annotations

import numpy as np

from enliven.document import GraphShape, Project, Puppet, RigBase, Shape
from enliven.errors import InputError
from enliven.formats.project import project_of
from enliven.possession import Actor, EmbeddedActor
from enliven.wire import PutCharacter, check_character
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage import create_mesh_actor

_MAX_UNPACKED_BYTES = 256 * 1024 * 1024
"""Maximum bytes of an uploaded character after decompression: a million vertices, and a puppet's takes."""
_MAX_NODES = 1024
"""Maximum nodes of an uploaded possessed mesh: their distances form a matrix, and each frame moves all of
them."""
_MAX_DISTANCE_M = 1e3
"""Maximum metres of an uploaded mesh from the origin: no stage is larger."""
_MAX_DISTANCE_UNFITTED = 1e9
"""Maximum units of a mesh that will be fitted: a house in micrometres."""


def create_uploaded_actor(
    data: bytes, order: PutCharacter, settings: EdgeSettings, previous: Actor | None = None
) -> Actor:
    """Returns the actor of an uploaded character, ready for its first frame.

    Args:
        previous: the actor with the same id on the stage, if any: its state before an edit.

    Raises:
        InputError: for data that is not a project of one character, or a character that cannot be moved.
    """
    where = f"character {order.id!r}"
    project = project_of(data, where, _MAX_UNPACKED_BYTES)
    if len(project.characters) != 1:
        problem = f"{len(project.characters)} characters were sent as one"
        raise InputError(problem, where=where, mend="Send each by itself.")
    (character,) = project.characters.values()
    mesh = character.mesh
    if mesh is None or not len(mesh.faces):
        raise InputError("it has no mesh", where=where, mend="Give it one.")
    farthest = _MAX_DISTANCE_UNFITTED if order.fit else _MAX_DISTANCE_M
    if not (np.abs(mesh.vertices) < farthest).all():
        problem = f"a vertex is {farthest:g} from the origin, or not finite"
        raise InputError(problem, where=where, mend="Scale it to metres.")
    actor = _create_actor(project, character.with_changes(id=order.id), order, settings, previous)
    check_character(actor.character)  # Raises now if the character cannot be sent to viewers.
    actor.warm_up()
    return actor


def _create_actor(
    project: Project, character: RigBase, order: PutCharacter, settings: EdgeSettings, previous: Actor | None
) -> Actor:
    """Returns the actor of a character by its rig. Only the required modules are loaded."""
    if isinstance(character, GraphShape):
        nodes = len(character.positions) if len(character.positions) > 1 else settings.nodes
        if nodes > _MAX_NODES:
            mend = f"Give it {_MAX_NODES} at most."
            raise InputError(f"it has {nodes} nodes", where=character.where, mend=mend)
        ends_and_joints = {"ends": character.ends, "joints": character.joints}
        unedited = previous if isinstance(previous, EmbeddedActor) and not len(character.ends) else None
        return create_mesh_actor(
            character.mesh,
            character.id,
            nodes,
            settings.actor,
            fit=order.fit,
            like=unedited,
            **ends_and_joints,
        )
    if isinstance(character, Shape):
        from enliven_edge.stage.rig import RigActor

        return RigActor(character, settings.matching)
    assert isinstance(character, Puppet)
    from enliven_edge.stage.puppet import create_actor_from_project

    return create_actor_from_project(project, character, settings.puppet)
