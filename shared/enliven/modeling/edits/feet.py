"""The foot lock mode of clips, for every rig: automatic, always locked, never locked, or kept above the
floor."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.document import GraphCharacter, Layer, Project, RigBase
from enliven.errors import InputError
from enliven.mapping.automatic_mapping import pin_all_feet
from enliven.modeling.edits.characters import change_layers
from enliven.modeling.edits.graph_feet import graph_foot_lock_mode, stand


def foot_lock_mode(character: RigBase, number: int) -> str | None:
    """Returns the foot lock mode of a character's layer, or None if the layer has no foot lock."""
    if isinstance(character, GraphCharacter):
        return graph_foot_lock_mode(character, number) if number < len(character.parts) else None
    layer = character.playing[number]
    return layer.feet if isinstance(layer, Layer) else None


def lock_feet(project: Project, character_id: str, numbers: Iterable[int], feet: str) -> Project:
    """Sets the foot lock mode of layers of a character.

    In a shape with bones and without pins, the ends of all legs are pinned. In a possessed mesh, a layer on
    top of the current motion locks the feet. A repeated call detects the feet again.

    Args:
        numbers: numbers of the layers.
        feet: "auto", "always", "never" or "ground"; see :mod:`enliven.motion.layers.footing`.

    Raises:
        InputError: if the character, layer or mode does not exist, or no foot is found. Also for a puppet,
            because its feet are locked by its own contacts.
    """
    character = project.character(character_id)
    if isinstance(character, GraphCharacter):
        return stand(project, character_id, numbers, feet)
    if not character.locks_feet:
        remedy = (
            "Change the puppet's contacts in the floor row of the timeline, or mark control points as feet."
        )
        raise InputError(
            "a puppet has no foot lock mode, because its contacts lock its feet",
            where=character.where,
            remedy=remedy,
        )
    return _with_foot_locks(project, character_id, numbers, feet)


def _with_foot_locks(project: Project, shape_id: str, numbers: Iterable[int], feet: str) -> Project:
    """Sets the foot lock mode of a shape with bones."""
    project = change_layers(project, shape_id, numbers, feet=feet)
    shape = project.shape(shape_id)
    if feet == "auto" or shape.pins:
        return project
    project = pin_all_feet(project, shape)
    if not project.shape(shape_id).pins:
        remedy = "Select the ankle node of a leg and pin it (P). Then choose the foot lock again."
        raise InputError("no leg with a foot on the floor was found", where=shape.where, remedy=remedy)
    return project
