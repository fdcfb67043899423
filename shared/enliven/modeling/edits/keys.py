"""Edits of keyframes on top of motion: for a bone, for a node of a possessed mesh, or for a whole character.

    project = set_key(project, "squid", "arm", 1.2, (0.0, 30.0, 0.0))     # a bone: degrees
    project = set_key(project, "chair", 17, 0.8, metres=(0.0, 0.2, 0.0))  # a node: the mesh bends around it
    project = set_key(project, "bean", None, 2.0, metres=(1.0, 0.0, 0.0)) # the whole character

The keys of a bone, a node or a whole character form a separate take, which an ordinary layer plays. So they
can be muted, weighted, shifted, stretched, copied, cut and exported like other layers. The rotation and
displacement of a key are added to the motion of the bone or node, in its own axes. A key of a whole character
acts in world axes, about the character's position when its first key was set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.document import (
    KEY_STEP,
    Clip,
    GraphLayer,
    LayerBase,
    MotionKey,
    PoseStream,
    Project,
    RigBase,
    RootLayer,
    clip_from_keys,
    key_values,
    make_keyed_stream,
    unused,
)
from enliven.errors import InputError
from enliven.modeling.edits.characters import remove_layer
from enliven.modeling.edits.rigs import get_rig_edits

Handle = int | str | None
"""The target of keys: a bone by number or name, a node by number, or None for the whole character."""
Three = Sequence[float]


def key_layer(project: Project, character_id: str, handle: Handle) -> int | None:
    """Returns the number of the layer that plays the keys of a handle, or None if it has no keys."""
    character = project.character(character_id)
    if handle is not None:
        rig_edits = get_rig_edits(character)
        return rig_edits.key_layer(project, character, rig_edits.find_keyable(character, handle))
    first = len(character.playing) - len(character.root_layers)
    key_layers = (
        number for number, layer in enumerate(character.root_layers) if project.takes[layer.take].keys
    )
    return next((first + number for number in key_layers), None)


def find_keys(project: Project, character_id: str, handle: Handle) -> tuple[tuple[float, MotionKey], ...]:
    """Returns the keys of a handle, each with the time in seconds of the project at which it plays."""
    number = key_layer(project, character_id, handle)
    if number is None:
        return ()
    layer = project.character(character_id).playing[number]
    take = _make_keyed_take(project, layer)
    return tuple((layer.time_of(key.second, take.duration), key) for key in take.keys)


def key_at(project: Project, character_id: str, handle: Handle, time: float) -> MotionKey:
    """Returns the key of a handle at a time, with interpolated rotation and displacement."""
    number = key_layer(project, character_id, handle)
    if number is None:
        return MotionKey(max(float(time), 0.0))
    layer = project.character(character_id).playing[number]
    take = _make_keyed_take(project, layer)
    second = layer.find_played_time(time, take.duration)[0]
    exact = [key for key in take.keys if abs(key.second - second) < 1e-6]
    if exact:
        return exact[0]
    values = key_values(take.keys, np.array([second]))[0].tolist()
    return MotionKey(second, tuple(values[:3]), metres=tuple(values[3:]))


def set_key(
    project: Project,
    character_id: str,
    handle: Handle,
    time: float,
    degrees: Three | None = None,
    ease: str | None = None,
    metres: Three | None = None,
) -> Project:
    """Sets a key of a handle at a time. It replaces a key on the same frame.

    Args:
        degrees, metres: rotation and displacement; None keeps the interpolated values.
        ease: interpolation to the next key. None keeps the value of a replaced key; for a new key it is
            "smooth".

    Raises:
        InputError: if the handle does not exist or cannot have keys, or if the numbers do not form a key.
    """
    character, number = project.character(character_id), key_layer(project, character_id, handle)
    new_key = _change_key(key_at(project, character_id, handle, time), degrees, metres)
    _refuse_displacement(character, handle, new_key)
    if number is None:
        new_key = replace(new_key, ease=ease or "smooth")
        if handle is not None:
            handle_index = get_rig_edits(character).find_keyable(character, handle)
            return get_rig_edits(character).with_key_layer(project, character, handle_index, new_key)
        return _with_root_layer(project, character, new_key)
    layer = character.playing[number]
    key_seconds = _second_in_keys(project, layer, time)
    keys = _make_keyed_take(project, layer).keys
    same_frame = [key for key in keys if _frame_at(key.second) == _frame_at(key_seconds)]
    new_key = replace(
        new_key, second=key_seconds, ease=ease or (same_frame[0].ease if same_frame else "smooth")
    )
    return _with_keys(
        project, character_id, number, (*(key for key in keys if key not in same_frame), new_key)
    )


def move_key(
    project: Project,
    character_id: str,
    handle: Handle,
    key: int,
    time: float,
    degrees: Three | None = None,
    metres: Three | None = None,
) -> Project:
    """Moves a key of a handle to another time, or changes its degrees or metres. None leaves them unchanged.

    Raises:
        InputError: if the key does not exist, or another key is on the same frame.
    """
    layer_number, old_key = _find_key(project, character_id, handle, key)
    character = project.character(character_id)
    layer = character.playing[layer_number]
    moved_key = replace(_change_key(old_key, degrees, metres), second=_second_in_keys(project, layer, time))
    _refuse_displacement(character, handle, moved_key)
    other_keys = [other for other in _make_keyed_take(project, layer).keys if other is not old_key]
    return _with_keys(project, character_id, layer_number, (*other_keys, moved_key))


def ease_key(project: Project, character_id: str, handle: Handle, key: int, ease: str) -> Project:
    """Changes the interpolation from a key to the next: "smooth", "linear" or "step".

    Raises:
        InputError: if the key or interpolation does not exist.
    """
    number, old_key = _find_key(project, character_id, handle, key)
    keys = _make_keyed_take(project, project.character(character_id).playing[number]).keys
    changed_key = [replace(other, ease=ease) if other is old_key else other for other in keys]
    return _with_keys(project, character_id, number, changed_key)


def remove_key(project: Project, character_id: str, handle: Handle, key: int) -> Project:
    """Removes a key of a handle. Removing the last key also removes its layer and its take.

    Raises:
        InputError: if the key does not exist.
    """
    number, old_key = _find_key(project, character_id, handle, key)
    layer = project.character(character_id).playing[number]
    remaining = [other for other in _make_keyed_take(project, layer).keys if other is not old_key]
    if remaining:
        return _with_keys(project, character_id, number, remaining)
    project = remove_layer(project, character_id, number)
    if any(
        layer.take in character.find_needed_ids()[layer.source] for character in project.characters.values()
    ):
        return project
    takes = getattr(project, layer.source)
    return replace(project, **{layer.source: {key: take for key, take in takes.items() if key != layer.take}})


def _change_key(key: MotionKey, degrees: Three | None, metres: Three | None) -> MotionKey:
    """Returns the key with rotation and displacement replaced. None keeps a value."""
    new_degrees: Any = key.degrees if degrees is None else tuple(degrees)
    new_metres: Any = key.metres if metres is None else tuple(metres)
    return replace(key, degrees=new_degrees, metres=new_metres)


def _refuse_displacement(character: RigBase, handle: Handle, key: MotionKey) -> None:
    """Raises an error if a bone's key has a displacement, because a bone is fixed to its parent."""
    if character.jointed and handle is not None and any(key.metres):
        remedy = "Set degrees only, or set a key that moves the whole character."
        raise InputError(
            "the key of a bone contains a displacement, but a bone can only rotate",
            where=character.where,
            remedy=remedy,
        )


def _frame_at(second: float) -> int:
    return round(second / KEY_STEP)


def _make_keyed_take(project: Project, layer: LayerBase) -> Clip | PoseStream:
    """Returns the take of keys that a layer plays."""
    take: Clip | PoseStream = getattr(project, layer.source)[layer.take]
    return take


def _find_key(project: Project, character_id: str, handle: Handle, key: int) -> tuple[int, MotionKey]:
    """Returns the number of the layer with a handle's keys, and the key with number ``key``."""
    number = key_layer(project, character_id, handle)
    layer = None if number is None else project.character(character_id).playing[number]
    keys = () if layer is None else _make_keyed_take(project, layer).keys
    if number is None or not 0 <= key < len(keys):
        remedy = f"The keys are numbered from 0. Number of keys: {len(keys)}."
        location = f"{character_id!r}" if handle is None else f"{handle!r} of {character_id!r}"
        raise InputError(f"key {key} does not exist", where=location, remedy=remedy)
    return number, keys[key]


def _second_in_keys(project: Project, layer: LayerBase, time: float) -> float:
    """Converts a time of the project to the time within a layer's take of keys, both in seconds. The result
    may be later than the last key.

    Raises:
        InputError: if the time is before the start of the keys.
    """
    if layer.segments or layer.loop or layer.speed < 0.0:
        return layer.find_played_time(time, project.length_of(layer))[0]
    second = (layer.convert_to_unwarped_time(time) - layer.offset) * layer.speed
    if _frame_at(second) < 0:
        problem = f"a key cannot be before the start of its clip at {layer.offset:.2f} s"
        raise InputError(
            problem,
            where=f"layer {layer.take!r}",
            remedy="First move the clip to an earlier time.",
        )
    return max(second, 0.0)


def _with_root_layer(project: Project, character: RigBase, key: MotionKey) -> Project:
    """Adds the first key of a whole character. The key acts about the centre of the character at rest."""
    clip = clip_from_keys(unused(f"{character.id} keys", project.takes), "root", [key])
    layer = RootLayer(clip.id, np.array(get_rig_edits(character).centre(character)))
    new_character = character.with_changes(root_layers=(*character.root_layers, layer))
    return project.with_takes(clip).with_characters(new_character)


def _with_keys(project: Project, character_id: str, number: int, keys: Sequence[MotionKey]) -> Project:
    """Replaces the keys of a layer. Other layers that play the same keys keep the old keys."""
    character = project.character(character_id)
    layer, old = character.playing[number], _make_keyed_take(project, character.playing[number])
    users = [user_layer for each in project.characters.values() for user_layer in each.playing]
    old_take = sum((user_layer.source, user_layer.take) == (layer.source, layer.take) for user_layer in users)
    name = old.id if old_take < 2 else unused(old.id, getattr(project, layer.source))
    if isinstance(old, PoseStream):
        assert isinstance(layer, GraphLayer)
        project = project.with_streams(make_keyed_stream(name, layer.rest, old.follow, keys))
    else:
        project = project.with_takes(clip_from_keys(name, old.skeleton.names[0], keys))
    if name == old.id:
        return project
    named: dict[str, Any] = {"take": name}
    layers = [replace(other, **named) if k == number else other for k, other in enumerate(character.playing)]
    return project.with_characters(character.with_playing(*layers))
