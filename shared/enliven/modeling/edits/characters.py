"""Edits of one character. Each edit is a function from a project to a new project, and works with every rig.

    project, copied = copy_character(project, "chair", offset=(1, 0, 0), delay=0.5)
    project = mirror_character(project, copied, (1, 0, 0))
    project, parts = cut_character(project, "cactus", PlaneCut(point, normal), time)

An invalid edit raises InputError and changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import LayerBase, Project, RigBase, are_identical, unused
from enliven.errors import InputError
from enliven.modeling.edits.rigs import get_rig_edits, handle_number
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.rig import check_names
from enliven.modeling.rigged.axes import Axes
from enliven.rotation import IDENTITY

_ORIGIN = (0.0, 0.0, 0.0)
"""The zero vector in metres: the default for offsets and positions."""


def copy_character(
    project: Project,
    character_id: str,
    *,
    offset: AnyArray | Sequence[float] = _ORIGIN,
    delay: float = 0.0,
) -> tuple[Project, str]:
    """Copies a character, and returns the project and the copy's id. The copy plays the same takes.

    Args:
        offset: (3,) metres from the character to its copy.
        delay: seconds, the delay of the copy's motion.
    """
    return paste_character(project, project, character_id, offset=offset, delay=delay)


def paste_character(
    project: Project,
    source: Project,
    character_id: str,
    *,
    offset: AnyArray | Sequence[float] = _ORIGIN,
    delay: float = 0.0,
) -> tuple[Project, str]:
    """Copies a character from another project with its motion, and returns the project and the copy's id.

    Takes and streams with identical contents that the project already has are reused. All others are copied.

    Raises:
        InputError: if the character does not exist, or the offset or delay is not a number.
    """
    character = source.character(character_id)
    shift = np.asarray(offset, np.float64)
    if shift.shape != (3,) or not np.isfinite(shift).all() or not np.isfinite(delay):
        problem = f"the offset {offset} m or the delay {delay} s of the copy is not valid"
        raise InputError(
            problem,
            where=character.where,
            remedy=(
                "Pass three finite numbers in metres as the offset, and a finite number of seconds as "
                "the delay."
            ),
        )
    project, names = _with_takes_of(project, source, character)
    copy = character.with_takes_named(names).with_changes(id=unused(character_id, project.characters))
    copy = get_rig_edits(copy).move(
        copy if delay == 0.0 else copy.delay_motion(delay), shift, IDENTITY, np.zeros(3)
    )
    return project.with_characters(copy), copy.id


def delete_character(project: Project, character_id: str) -> Project:
    """Deletes a character. The takes that it played remain in the project.

    Raises:
        InputError: if the character does not exist.
    """
    return project.drop_character(character_id)


def rename_character(project: Project, character_id: str, new_name: str) -> Project:
    """Renames a character, and keeps its position in the project's list of characters.

    Raises:
        InputError: if the character does not exist, or the name is taken.
    """
    character = project.character(character_id)
    if new_name == character_id:
        return project
    if not new_name or new_name in project.characters:
        problem = (
            f"another character already has the name {new_name!r}" if new_name else "the new name is empty"
        )
        raise InputError(problem, where=character.where, remedy="Choose another name.")
    renamed = {
        (new_name if key == character_id else key): (
            other.with_changes(id=new_name) if other is character else other
        )
        for key, other in project.characters.items()
    }
    handling = {(new_name if key == character_id else key): value for key, value in project.handling.items()}
    return replace(project, characters=renamed, handling=handling)


def move_character(
    project: Project,
    character_id: str,
    offset: AnyArray | Sequence[float],
    turn: AnyArray = IDENTITY,
    about: AnyArray | Sequence[float] = _ORIGIN,
) -> Project:
    """Moves a character at every time: x becomes turn (x - about) + about + offset.

    Args:
        offset: (3,) displacement in metres.
        turn: (4,) rotation as a unit quaternion (w, x, y, z).
        about: (3,) metres, the fixed point of the rotation.

    Raises:
        InputError: if the character does not exist, or a number is not finite.
    """
    character = project.character(character_id)
    shift, centre = np.asarray(offset, np.float64), np.asarray(about, np.float64)
    turn = np.asarray(turn, np.float64)
    is_valid = shift.shape == centre.shape == (3,) and turn.shape == (4,)
    if not (is_valid and np.isfinite([*shift, *centre]).all() and abs(np.linalg.norm(turn) - 1.0) < 1e-6):
        raise InputError(
            f"the displacement {offset} or the rotation {turn} is not valid",
            where=character.where,
            remedy="Pass three finite numbers in metres and a unit quaternion (w, x, y, z).",
        )
    return project.with_characters(get_rig_edits(character).move(character, shift, turn, centre))


def turn_character(project: Project, character_id: str, turn: AnyArray) -> Project:
    """Rotates a character by the unit quaternion ``turn`` (4,) about its centre, at every time.

    Raises:
        InputError: if the character does not exist, or the rotation is not a unit quaternion.
    """
    character = project.character(character_id)
    return move_character(project, character_id, _ORIGIN, turn, get_rig_edits(character).centre(character))


def scale_character(project: Project, character_id: str, factor: float) -> Project:
    """Scales a character and the length of its strides by ``factor``, about its centre.

    Raises:
        InputError: if the character does not exist, or the factor is not above zero.
    """
    character = project.character(character_id)
    if not (np.isfinite(factor) and factor > 0.0):
        remedy = "Pass a factor above 0. To mirror the character, use mirror_character."
        raise InputError(f"a character cannot be scaled by {factor}", where=character.where, remedy=remedy)
    return project.with_characters(get_rig_edits(character).scale(character, float(factor)))


def mirror_character(project: Project, character_id: str, normal: AnyArray | Sequence[float]) -> Project:
    """Mirrors a character, at every time, in the plane through its centre with the normal ``normal`` (3,).

    To keep the original, copy the character first.

    Raises:
        InputError: if the character does not exist, or the normal is zero.
    """
    character = project.character(character_id)
    axes = Axes.mirror(np.asarray(normal, np.float64))
    return project.with_characters(get_rig_edits(character).mirror(project, character, axes))


def shift_character(project: Project, character_id: str, delay: float) -> Project:
    """Delays all motion of a character by ``delay`` seconds.

    Raises:
        InputError: if the character does not exist, or the delay is not a number.
    """
    return project.with_characters(project.character(character_id).delay_motion(delay))


def change_layers(project: Project, character_id: str, numbers: Iterable[int], **changes: Any) -> Project:
    """Changes attributes of a character's layers, such as offset, speed, loop or muted.

    All layers in ``numbers`` must have these attributes.

    Raises:
        InputError: if the character or layer does not exist, or a layer cannot be played with these values.
    """
    character, wanted_numbers = project.character(character_id), set(numbers)
    _check_layers(character, wanted_numbers)
    layers = (
        _change_layer(layer, changes) if number in wanted_numbers else layer
        for number, layer in enumerate(character.playing)
    )
    changed_layers = character.with_playing(*layers)
    get_rig_edits(changed_layers).check_layers(project, changed_layers, wanted_numbers)
    return project.with_characters(changed_layers)


def remove_layer(project: Project, character_id: str, number: int) -> Project:
    """Removes a layer of a character. Its take remains in the project.

    Raises:
        InputError: if the character or layer does not exist, or the character would have no motion without
            the layer.
    """
    character = project.character(character_id)
    _check_layers(character, {number})
    return project.with_characters(character.without_layer(number))


def drag_handle(
    project: Project,
    character_id: str,
    handle: int | str,
    place: AnyArray | Sequence[float],
    time: float,
) -> Project:
    """Moves one handle of a character to ``place`` at ``time``, and poses the character accordingly.

    Args:
        handle: a joint or a control point, given by number or name.
        place: (3,) metres in the world.

    Raises:
        InputError: if the character or handle does not exist, ``place`` is not finite, or the character's
            motion cannot be posed by hand.
    """
    character, target = project.character(character_id), np.asarray(place, np.float64)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise InputError(
            f"{place} is not a valid position",
            where=character.where,
            remedy="Pass three finite numbers in metres.",
        )
    return get_rig_edits(character).drag_handle(
        project, character, handle_number(character, handle), target, time
    )


def cut_character(
    project: Project, character_id: str, stroke: CutSurface, time: float, *, notes: list[str] | None = None
) -> tuple[Project, tuple[str, ...]]:
    """Cuts a character along a stroke, in its pose at ``time``. All parts keep moving.

    Args:
        stroke: a ``StrokeCut`` (drawn on an image) or a ``PlaneCut``, in world metres.
        time: seconds of the project's time.
        notes: a list that receives sentences about the closing of the mesh and about approximations.

    Returns:
        The project, and the ids of the parts: the first part keeps ``character_id``, and the others get new
            ids.

    Raises:
        InputError: if the character does not exist, or the stroke cuts nothing off.
    """
    rig, messages = get_rig_edits(project.character(character_id)), [] if notes is None else notes
    return rig.cut(project, character_id, stroke, time, notes=messages)


def _with_takes_of(
    project: Project, source: Project, character: RigBase
) -> tuple[Project, dict[tuple[str, str], str]]:
    """Adds the takes that a character plays in another project (``source``).

    Returns:
        The project, and a dictionary with the new id of each take. Its keys are the name of the take's
            collection and the take's old id.
    """
    ids: dict[tuple[str, str], str] = {}
    for collection, names in character.find_needed_ids().items():
        for name in sorted(names):
            new_takes, take = getattr(project, collection), getattr(source, collection)[name]
            if name not in new_takes or not are_identical(new_takes[name], take):
                take = replace(take, id=unused(name, new_takes))
                project = replace(project, **{collection: {**new_takes, take.id: take}})
            ids[collection, name] = take.id
    return project, ids


def _check_layers(character: RigBase, numbers: set[int]) -> None:
    """Raises InputError if a layer number does not exist."""
    count = len(character.playing)
    missing = numbers - set(range(count))
    if missing:
        problem = f"the character has no layer {min(missing)}"
        raise InputError(
            problem,
            where=character.where,
            remedy=f"The layers are numbered from 0. Number of layers: {count}.",
        )


def _change_layer(layer: LayerBase, changes: dict[str, Any]) -> LayerBase:
    check_names(changes, type(layer), f"layer of {layer.take!r}")
    return replace(layer, **changes)
