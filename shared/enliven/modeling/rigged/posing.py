"""Poses shapes by hand at any time of their motion. These edits change only modeling rotations and the
shape's position."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.rigged.bones import bone_number
from enliven.modeling.rigged.posed import animation_rotation, compute_pose
from enliven.rotation import IDENTITY, conjugate, multiply, normalized, swing


def set_bone(
    project: Project, shape_id: str, bone: int | str, world: AnyArray, time: float | None = None
) -> Project:
    """Sets a bone's world rotation D_j at ``time`` to ``world`` (4,): m = D_parent^-1 world a^-1.

    The descendants of the bone rotate with it, and its motion continues from there. Bone 0, the root, rotates
    the whole shape.

    Raises:
        InputError: if the bone does not exist, or ``world`` is not a rotation.
    """
    shape, j, turns, _ = _find_posed_bone(project, shape_id, bone, time)
    world = _check_rotation(world, shape_id)
    own_rotation = animation_rotation(turns, shape, j)
    return _with_modeling(
        project,
        shape,
        j,
        multiply(multiply(conjugate(_parent_rotation(turns, shape, j)), world), conjugate(own_rotation)),
    )


def turn_bone(
    project: Project, shape_id: str, bone: int | str, turn: AnyArray, time: float | None = None
) -> Project:
    """Rotates a bone at ``time`` by ``turn`` (4,), in world axes.

    Raises:
        InputError: if the bone does not exist, or ``turn`` is not a rotation.
    """
    shape, j, turns, _ = _find_posed_bone(project, shape_id, bone, time)
    above = _parent_rotation(turns, shape, j)
    turned = multiply(
        multiply(conjugate(above), _check_rotation(turn, shape_id)), multiply(above, shape.modeling[j])
    )
    return _with_modeling(project, shape, j, turned)


def drag_joint(
    project: Project, shape_id: str, joint: int | str, point: AnyArray, time: float | None = None
) -> Project:
    """Points the bone of a joint at ``point`` (3,) at ``time``, by the shortest rotation.

    If the joint is the root, the whole shape is moved to the point instead.

    Raises:
        InputError: if the joint does not exist, or the point is not finite.
    """
    shape, j, _, joints = _find_posed_bone(project, shape_id, joint, time)
    point = _check_point(point, shape_id)
    if j == 0:
        shape = project.shape(shape_id)
        return project.with_characters(shape.with_changes(place=shape.place + point - joints[0]))
    start = joints[int(shape.skeleton.parents[j])]
    target, bone = point - start, joints[j] - start
    if min(np.linalg.norm(target), np.linalg.norm(bone)) < 1e-9:
        return project
    turn = swing(bone / np.linalg.norm(bone), target / np.linalg.norm(target))
    return turn_bone(project, shape_id, j, turn, time)


def _find_posed_bone(
    project: Project, shape_id: str, bone: int | str, time: float | None
) -> tuple[RiggedCharacter, int, Float, Float]:
    shape = project.shape(shape_id)
    return shape, bone_number(shape, bone), *compute_pose(project, shape, time)


def _parent_rotation(turns: Float, shape: RiggedCharacter, j: int) -> Float:
    """Returns the world rotation (4,) of bone j's parent."""
    return turns[int(shape.skeleton.parents[j])] if j else IDENTITY


def _with_modeling(project: Project, shape: RiggedCharacter, j: int, modeling: Float) -> Project:
    changed = np.array(shape.modeling)
    changed[j] = normalized(modeling)
    return project.with_characters(shape.with_changes(modeling=changed))


def _check_rotation(turn: AnyArray, shape_id: str) -> Float:
    turn = np.asarray(turn, np.float64)
    if turn.shape != (4,) or not abs(np.linalg.norm(turn) - 1.0) < 1e-6:
        raise InputError(
            f"{turn} is not a rotation",
            where=f"shape {shape_id!r}",
            remedy="Pass a unit quaternion (w, x, y, z).",
        )
    return turn


def _check_point(point: AnyArray, shape_id: str) -> Float:
    point = np.asarray(point, np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(
            f"{point} is not a valid position",
            where=f"shape {shape_id!r}",
            remedy="Pass three finite numbers in metres.",
        )
    return point
