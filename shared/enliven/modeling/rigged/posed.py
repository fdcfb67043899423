"""The pose of a shape at a time, for the edits of rigged shapes."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.rigged.spans import rotation_without_takes
from enliven.motion.layers.evaluate import ShapePose, evaluate_pose
from enliven.motion.layers.travel import travel_scale
from enliven.rotation import conjugate, multiply, normalized, rotate


def compute_pose(project: Project, shape: RiggedCharacter, time: float | None) -> tuple[Float, Float]:
    """Returns the world rotations D_j (N, 4) and the positions (N, 3) of the joints.

    Args:
        time: seconds of the project's time; None for the rest pose, without any take.

    Raises:
        InputError: if the time is not finite.
    """
    pose = pose_with_stretch(project, shape, time)
    return pose.turns, pose.joints


def pose_with_stretch(project: Project, shape: RiggedCharacter, time: float | None) -> ShapePose:
    """Returns the pose with the stretch of the bones. It has the same arguments as :func:`compute_pose`."""
    if time is None:
        return ShapePose(*compute_modeled_pose(shape))
    if not np.isfinite(time):
        raise InputError(
            f"the time {time} is not a finite number",
            where=f"shape {shape.id!r}",
            remedy="Pass a finite number of seconds.",
        )
    return evaluate_pose(project.with_characters(shape), shape.id, float(time))


def compute_modeled_pose(shape: RiggedCharacter) -> tuple[Float, Float]:
    """Returns the pose without takes: world rotations (N, 4) and positions (N, 3). A rotation is D_j =
    D_parent m_j b_j, where b_j are the fixed rotations of the bone's spans.
    """
    skeleton = shape.skeleton
    turns, positions = np.empty((len(skeleton), 4)), np.empty((len(skeleton), 3))
    for j, parent in enumerate(skeleton.parents):
        own_turn = multiply(shape.modeling[j], rotation_without_takes(shape.spans[j]))
        turns[j] = own_turn if parent < 0 else multiply(turns[parent], own_turn)
        start = skeleton.positions[0] + shape.place if parent < 0 else positions[parent]
        positions[j] = start + rotate(turns[j], skeleton.vectors[j])
    return turns, positions


def with_travel_kept(project: Project, old: RiggedCharacter, new: RiggedCharacter) -> RiggedCharacter:
    """Restores the travel scale that a shape had before an edit, so that its strides keep their length
    although its height has changed.
    """
    if new.travel is None:
        return new
    clip = project.takes[new.layer(new.travel).take]
    old_scale = travel_scale(old, clip)
    return new if travel_scale(new, clip) == old_scale else new.with_changes(travel_scale=old_scale)


def restore_world_rotations(
    project: Project, part: RiggedCharacter, whole_shape: RiggedCharacter, turns: Float, time: float | None
) -> RiggedCharacter:
    """Restores, in a part of a shape that has lost a pin, the world rotations of the whole shape at ``time``.

    The rotations that the pin caused are added to the modeling rotations.

    Args:
        turns: (N, 4) the world rotations of the whole shape.
    """
    rotation_by_name = dict(zip(whole_shape.skeleton.names, turns, strict=True))
    current, _ = compute_pose(project, part, time)
    modeling = np.array(part.modeling)
    for j, name in enumerate(part.skeleton.names):
        parent = int(part.skeleton.parents[j])
        if (
            j == 0
            or name not in rotation_by_name
            or np.allclose(current[j], rotation_by_name[name], atol=1e-12)
        ):
            continue
        above = rotation_by_name.get(part.skeleton.names[parent], current[parent])
        back = multiply(
            conjugate(above),
            multiply(rotation_by_name[name], conjugate(animation_rotation(current, part, j))),
        )
        modeling[j] = normalized(back)
    return part.with_changes(modeling=modeling)


def animation_rotation(turns: Float, shape: RiggedCharacter, j: int) -> Float:
    """Computes (4,) the animation rotation a_j = (D_parent m_j)^-1 D_j in a pose with the world rotations
    ``turns``."""
    parent = int(shape.skeleton.parents[j])
    modeled = shape.modeling[j] if parent < 0 else multiply(turns[parent], shape.modeling[j])
    return multiply(conjugate(modeled), turns[j])
