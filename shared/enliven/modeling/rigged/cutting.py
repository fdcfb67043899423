"""Cuts a shape in two at a moment: nothing moves then, and both keep moving (AniMesh, section 6)."""

from __future__ import annotations

import numpy as np

from enliven.document import STILL, Project, Shape, unused
from enliven.errors import InputError
from enliven.modeling.mesh import Cut, cut_across_bone, numbers_in, with_piece
from enliven.modeling.rigged.bones import Bone, bone_number, bones_of, inside, rebuilt
from enliven.modeling.rigged.nodes import divided, insert_node, new_name
from enliven.modeling.rigged.posed import held_at, own_turn, posed, with_travel_kept
from enliven.rotation import conjugate, multiply, normalized

_END = 1e-9
"""Nearer than this share of a bone to its end, a cut is at the joint."""


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
    """A shape becomes two: one with its root, and one with the joints below the cut.

    The bone is split as by a node, so each part of it gets its part of the motion. The difference to what the
    whole bone had turned at ``time`` goes into the modeling rotations (AniMesh, section 6, Figure 7): m_new =
    m a_old a_new^-1. So at ``time`` every bone keeps its world turn and every joint its place; at other
    times all bones but the two halves turn against the bone before them as they did. The lower shape's root
    takes over the world turn of the bone at the cut, and stays where it was at ``time``: it no longer rides
    on the upper shape, nor travels.

    The mesh is cut square to the bone, both sides are closed, and a vertex that followed a bone of the other
    side follows the one at the cut; weights are otherwise those of before, to the bit.

    Args:
        bone: the number or the joint of the bone.
        at: where on it: 0 at its begin, where the whole bone comes off the joint before it; 1 at its end,
            where what hangs on its joint comes off.
        time: seconds of the project's time; None cuts in the rest pose, as modeled: a node is put in, and
            the shape cut there, so that a merge in the rest pose makes it whole.
        name: of the joint at the cut, the same in both shapes; None makes one up. At an end it is the
            joint's own.
        notes: takes sentences about how the mesh was closed.

    Returns:
        The project and the ids of the two: the upper keeps ``shape_id``, the lower gets a new one. Takes and
        layers are those of before, and both shapes refer to them.

    Raises:
        InputError: for a bone or place that is not there, a cut that leaves one side without a bone, or a
            mesh that cannot be cut there.
    """
    shape = project.shape(shape_id)
    j = bone_number(shape, bone, root=False)
    at = inside(at, f"shape {shape_id!r}")
    upper, lower = parted_at(project, shape, j, at, time, name)
    if shape.mesh is not None and shape.skin is not None:
        cut = cut_across_bone(shape.mesh, shape.skin, shape.skeleton, j, at)
        upper, lower = with_cut(shape, upper, lower, cut)
        if notes is not None:
            notes.extend(cut.notes)
    return project.with_characters(upper, lower), (upper.id, lower.id)


def parted_at(
    project: Project, shape: Shape, j: int, at: float, time: float | None, name: str | None
) -> tuple[Shape, Shape]:
    """The two shapes of a cut, without meshes; the lower one's id is new. See :func:`cut_bone`."""
    shape = shape.with_changes(mesh=None, skin=None)
    project = project.with_characters(shape)
    lower_id = unused(shape.id, project.characters)
    if time is None and _END < at < 1.0 - _END:
        # In the rest pose there is no motion to put back: a node, and the cut there.
        project, _ = insert_node(project, shape.id, j, at, name=name)
        shape, at = project.shape(shape.id), 1.0
    turns, joints = posed(project, shape, time)
    parent = int(shape.skeleton.parents[j])
    above, place = (parent, joints[parent]) if at <= _END else (j, joints[j])
    if at <= _END:
        upper, lower = _at_begin(shape, j)
    elif at >= 1.0 - _END:
        upper, lower = _at_end(shape, j)
    else:
        assert time is not None
        upper, lower = _between(project, shape, j, at, time, new_name(shape, j, name))
        place = joints[parent] + at * (joints[j] - joints[parent])
    _refuse_bare(shape, upper, lower)
    lower[0] = Bone(lower[0].name, "", lower[0].rest, turns[above], STILL)
    place = place - lower[0].rest
    first = with_travel_kept(project, shape, rebuilt(shape, upper))
    if shape.pins:
        first = held_at(project, first, shape, turns, time)
    second = rebuilt(shape, lower, id=lower_id, place=place, travel=None, travel_scale=None)
    if shape.pins:
        second = held_at(project, second, shape, turns, time)
    return first, second


def with_cut(before: Shape, upper: Shape, lower: Shape, cut: Cut) -> tuple[Shape, Shape]:
    """The two shapes with the two sides of a mesh cut along a bone, the near one the upper's."""
    node = lower.skeleton.names[0]
    # Inside a bone, what followed the bones above goes with the lower half; at a joint, with the root.
    first = lower.skeleton.names[0 if node in before.skeleton.names else 1]
    return (
        with_piece(upper, cut.near, numbers_in(before, upper, node)),
        with_piece(lower, cut.far, numbers_in(before, lower, first)),
    )


Halves = tuple[list[Bone], list[Bone]]
"""The bones of the two shapes; the first of the lower one is the joint at the cut, which becomes its root."""


def _at_begin(shape: Shape, j: int) -> Halves:
    """The bones without bone j and its descendants, and these."""
    bones = bones_of(shape)
    off = set(shape.skeleton.below(j))
    lower = [bone for i, bone in enumerate(bones) if i in off]
    return [bone for i, bone in enumerate(bones) if i not in off], [bones[shape.skeleton.parents[j]], *lower]


def _at_end(shape: Shape, j: int) -> Halves:
    """The bones down to joint j, and its descendants."""
    bones = bones_of(shape)
    off = set(shape.skeleton.below(j)) - {j}
    lower = [bone for i, bone in enumerate(bones) if i in off]
    return [bone for i, bone in enumerate(bones) if i not in off], [bones[j], *lower]


def _between(project: Project, shape: Shape, j: int, at: float, time: float, name: str) -> Halves:
    """The bones above and below a cut inside bone j, with what the cut takes from their motion put back."""
    bones = bones_of(shape)
    bones[j : j + 1] = divided(bones[j], bones, at, name)
    node = rebuilt(shape, bones)
    old = own_turn(posed(project, shape, time)[0], shape, j)
    turns, _ = posed(project, node, time)
    first, second = own_turn(turns, node, j), own_turn(turns, node, j + 1)
    # The upper half turns as the whole did: m a_old a_new^-1. The root below it brings that turn to the
    # lower half, whose own motion is taken back.
    kept = multiply(multiply(shape.modeling[j], old), conjugate(first))
    bones[j] = bones[j]._replace(modeling=normalized(kept))
    bones[j + 1] = bones[j + 1]._replace(modeling=normalized(conjugate(second)))
    upper, lower = _at_end(node.with_changes(modeling=np.array([bone.modeling for bone in bones])), j)
    return upper, lower


def _refuse_bare(shape: Shape, upper: list[Bone], lower: list[Bone]) -> None:
    """Refuses a cut that leaves a joint alone."""
    for bones, side in ((upper, "above"), (lower, "below")):
        if len(bones) < 2:
            what = f"no bone would be left {side} the cut at {bones[0].name!r}"
            raise InputError(what, where=f"shape {shape.id!r}", mend="Cut inside a bone, or remove the node.")
