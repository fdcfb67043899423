"""Cuts a shape in two at a time. No bone moves at that time, and both parts keep moving (AniMesh, section
6)."""

from __future__ import annotations

import numpy as np

from enliven.document import STILL, Project, RiggedCharacter, unused
from enliven.errors import InputError
from enliven.modeling.mesh.mesh_cut import Cut, cut_across_bone
from enliven.modeling.mesh.meshes import match_bone_numbers, with_piece
from enliven.modeling.rigged.bones import Bone, bone_number, check_fraction, list_bones, rebuild_shape
from enliven.modeling.rigged.nodes import insert_node, new_name, split_bone
from enliven.modeling.rigged.posed import (
    animation_rotation,
    compute_pose,
    restore_world_rotations,
    with_travel_kept,
)
from enliven.rotation import conjugate, multiply, normalized

_JOINT_TOLERANCE = 1e-9
"""Maximum distance of a cut from the end of a bone, as a fraction of the bone's length, at which the joint is
cut instead."""


def cut_bone(
    project: Project,
    shape_id: str,
    bone: int | str,
    at: float,
    time: float | None = None,
    *,
    name: str | None = None,
    notes: list[str] | None = None,
) -> tuple[Project, tuple[str, str]]:
    """Cuts a shape in two: an upper shape with the root, and a lower shape with the joints below the cut.

    The bone is split as if a node were inserted, so each half gets its part of the motion. The difference to
    the rotation of the whole bone at ``time`` is added to the modeling rotations (AniMesh, section 6, Figure
    7): m_new = m a_old a_new^-1. So at ``time`` every bone keeps its world rotation and every joint its
    position. At other times all bones except the two halves rotate relative to their parent as before. The
    lower shape's root gets the world rotation of the bone at the cut, and keeps its position at ``time``. It
    no longer follows the upper shape, and has no travel.

    The mesh is cut perpendicular to the bone, and both sides are closed. A vertex that followed a bone of the
    other side follows the bone at the cut. Other weights stay bit-exact.

    Args:
        bone: the number or the joint of the bone.
        at: position on the bone: 0 at its start, which detaches the whole bone from its parent joint; 1 at
            its end, which detaches the children of its joint.
        time: seconds of the project's time; None cuts in the rest pose, as modeled. In that case a node is
            inserted and the shape is cut there, so that a merge in the rest pose restores it.
        name: name of the joint at the cut, the same in both shapes; None generates one. At an end of the bone
            the joint keeps its own name.
        notes: a list that receives sentences about the closing of the mesh.

    Returns:
        The project and the ids of the two shapes. The upper shape keeps ``shape_id``, and the lower shape
            gets a new id.
        Takes and layers stay the same, and both shapes refer to them.

    Raises:
        InputError: if the bone or position does not exist, the cut leaves one side without a bone, or the
            mesh cannot be cut there.
    """
    shape = project.shape(shape_id)
    j = bone_number(shape, bone, root=False)
    at = check_fraction(at, f"shape {shape_id!r}")
    upper, lower = split_shape(project, shape, j, at, time, name)
    if shape.mesh is not None and shape.skin is not None:
        cut = cut_across_bone(shape.mesh, shape.skin, shape.skeleton, j, at)
        upper, lower = assign_cut_sides(shape, upper, lower, cut)
        if notes is not None:
            notes.extend(cut.notes)
    return project.with_characters(upper, lower), (upper.id, lower.id)


def split_shape(
    project: Project, shape: RiggedCharacter, j: int, at: float, time: float | None, name: str | None
) -> tuple[RiggedCharacter, RiggedCharacter]:
    """Returns the two shapes of a cut, without meshes. The lower shape has a new id. See :func:`cut_bone`."""
    shape = shape.with_changes(mesh=None, skin=None)
    project = project.with_characters(shape)
    lower_id = unused(shape.id, project.characters)
    if time is None and _JOINT_TOLERANCE < at < 1.0 - _JOINT_TOLERANCE:
        # The rest pose has no motion that must be compensated, so insert a node and cut at that node.
        project, _ = insert_node(project, shape.id, j, at, name=name)
        shape, at = project.shape(shape.id), 1.0
    turns, joints = compute_pose(project, shape, time)
    parent = int(shape.skeleton.parents[j])
    above, place = (parent, joints[parent]) if at <= _JOINT_TOLERANCE else (j, joints[j])
    if at <= _JOINT_TOLERANCE:
        upper, lower = _cut_before_bone(shape, j)
    elif at >= 1.0 - _JOINT_TOLERANCE:
        upper, lower = _cut_at_joint(shape, j)
    else:
        assert time is not None
        upper, lower = _split_bone(project, shape, j, at, time, new_name(shape, j, name))
        place = joints[parent] + at * (joints[j] - joints[parent])
    _refuse_boneless(shape, upper, lower)
    lower[0] = Bone(lower[0].name, "", lower[0].rest, turns[above], STILL)
    place = place - lower[0].rest
    first = with_travel_kept(project, shape, rebuild_shape(shape, upper))
    if shape.pins:
        first = restore_world_rotations(project, first, shape, turns, time)
    second = rebuild_shape(shape, lower, id=lower_id, place=place, travel=None, travel_scale=None)
    if shape.pins:
        second = restore_world_rotations(project, second, shape, turns, time)
    return first, second


def assign_cut_sides(
    old_shape: RiggedCharacter, upper: RiggedCharacter, lower: RiggedCharacter, cut: Cut
) -> tuple[RiggedCharacter, RiggedCharacter]:
    """Assigns the two sides of a cut mesh to the two shapes. The near side goes to the upper shape."""
    node = lower.skeleton.names[0]
    # In the lower shape, vertices that followed bones above the cut need a new bone. If the cut is inside a
    # bone, they follow the lower half of that bone, and otherwise the root.
    first = lower.skeleton.names[0 if node in old_shape.skeleton.names else 1]
    return (
        with_piece(upper, cut.near, match_bone_numbers(old_shape, upper, node)),
        with_piece(lower, cut.far, match_bone_numbers(old_shape, lower, first)),
    )


Halves = tuple[list[Bone], list[Bone]]
"""The bones of the two shapes of a cut: upper and lower. The first lower bone is the joint at the cut, which
becomes the lower root."""


def _cut_before_bone(shape: RiggedCharacter, j: int) -> Halves:
    """Separates bone j and its descendants from the other bones."""
    bones = list_bones(shape)
    cut_joints = set(shape.skeleton.list_subtree(j))
    lower = [bone for i, bone in enumerate(bones) if i in cut_joints]
    return [bone for i, bone in enumerate(bones) if i not in cut_joints], [
        bones[shape.skeleton.parents[j]],
        *lower,
    ]


def _cut_at_joint(shape: RiggedCharacter, j: int) -> Halves:
    """Separates the descendants of joint j from the other bones."""
    bones = list_bones(shape)
    cut_joints = set(shape.skeleton.list_subtree(j)) - {j}
    lower = [bone for i, bone in enumerate(bones) if i in cut_joints]
    return [bone for i, bone in enumerate(bones) if i not in cut_joints], [bones[j], *lower]


def _split_bone(
    project: Project, shape: RiggedCharacter, j: int, at: float, time: float, name: str
) -> Halves:
    """Returns the bones above and below a cut inside bone j, with compensation for the lost part of their
    motion."""
    bones = list_bones(shape)
    bones[j : j + 1] = split_bone(bones[j], bones, at, name)
    node = rebuild_shape(shape, bones)
    old = animation_rotation(compute_pose(project, shape, time)[0], shape, j)
    turns, _ = compute_pose(project, node, time)
    first, second = animation_rotation(turns, node, j), animation_rotation(turns, node, j + 1)
    # The upper half must rotate as the whole bone did, so its rotation is m a_old a_new^-1. The lower root
    # passes that rotation on to the lower half, so the lower half's own motion is inverted.
    upper_modeling = multiply(multiply(shape.modeling[j], old), conjugate(first))
    bones[j] = bones[j]._replace(modeling=normalized(upper_modeling))
    bones[j + 1] = bones[j + 1]._replace(modeling=normalized(conjugate(second)))
    upper, lower = _cut_at_joint(node.with_changes(modeling=np.array([bone.modeling for bone in bones])), j)
    return upper, lower


def _refuse_boneless(shape: RiggedCharacter, upper: list[Bone], lower: list[Bone]) -> None:
    """Raises an error if a side of the cut is a single joint without bones."""
    for bones, side in ((upper, "above"), (lower, "below")):
        if len(bones) < 2:
            problem = f"the cut at {bones[0].name!r} would leave no bone {side} the cut"
            raise InputError(
                problem,
                where=f"shape {shape.id!r}",
                remedy="Cut in the middle of a bone, or remove the node instead.",
            )
