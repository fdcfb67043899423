"""Casts the actor of a character that a client sent; its modules are loaded for the first one."""

from __future__ import annotations

import numpy as np

from enliven.document import GraphShape, Project, Puppet, RigBase, Shape
from enliven.errors import InputError
from enliven.formats.project import project_of
from enliven.possession import Actor, EmbeddedActor
from enliven.wire import PutCharacter, check_character
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage import cast_mesh

_MOST_UNPACKED = 256 * 1024 * 1024
"""Bytes that a sent character may unpack to: a million vertices, and a puppet's takes."""
_MOST_NODES = 1024
"""Nodes of a possessed mesh that is sent: their distances are a matrix, and each frame moves all."""
_FARTHEST = 1e3
"""Metres from the origin within which a sent mesh lies: farther away is no place on any stage."""
_FARTHEST_UNFITTED = 1e9
"""Units of its own within which a mesh that is to be fitted lies: a house in micrometres."""


def cast_sent(data: bytes, order: PutCharacter, settings: EdgeSettings, former: Actor | None = None) -> Actor:
    """Returns the actor of a character that was sent, ready for its first frame.

    Args:
        former: the actor that has its id on the stage, where there is one: what it was before an edit.

    Raises:
        InputError: for data that is no project of one character, or a character that cannot be moved.
    """
    where = f"character {order.id!r}"
    project = project_of(data, where, _MOST_UNPACKED)
    if len(project.characters) != 1:
        what = f"{len(project.characters)} characters were sent as one"
        raise InputError(what, where=where, mend="Send each by itself.")
    (one,) = project.characters.values()
    mesh = one.mesh
    if mesh is None or not len(mesh.faces):
        raise InputError("it has no mesh", where=where, mend="Give it one.")
    farthest = _FARTHEST_UNFITTED if order.fit else _FARTHEST
    if not (np.abs(mesh.vertices) < farthest).all():
        what = f"a vertex is {farthest:g} from the origin, or not finite"
        raise InputError(what, where=where, mend="Scale it to metres.")
    actor = _actor_of(project, one.with_changes(id=order.id), order, settings, former)
    check_character(actor.character)  # what no viewer can be sent is said now
    actor.warm_up()
    return actor


def _actor_of(
    project: Project, one: RigBase, order: PutCharacter, settings: EdgeSettings, former: Actor | None
) -> Actor:
    """Returns the actor of a character by its rig; only the modules that it needs are loaded."""
    if isinstance(one, GraphShape):
        nodes = len(one.positions) if len(one.positions) > 1 else settings.nodes
        if nodes > _MOST_NODES:
            mend = f"Give it {_MOST_NODES} at most."
            raise InputError(f"it has {nodes} nodes", where=one.where, mend=mend)
        known = {"ends": one.ends, "joints": one.joints}
        like = former if isinstance(former, EmbeddedActor) and not len(one.ends) else None
        return cast_mesh(one.mesh, one.id, nodes, settings.actor, fit=order.fit, like=like, **known)
    if isinstance(one, Shape):
        from enliven_edge.stage.rig import RigActor

        return RigActor(one, settings.matching)
    assert isinstance(one, Puppet)
    from enliven_edge.stage.puppet import cast_from_project

    return cast_from_project(project, one, settings.puppet)
