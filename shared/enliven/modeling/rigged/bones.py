"""Converts a shape to a list of bones with names, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import RiggedCharacter, Skeleton
from enliven.errors import InputError
from enliven.modeling.rigged.spans import Spans


class Bone(NamedTuple):
    """A joint, with the bone that ends there. Edits refer to bones by name, because their numbers may change.

    Attributes:
        name: name of the joint.
        parent: name of the parent joint; "" for the root.
        rest: (3,) metres, the rest position.
        modeling: (4,) the modeling rotation m, which is set by hand. With the animated rotation a, the world
            rotation is D = D_parent m a.
        spans: the parts of the bone, each with the layers that rotate it.
    """

    name: str
    parent: str
    rest: Float
    modeling: Float
    spans: Spans


def list_bones(shape: RiggedCharacter) -> list[Bone]:
    """Returns the bones of a shape, in the order of its joints."""
    skeleton = shape.skeleton
    parents = ["" if parent < 0 else skeleton.names[parent] for parent in skeleton.parents]
    return [
        Bone(name, parent, skeleton.positions[j], shape.modeling[j], shape.spans[j])
        for j, (name, parent) in enumerate(zip(skeleton.names, parents, strict=True))
    ]


def skeleton_of_bones(bones: Sequence[Bone]) -> Skeleton:
    """Builds a skeleton from bones. The root must be first, and every other bone after its parent."""
    number = {bone.name: j for j, bone in enumerate(bones)}
    parents = np.array([number[bone.parent] if bone.parent else -1 for bone in bones], np.int32)
    return Skeleton(tuple(bone.name for bone in bones), parents, np.array([bone.rest for bone in bones]))


def rebuild_shape(shape: RiggedCharacter, bones: Sequence[Bone], **changes: object) -> RiggedCharacter:
    """Returns the shape with the given bones and with ``changes`` of its attributes. A pin is kept if its
    joint still exists."""
    modeling = np.array([bone.modeling for bone in bones])
    spans = tuple(bone.spans for bone in bones)
    names = {bone.name for bone in bones}
    pins = tuple(pin for pin in shape.pins if {pin.joint, pin.start} <= names)
    attributes = {"modeling": modeling, "spans": spans, "pins": pins} | changes
    return shape.with_changes(skeleton=skeleton_of_bones(bones), **attributes)


def bone_numbers_in(
    shape: RiggedCharacter, bones: Sequence[Bone], instead: dict[str, str] | None = None
) -> Int:
    """Returns the number (N,) in ``bones`` of each bone of the shape, or of the bone that replaces it
    (``instead``).
    """
    number = {bone.name: j for j, bone in enumerate(bones)}
    instead = instead or {}
    return np.array([number[instead.get(name, name)] for name in shape.skeleton.names], np.int64)


def bone_number(shape: RiggedCharacter, bone: int | str, *, root: bool = True) -> int:
    """Returns the number of a bone given by number or by the name of its joint.

    Raises:
        InputError: if the bone does not exist, or it is the root and ``root`` is false.
    """
    location = f"shape {shape.id!r}"
    count = len(shape.skeleton)
    j = shape.skeleton.index(bone) if isinstance(bone, str) else int(bone)
    if not 0 <= j < count:
        raise InputError(
            f"bone {j} does not exist: the shape has {count} joints, numbered from 0",
            where=location,
            remedy="Pass the name or the number of a joint of the shape.",
        )
    if j == 0 and not root:
        remedy = "Choose another joint: a bone ends at every joint except the root."
        raise InputError(
            f"no bone ends at the root joint {shape.skeleton.names[0]!r}", where=location, remedy=remedy
        )
    return j


def check_fraction(value: float, where: str) -> float:
    """Returns a relative position along a bone after checking that it lies in [0, 1]."""
    if not 0.0 <= float(value) <= 1.0:
        raise InputError(
            f"{value} is not a position on a bone",
            where=where,
            remedy="Pass a number from 0 (the start of the bone) to 1 (its end).",
        )
    return float(value)
