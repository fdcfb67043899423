"""Where a puppet's control points are while it plays, and where a new key pose begins."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.errors import EnlivenError
from enliven.examples.puppet_motion import State, missing, motion_of, state_of
from enliven.project import Project
from enliven.puppet import Puppet


def rest_state(puppet: Puppet) -> State:
    """At rest, where it was put."""
    return State(puppet.rest, 0.0, np.zeros(3))


def played_state(project: Project, puppet: Puppet, time: float) -> State:
    """Where it is at a time of the project, seconds; at rest where it cannot move yet."""
    if not puppet.layers or missing(project, puppet):
        return rest_state(puppet)
    try:
        return state_of(project, puppet, time)
    except EnlivenError:  # the example panel says what it is
        return rest_state(puppet)


def take_places(project: Project, puppet: Puppet, take: str, time: float) -> Float:
    """(P, 3) metres in the mesh's frame where a new key pose for a second of a take begins: as the
    examples so far would have it, or else as the last key pose."""
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
