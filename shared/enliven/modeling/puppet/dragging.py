"""Drags a control point at a time of a puppet's motion. The pose at that time becomes a key pose."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import ExampleCharacter, Project
from enliven.errors import InputError
from enliven.examples.puppet_examples import find_nearest_frame
from enliven.modeling.puppet.parts import convert_to_mesh_frame, evaluate_puppet_state
from enliven.modeling.puppet.poses import add_key_pose, change_key_pose


def drag_point(project: Project, puppet_id: str, point: int, place: AnyArray, time: float) -> Project:
    """Moves a control point to ``place`` (3,), metres in the world, at a time of the project.

    The other control points keep their positions at that time, and all control points together form a key
    pose. The key pose belongs to the take of the lowest layer that plays. An existing key pose of that frame
    is changed.

    Raises:
        InputError: if the puppet plays no take, or if ``add_key_pose`` rejects the pose.
    """
    puppet = project.puppet(puppet_id)
    layer = next((candidate for candidate in puppet.layers if not candidate.muted), None)
    if layer is None:
        raise InputError(
            "the puppet plays no take", where=puppet.where, remedy="Choose a take for the puppet first."
        )
    state = evaluate_puppet_state(project, puppet, time)
    second = layer.find_played_time(time, project.takes[layer.take].duration)[0]
    number = key_pose_at(project, puppet, layer.take, second)
    places: Float = np.array(state.places if number is None else puppet.poses[number].places)
    places[point] = convert_to_mesh_frame(puppet, state, place)
    if number is None:
        return add_key_pose(project, puppet_id, layer.take, second, places)
    return change_key_pose(project, puppet_id, number, places=places)


def key_pose_at(project: Project, puppet: ExampleCharacter, take: str, second: float) -> int | None:
    """Returns the number of the key pose at the frame of a take that plays at ``second``, or None if there is
    none."""
    clip = project.takes[take]
    frames = [find_nearest_frame(clip, pose.time) if pose.take == take else -1 for pose in puppet.poses]
    frame = find_nearest_frame(clip, second)
    return frames.index(frame) if frame in frames else None
