"""The places of a puppet's control points while it plays, and those a new key pose begins with."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, Puppet
from enliven.errors import EnlivenError
from enliven.examples import State, missing, motion_of, state_of
from enliven_viewer.studio.puppets.editing import Editing


def rest_state(puppet: Puppet) -> State:
    """Returns the state of a puppet at rest, where it was put."""
    return State(puppet.rest, 0.0, np.zeros(3))


def played_state(editor: Editing, puppet: Puppet) -> tuple[Puppet, State]:
    """Returns the puppet and its state at the editor's time; at rest where it cannot move yet.

    The puppet is an older value while the motion of the newest is being solved.
    """
    project, solved = editor.solving.shown(editor.project, puppet.id)
    if not solved.layers:
        return puppet, rest_state(puppet)
    try:
        state = state_of(project, solved, editor.time)
    except EnlivenError:  # the example panel says what it is
        return puppet, rest_state(puppet)
    if solved.mesh is not puppet.mesh or solved.points != puppet.points:
        return solved, state
    return puppet, state


def take_places(project: Project, puppet: Puppet, take: str, time: float) -> Float:
    """Returns (P, 3) metres in the mesh's frame where a new key pose for a second of a take begins: as the
    examples so far would have it, or else as the last key pose.
    """
    start = np.array(puppet.poses[-1].places if puppet.poses else puppet.rest)
    for number, layer in enumerate(puppet.layers):
        if layer.take == take and not missing(project, puppet):
            try:
                motion = motion_of(project, puppet, number)
            except EnlivenError:
                continue
            start[list(motion.points)] = motion.at(time)[0]
            break
    return start
