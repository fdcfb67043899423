"""Edits of the weight and speed curves of layers, for all rigs. The curves consist of keys (time, value).

    project = set_layer_key(project, "squid", [0], "weights", 1.0, 0.0)   # weight 0 at 1 s of the project
    project = set_layer_key(project, "squid", [0], "speeds", 2.0, 0.5)    # half speed from 2 s on

A curve with one key is constant. Times of keys are times of the project. If the start of a lane moves, its
keys move with it. Keys that would stop or reverse time raise an error.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Literal

from enliven.document import CurveKey, Project
from enliven.errors import InputError
from enliven.modeling.edits.characters import change_layers

Number = Literal["weights", "speeds"]
"""The attribute of a layer that the keys control: its weight or its speed."""
_SAME_KEY_S = 1.0 / 60.0
"""A new key replaces an existing key within this time in seconds, about half a frame of film."""


def layer_keys(project: Project, character_id: str, layer: int, number: Number) -> tuple[CurveKey, ...]:
    """Returns the keys of one attribute of a layer, in the order of time.

    Raises:
        InputError: if the character or layer does not exist.
    """
    character = project.character(character_id)
    if not 0 <= layer < len(character.playing):
        remedy = f"The layers are numbered from 0. Number of layers: {len(character.playing)}."
        raise InputError(f"the character has no layer {layer}", where=character.where, remedy=remedy)
    keys: tuple[CurveKey, ...] = getattr(character.playing[layer], number)
    return keys


def set_layer_key(
    project: Project,
    character_id: str,
    layers: Iterable[int],
    number: Number,
    time: float,
    value: float,
    ease: str = "smooth",
) -> Project:
    """Sets a key of one attribute of layers at a time. It replaces a key at that time.

    Args:
        layers: numbers of the layers. All of them get the keys of the first layer.
        time: seconds of the project.
        value: a weight from 0 to 1, or a speed factor.

    Raises:
        InputError: if the layer does not exist, or the value cannot be played.
    """
    numbers = tuple(layers)
    keys = layer_keys(project, character_id, numbers[0], number)
    layer_time = time - project.character(character_id).playing[numbers[0]].offset
    remaining = [key for key in keys if abs(key.second - layer_time) > _SAME_KEY_S]
    return _with_keys(project, character_id, numbers, number, [*remaining, CurveKey(layer_time, value, ease)])


def move_layer_key(
    project: Project,
    character_id: str,
    layers: Iterable[int],
    number: Number,
    key: int,
    time: float | None = None,
    value: float | None = None,
    ease: str | None = None,
) -> Project:
    """Moves a key of one attribute of layers to another time, or changes its value or interpolation.

    Raises:
        InputError: if the key does not exist, another key has that time, or the value cannot be played.
    """
    numbers = tuple(layers)
    old_key, keys = _find_key(project, character_id, numbers[0], number, key)
    offset = project.character(character_id).playing[numbers[0]].offset
    moved_key = CurveKey(
        old_key.second if time is None else time - offset,
        old_key.value if value is None else value,
        old_key.ease if ease is None else ease,
    )
    return _with_keys(project, character_id, numbers, number, [*keys[:key], moved_key, *keys[key + 1 :]])


def remove_layer_key(
    project: Project, character_id: str, layers: Iterable[int], number: Number, key: int
) -> Project:
    """Removes a key of one attribute of layers. If no key is left, the attribute has its default value.

    Raises:
        InputError: if the key does not exist.
    """
    numbers = tuple(layers)
    _, keys = _find_key(project, character_id, numbers[0], number, key)
    return _with_keys(project, character_id, numbers, number, [*keys[:key], *keys[key + 1 :]])


def _find_key(
    project: Project, character_id: str, layer: int, number: Number, key: int
) -> tuple[CurveKey, tuple[CurveKey, ...]]:
    keys = layer_keys(project, character_id, layer, number)
    if not 0 <= key < len(keys):
        remedy = f"The keys are numbered from 0. Number of keys: {len(keys)}."
        raise InputError(
            f"the curve of the {number} has no key {key}", where=f"character {character_id!r}", remedy=remedy
        )
    return keys[key], keys


def _with_keys(
    project: Project, character_id: str, layers: tuple[int, ...], number: Number, keys: list[CurveKey]
) -> Project:
    """Sets the keys of layers, with times relative to the start of the first layer's lane."""
    playing = project.character(character_id).playing
    sorted_keys = sorted(keys, key=lambda key: key.second)
    for layer in layers:
        delay = playing[layers[0]].offset - playing[layer].offset
        relative_keys = tuple(replace(key, second=key.second + delay) for key in sorted_keys)
        changes: dict[str, Any] = {number: relative_keys}
        project = change_layers(project, character_id, [layer], **changes)
    return project
