"""Writes the motion of a humanoid, without its mesh, as a VRM animation (.vrma, VRMC_vrm_animation 1.0).

The nodes of the file are the VRM bones in the T-pose, without rotations at rest. So the rotation of a node is
its bone's rotation relative to the T-pose. Programs can apply it to any VRM avatar. Only the hips have a
position track.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.exporters.gltf.scene import GltfScene
from enliven.exporters.joints import json_numbers
from enliven.exporters.performance import Performance
from enliven.exporters.registry import Exporter
from enliven.exporters.vrm.humanoid import humanoid_from_skeleton
from enliven.files import write_file
from enliven.rotation import conjugate, from_matrix, multiply, nearest_rotation, remove_sign_jumps, rotate

EXTENSION = "VRMC_vrm_animation"
_STILL_S = 1.0 / 30.0
"""Duration of a still pose in seconds. A channel needs two keys."""
_MAX_FLOOR_OFFSET = 0.1
"""Maximum distance of the lowest joint from y = 0, as a fraction of the skeleton's height. Beyond it, the
floor of the rest pose is assumed at the lowest joint instead of y = 0."""


def write_vrma(path: Path | str, performances: Sequence[Performance], name: str = "enliven") -> None:
    """Writes the motion of one humanoid.

    Args:
        name: the title of the animation.

    Raises:
        InputError: if there is not exactly one character, or if it is not a humanoid with joints of known
            names.
        ResourceError: if the file cannot be written.
    """
    if len(performances) != 1:
        problem = f"a VRM animation can contain only one character, but {len(performances)} are selected"
        raise InputError(problem, where=str(path), remedy="Choose one with --character NAME.")
    write_file(Path(path), vrma_bytes(performances[0], name), "Choose another output file.")


VRMA = Exporter(write_vrma, jointed=True, solid=False, single=True)


def vrma_bytes(performance: Performance, name: str = "enliven") -> bytes:
    """Returns the bytes of the file. See :func:`write_vrma`."""
    skeleton = performance.skeleton
    humanoid = humanoid_from_skeleton(skeleton, f"character {performance.name!r}")
    assert skeleton is not None and performance.joints is not None
    scene, times, joints = GltfScene(name), performance.times, performance.joints
    turns = from_matrix(nearest_rotation(performance.linear))
    if len(times) == 1:
        times, turns, joints = np.array([0.0, _STILL_S]), np.repeat(turns, 2, 0), np.repeat(joints, 2, 0)
    world, nodes = dict[str, Float](), dict[str, int]()
    for bone_name, bone in humanoid.bones.items():
        world[bone_name] = multiply(turns[:, bone.turned_by], conjugate(humanoid.t_pose[bone_name]))
        if bone.parent:
            above = skeleton.positions[humanoid.bones[bone.parent].joint]
            offset = rotate(humanoid.t_pose[bone.parent], skeleton.positions[bone.joint] - above)
            local = multiply(conjugate(world[bone.parent]), world[bone_name])
        else:
            offset = np.array([0.0, skeleton.positions[bone.joint, 1] - _floor_height(skeleton), 0.0])
            local = world[bone_name]
        parent = nodes.get(bone.parent)
        node = scene.node(parent, name=bone_name, children=[], translation=json_numbers(offset))
        nodes[bone_name] = node
        rotations = np.roll(remove_sign_jumps(local[:, None])[:, 0], -1, -1)
        scene.animate(times, node, "rotation", rotations)
        if not bone.parent:
            scene.animate(times, node, "translation", joints[:, bone.joint])
            scene.add_roots(node)
    scene.document.extensionsUsed = [EXTENSION]
    human_bones = {bone_name: {"node": node} for bone_name, node in nodes.items()}
    scene.document.extensions = {
        EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": human_bones}},
    }
    return scene.bytes()


def _floor_height(skeleton: Skeleton) -> float:
    """Returns the height of the floor of the rest pose in metres."""
    heights = skeleton.positions[:, 1]
    low = float(heights.min())
    return low if abs(low) > _MAX_FLOOR_OFFSET * float(np.ptp(heights)) else 0.0
