"""Converts the performance of a humanoid to tracked bodies, so that it can possess other characters."""

from __future__ import annotations

import numpy as np

from enliven.errors import InputError
from enliven.exporters.performance import Performance
from enliven.exporters.vrm.humanoid import humanoid_from_skeleton
from enliven.person import BODY_NAMES, Body, HumanPose, J, body_from_human_pose
from enliven.rotation import conjugate, from_matrix, multiply, nearest_rotation


def bodies_from_performance(performance: Performance, id: int) -> list[Body]:
    """Returns the body of each frame. The list is empty if the character is not a humanoid.

    A tracked person keeps the 20 tracked joints. In other humanoids, the joints are found by their names.

    Args:
        id: the id of the returned bodies.
    """
    skeleton, joints = performance.skeleton, performance.joints
    if skeleton is None or joints is None:
        return []
    if skeleton.names == BODY_NAMES:
        return [Body(id, frame, np.ones(J)) for frame in joints]
    try:
        humanoid = humanoid_from_skeleton(skeleton, performance.name)
    except InputError:
        return []
    rotations = from_matrix(nearest_rotation(performance.linear))
    by_bone = {name[0].upper() + name[1:]: name for name in humanoid.bones}
    names = HumanPose.sort_bones(by_bone)
    chosen_bones = [humanoid.bones[by_bone[name]] for name in names]
    t_pose = np.stack([humanoid.t_pose[by_bone[name]] for name in names])
    world = multiply(rotations[:, [bone.turned_by for bone in chosen_bones]], conjugate(t_pose))
    places = joints[:, [bone.joint for bone in chosen_bones]]
    return [
        body_from_human_pose(HumanPose(performance.name, tuple(names), place, rotation), id)
        for place, rotation in zip(places, world, strict=True)
    ]
