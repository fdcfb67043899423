"""Cuts a shape along a stroke or a plane, in its pose at a time: both its bones and its mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Project, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.mesh.mesh_cut import cut_by_stroke
from enliven.modeling.mesh.meshes import (
    compute_posed_vertices,
    divide_by_bones,
    match_bone_numbers,
    with_piece,
)
from enliven.modeling.rigged.cutting import split_shape
from enliven.modeling.rigged.posed import pose_with_stretch


class Crossing(NamedTuple):
    """A crossing of a stroke with a bone.

    Attributes:
        bone: number of the bone.
        at: position along the bone, in (0, 1).
        near: True if the bone's start, and therefore the root, lies on the stroke's near side.
    """

    bone: int
    at: float
    near: bool


def cut_shape_along_stroke(
    project: Project,
    shape_id: str,
    stroke: CutSurface,
    time: float | None = None,
    *,
    notes: list[str] | None = None,
) -> tuple[Project, tuple[str, ...]]:
    """Cuts a shape where a stroke crosses its bones at ``time``. Each part below a crossing becomes a
    separate shape.

    Every bone is cut as by ``cut_bone``, so the pose at ``time`` does not change. The mesh is cut along the
    stroke in its pose at ``time``. Each part of the mesh is assigned to the shape with the bones that it
    follows most.

    Args:
        stroke: a ``StrokeCut`` (drawn on an image) or a ``PlaneCut``, in world metres.
        time: seconds of the project's time at which the image was shown; None for the rest pose.
        notes: a list that receives sentences about the closing of the mesh.

    Returns:
        The project, and the ids: first the unchanged id of the shape with the root, then one for each part.

    Raises:
        InputError: if the stroke crosses no bone or crosses a limb twice, or if the mesh cannot be cut.
    """
    shape = project.shape(shape_id)
    pose = pose_with_stretch(project, shape, time)
    crossings = bone_crossings(shape, stroke, pose.joints)
    _check_crossings(shape, crossings)
    edited, upper, lowers = project, shape.with_changes(mesh=None, skin=None), []
    for crossing in crossings:
        j = upper.skeleton.index(shape.skeleton.names[crossing.bone])
        upper, lower = split_shape(edited, upper, j, crossing.at, time, None)
        edited = edited.with_characters(upper, lower)
        lowers.append(lower)
    if shape.mesh is not None and shape.skin is not None:
        cut = cut_by_stroke(
            shape.mesh, shape.skin, stroke, compute_posed_vertices(shape, pose.linear, pose.joints)
        )
        near, far = (cut.near, cut.far) if crossings[0].near else (cut.far, cut.near)
        pieces = divide_by_bones(far, [shape.skeleton.list_subtree(crossing.bone) for crossing in crossings])
        nodes = [lower.skeleton.names[0] for lower in lowers]
        upper = with_piece(upper, near, _upper_numbers(shape, upper, crossings, nodes))
        for k, (lower, piece) in enumerate(zip(lowers, pieces, strict=True)):
            if piece is not None:
                numbers = match_bone_numbers(shape, lower, shape.skeleton.names[crossings[k].bone])
                lowers[k] = with_piece(lower, piece, numbers)
        if notes is not None:
            notes.extend(cut.notes)
    shapes = (upper, *lowers)
    return project.with_characters(*shapes), tuple(part.id for part in shapes)


def bone_crossings(shape: RiggedCharacter, stroke: CutSurface, joints: Float) -> list[Crossing]:
    """Finds the crossings of a stroke with the bones of a shape, by bisection.

    Args:
        joints: (N, 3) metres, positions of the joints when the stroke was drawn.
    """
    crossings = []
    sides = stroke.compute_distances(joints)
    for j in range(1, len(shape.skeleton)):
        parent = int(shape.skeleton.parents[j])
        if (sides[parent] > 0) == (sides[j] > 0):
            continue
        begin, end = joints[parent], joints[j]
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            side = stroke.compute_distances((begin + middle * (end - begin))[None])[0]
            low, high = (middle, high) if (side > 0) == (sides[parent] > 0) else (low, middle)
        middle_fraction = (low + high) / 2
        if stroke.covers((begin + middle_fraction * (end - begin))[None])[0]:
            crossings.append(Crossing(j, middle_fraction, not sides[parent] > 0))
    return crossings


def _check_crossings(shape: RiggedCharacter, crossings: Sequence[Crossing]) -> None:
    """Raises an error if the stroke does not determine which parts are cut off."""
    location, names = f"shape {shape.id!r}", shape.skeleton.names
    if not crossings:
        remedy = "Draw the stroke across a bone of the part that you want to cut off."
        raise InputError("the stroke crosses no bone", where=location, remedy=remedy)
    for crossing in crossings:
        for other in crossings:
            if crossing.bone != other.bone and other.bone in shape.skeleton.list_subtree(crossing.bone):
                problem = (
                    f"the stroke crosses the limb twice: at bone {names[crossing.bone]!r} and, below, at "
                    f"bone {names[other.bone]!r}"
                )
                raise InputError(problem, where=location, remedy="Cut each limb only once per stroke.")
    if len({crossing.near for crossing in crossings}) > 1:
        problem = "the stroke crosses two limbs in opposite directions, so the part to cut off is not clear"
        raise InputError(
            problem, where=location, remedy="Draw a straighter stroke, or cut one limb at a time."
        )


def _upper_numbers(
    old_shape: RiggedCharacter, upper: RiggedCharacter, crossings: Sequence[Crossing], nodes: Sequence[str]
) -> Int:
    """Returns for each old bone the number (N,) of its bone in the upper shape. Bones that were cut off map
    to the remaining half of the cut bone.
    """
    numbers = match_bone_numbers(old_shape, upper, nodes[0])
    for crossing, node in zip(crossings, nodes, strict=True):
        numbers[list(old_shape.skeleton.list_subtree(crossing.bone))] = upper.skeleton.index(node)
    return np.asarray(numbers)
