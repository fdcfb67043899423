"""Inserts nodes into bones and removes them, without changing the motion (AniMesh, section 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, RiggedCharacter, SkinWeights, unused
from enliven.errors import InputError
from enliven.modeling.rigged.bones import (
    Bone,
    bone_number,
    bone_numbers_in,
    check_fraction,
    list_bones,
    rebuild_shape,
)
from enliven.modeling.rigged.posed import with_travel_kept
from enliven.modeling.rigged.spans import (
    NO_BLEND,
    Spans,
    join_consecutive_spans,
    rigid_continuation,
    split_spans,
)
from enliven.modeling.skinning.skins import find_nearest_bone, merge_skins, renumber_bones, upper_part
from enliven.rotation import IDENTITY, multiply

_BLEND_FRACTION = 0.5
"""Distance from a new node over which the two bones blend, as a fraction of the shorter bone. One half of
each bone stays rigid.
"""


def insert_node(
    project: Project,
    shape_id: str,
    bone: int | str,
    at: float,
    *,
    name: str | None = None,
    rigid: bool = False,
) -> tuple[Project, str]:
    """Splits a bone in two. Each half rotates by its part of the motion.

    The total rotation along the chain stays the same at every time, so all descendants of the bone rotate as
    before. The upper bone keeps the modeling rotation.

    Args:
        bone: the number or the joint of the bone.
        at: position on the bone, in (0, 1) from its start to its end.
        name: name of the new joint; None generates one.
        rigid: True to keep the two bones in line at every time. The upper bone then has the whole motion.

    Returns:
        The project and the name of the new joint. The new joint gets the bone's number, and the numbers of
        later joints rise by one.

    Raises:
        InputError: if the bone or position does not exist, or the name is taken.
    """
    shape = project.shape(shape_id)
    j = bone_number(shape, bone, root=False)
    if not 0.0 < check_fraction(at, f"shape {shape_id!r}") < 1.0:
        remedy = "Choose a position between the two ends of the bone."
        raise InputError(
            "a node cannot be inserted at an end of the bone, because a joint is already there",
            where=shape_id,
            remedy=remedy,
        )
    name = new_name(shape, j, name)
    bones = list_bones(shape)
    ridden = frozenset(layer.id for layer in shape.layers if layer.stretch) if rigid else None
    bones[j : j + 1] = split_bone(bones[j], bones, at, name, ridden)
    skin = shape.skin
    if shape.mesh is not None and skin is not None:
        begin, end = shape.skeleton.positions[[int(shape.skeleton.parents[j]), j]]
        part = upper_part(shape.mesh.vertices, begin, end, at, _BLEND_FRACTION)
        skin = merge_skins(renumber_bones(skin, bone_numbers_in(shape, bones)), j, j + 1, part)
    return project.with_characters(rebuild_shape(shape, bones, skin=skin)), name


def new_name(shape: RiggedCharacter, j: int, name: str | None) -> str:
    """Returns a name for a joint on bone j: the given name, or a generated name.

    Raises:
        InputError: if the given name is taken or empty.
    """
    used_names = dict.fromkeys(shape.skeleton.names)
    if name is not None and (name in used_names or not name):
        raise InputError(
            f"the joint name {name!r} is empty or in use",
            where=f"shape {shape.id!r}",
            remedy="Choose another name.",
        )
    return name or unused(f"{shape.skeleton.names[j]} node", used_names)


def split_bone(
    bone: Bone, bones: list[Bone], at: float, name: str, ridden: frozenset[str] | None = None
) -> list[Bone]:
    """Splits one of ``bones`` at a node called ``name``, and returns all bones. The product of the two new
    rotations equals the old rotation.

    If ``ridden`` is given, the upper bone gets the whole rotation. The lower bone is then only stretched, by
    the layers with these ids.
    """
    begin = next(other.rest for other in bones if other.name == bone.parent)
    parted = (
        split_spans(bone.spans, at)
        if ridden is None
        else (bone.spans, rigid_continuation(bone.spans, ridden))
    )
    upper, lower = parted
    modeling, lower = strip_before(IDENTITY, lower)
    first = Bone(name, bone.parent, begin + at * (bone.rest - begin), bone.modeling, upper)
    return [first, Bone(bone.name, name, bone.rest, modeling, lower)]


def strip_before(modeling: Float, spans: Spans) -> tuple[Float, Spans]:
    """Moves the fixed rotation at the start of the spans into the modeling rotation (4,). Returns both. The
    total rotation does not change."""
    first = np.array(spans[0].before)
    return multiply(modeling, first), (replace(spans[0], before=NO_BLEND), *spans[1:])


def remove_node(project: Project, shape_id: str, joint: int | str) -> Project:
    """Removes a joint. Its children attach to its parent joint, and rotate as before.

    If an inner node is removed, its bone and each bone below it become one bone with the motions of both in
    sequence (see ``join_consecutive_spans``). Every bone below keeps its world rotation at every time, even
    if the two bones play different takes. AniMesh drops the motion in that case (section 8, Figure 13).
    Removing a node inserted by :func:`insert_node` restores the bone. A leaf is removed with its bone, and
    the vertices that followed it then follow the parent bone. If several bones start at the removed joint,
    each of them then starts at the parent joint.

    Raises:
        InputError: if the joint is the root, because the whole shape depends on it.
    """
    shape = project.shape(shape_id)
    j = bone_number(shape, joint)
    removed = list_bones(shape)[j]
    location = f"shape {shape_id!r}"
    if j == 0:
        raise InputError(
            f"{removed.name!r} is the root joint, which cannot be removed",
            where=location,
            remedy="To remove the bones below the root, cut them off.",
        )
    bones = [
        _join_bones(removed, bone, shape) if bone.parent == removed.name else bone
        for bone in list_bones(shape)
        if bone.name != removed.name
    ]
    rest = rebuild_shape(shape, bones, skin=_skin_without(shape, j, bones))
    return project.with_characters(with_travel_kept(project, shape, rest))


def _join_bones(upper: Bone, lower: Bone, shape: RiggedCharacter) -> Bone:
    """Returns the bone that replaces two bones if the joint between them is removed."""
    lengths = shape.skeleton.lengths
    first = lengths[shape.skeleton.index(upper.name)]
    total = first + lengths[shape.skeleton.index(lower.name)]
    length_fraction = float(first / total) if total > 0 else 0.5
    spans = join_consecutive_spans(upper.spans, lower.spans, length_fraction, lower.modeling)
    modeling, spans = strip_before(upper.modeling, spans)
    return Bone(lower.name, upper.parent, lower.rest, modeling, spans)


def _skin_without(shape: RiggedCharacter, j: int, bones: list[Bone]) -> SkinWeights | None:
    """Returns the skin with the weights of bone j moved to the nearest bone below it. For a leaf, they move
    to the parent bone."""
    if shape.mesh is None or shape.skin is None:
        return None
    skeleton = shape.skeleton
    parent = int(skeleton.parents[j])
    heirs = np.array(skeleton.children[j] or (parent,))
    nearest = np.zeros(len(shape.mesh.vertices), np.int64)
    if len(heirs) > 1:
        begins = np.tile(skeleton.positions[parent], (len(heirs), 1))
        nearest = find_nearest_bone(shape.mesh.vertices, begins, skeleton.positions[heirs])
    heir = heirs[nearest].astype(np.uint16)
    indices = np.where(shape.skin.indices == j, heir[:, None], shape.skin.indices)
    numbers = bone_numbers_in(shape, bones, {skeleton.names[j]: skeleton.names[heirs[0]]})
    return renumber_bones(SkinWeights(indices, shape.skin.weights), numbers)
