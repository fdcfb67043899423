"""A control point dragged at a moment of what a puppet plays: the moment becomes a key pose."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project, Puppet
from enliven.errors import InputError
from enliven.examples import frame_at
from enliven.modeling.puppet.parts import into_frame, state_at
from enliven.modeling.puppet.poses import add_key_pose, change_key_pose


def drag_point(project: Project, puppet_id: str, point: int, place: AnyArray, time: float) -> Project:
    """A project in which a control point is at ``place`` (3,) metres in the world at a time of the project.

    The others stay where they are then, and all of them are a key pose of the take of the lowest layer that
    plays; one of that frame that is there already is changed.

    Raises:
        InputError: where the puppet plays nothing, and as ``add_key_pose``.
    """
    puppet = project.puppet(puppet_id)
    layer = next((one for one in puppet.layers if not one.muted), None)
    if layer is None:
        raise InputError("it plays no take", where=puppet.where, mend="Choose a take for it first.")
    state = state_at(project, puppet, time)
    second = layer.played(time, project.takes[layer.take].duration)[0]
    number = key_pose_at(project, puppet, layer.take, second)
    places: Float = np.array(state.places if number is None else puppet.poses[number].places)
    places[point] = into_frame(puppet, state, place)
    if number is None:
        return add_key_pose(project, puppet_id, layer.take, second, places)
    return change_key_pose(project, puppet_id, number, places=places)


def key_pose_at(project: Project, puppet: Puppet, take: str, second: float) -> int | None:
    """The number of the key pose of a frame of a take, or None."""
    clip = project.takes[take]
    frames = [frame_at(clip, pose.time) if pose.take == take else -1 for pose in puppet.poses]
    frame = frame_at(clip, second)
    return frames.index(frame) if frame in frames else None
