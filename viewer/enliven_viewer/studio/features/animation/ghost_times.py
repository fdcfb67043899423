"""Chooses the times of ghosts: the times of keys, or regular steps without keys."""

from __future__ import annotations

import numpy as np

from enliven.document import LayerBase, Project, RigBase
from enliven.modeling.edits import key_layer

_TIME_TOLERANCE_S = 1e-3
"""A ghost closer in time to the playhead than this, in seconds, is omitted, because it would coincide with
the character.
"""


def find_key_times(
    project: Project, character: RigBase, handle: int | None = None, layer: int | None = None
) -> tuple[float, ...]:
    """Returns the times in the project at which a character plays its keys, in order. The result is empty
    without keys.

    The keys belong to the selected layer if there is one, otherwise to the selected bone or node, otherwise
    to the whole character. A puppet's keys are its examples.

    Args:
        handle, layer: the selected handle and layer of the character, or None.
    """
    keyed = _find_selected_keys(project, character, handle, layer)
    if keyed is not None:
        length = project.length_of(keyed)
        keys = getattr(project, keyed.source)[keyed.take].keys
        played_times = [key.second for key in keys if keyed.plays(key.second, length)]
        return tuple(sorted({keyed.time_of(second, length) for second in played_times}))
    moments = set[float]()
    for playing_layer in character.playing:
        if playing_layer.muted:
            continue
        length = project.length_of(playing_layer)
        for _, pose in character.examples_of(playing_layer):
            if playing_layer.plays(pose.time, length):
                moments.add(playing_layer.time_of(pose.time, length))
    return tuple(sorted(moments))


def _find_selected_keys(
    project: Project, character: RigBase, handle: int | None, layer: int | None
) -> LayerBase | None:
    """Returns the layer of keys that belongs to the selection, or None if it is muted."""
    playing, number = character.playing, layer
    keyed = [
        k
        for k, playing_layer in enumerate(playing)
        if getattr(project, playing_layer.source)[playing_layer.take].keys
    ]
    if number not in keyed:
        if handle is not None and handle >= character.keyable:
            return None  # A control point has key poses instead of keys.
        number = key_layer(project, character.id, handle)
    return None if number is None or playing[number].muted else playing[number]


def choose_ghost_times(
    keys: tuple[float, ...], time: float, length: float, count: int, step: float
) -> tuple[float, ...]:
    """Returns the times of up to ``count`` ghosts before ``time`` and up to ``count`` after it, in order.

    Without keys, the ghosts are ``step`` seconds apart, at times that do not move with the playhead.
    """
    if not keys:
        middle = round(time / step)
        keys = tuple(step * k for k in range(middle - count - 1, middle + count + 2))
    inside = np.array([key for key in keys if -_TIME_TOLERANCE_S <= key <= length + _TIME_TOLERANCE_S])
    earlier_times, later_times = (
        inside[inside < time - _TIME_TOLERANCE_S],
        inside[inside > time + _TIME_TOLERANCE_S],
    )
    return (
        *earlier_times[len(earlier_times) - min(count, len(earlier_times)) :].tolist(),
        *later_times[:count].tolist(),
    )
