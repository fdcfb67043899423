"""How feet stand while clips play: found, always held, never held, or kept above the floor."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.document import Project
from enliven.errors import InputError
from enliven.mapping import with_feet_pinned
from enliven.modeling.edits.characters import change_layers


def lock_feet(project: Project, shape_id: str, numbers: Iterable[int], feet: str) -> Project:
    """A project in which feet stand in one way while layers of a shape play.

    Where no foot is pinned yet, the ends of all legs are.

    Args:
        numbers: of the layers.
        feet: "auto", "always", "never" or "ground"; see :mod:`enliven.motion.layers.footing`.

    Raises:
        InputError: where there is no such shape, layer or way, or no leg is found.
    """
    project = change_layers(project, shape_id, numbers, feet=feet)
    shape = project.shape(shape_id)
    if feet == "auto" or shape.pins:
        return project
    project = with_feet_pinned(project, shape)
    if not project.shape(shape_id).pins:
        mend = "Choose the node of an ankle and pin it first (P)."
        raise InputError("no leg is found that could stand", where=shape.where, mend=mend)
    return project
