"""Chooses the moments at which ghosts stand: key poses, or else even steps of time."""

from __future__ import annotations

import numpy as np

from enliven.document import Playing, Project, Puppet, RigBase
from enliven.modeling.edits import key_layer

_SAME = 1e-3
"""Seconds within which a ghost would stand in the character itself."""


def key_moments(
    project: Project, character: RigBase, handle: int | None = None, layer: int | None = None
) -> tuple[float, ...]:
    """Returns the seconds of the project at which a character plays its key poses, in order; empty without
    any.

    They are the keys of a chosen layer, or else of a chosen bone or node, or else of the whole; or a puppet's
    examples.

    Args:
        handle, layer: numbers of the selection of it, or None.
    """
    keyed = _chosen_keys(project, character, handle, layer)
    if keyed is not None:
        length = project.length_of(keyed)
        keys = getattr(project, keyed.source)[keyed.take].keys
        played = [key.second for key in keys if keyed.plays(key.second, length)]
        return tuple(sorted({keyed.time_of(second, length) for second in played}))
    found = set[float]()
    for one in character.playing:
        if one.muted or not isinstance(character, Puppet):
            continue
        length = project.length_of(one)
        for pose in character.poses:
            if pose.take == one.take and one.plays(pose.time, length):
                found.add(one.time_of(pose.time, length))
    return tuple(sorted(found))


def _chosen_keys(
    project: Project, character: RigBase, handle: int | None, layer: int | None
) -> Playing | None:
    """Returns the layer of keys that is meant by the selection; None if none is heard."""
    playing, number = character.playing, layer
    keyed = [k for k, one in enumerate(playing) if getattr(project, one.source)[one.take].keys]
    if number not in keyed:
        if handle is not None and handle >= character.keyable:
            return None  # a control point, which has key poses
        number = key_layer(project, character.id, handle)
    return None if number is None or playing[number].muted else playing[number]


def ghost_moments(
    keys: tuple[float, ...], time: float, length: float, count: int, step: float
) -> tuple[float, ...]:
    """Returns the seconds of at most ``count`` ghosts before ``time`` and as many after it, in order.

    Without keys they stand ``step`` seconds apart at places that stay while the playhead moves.
    """
    if not keys:
        middle = round(time / step)
        keys = tuple(step * k for k in range(middle - count - 1, middle + count + 2))
    inside = np.array([one for one in keys if -_SAME <= one <= length + _SAME])
    before, after = inside[inside < time - _SAME], inside[inside > time + _SAME]
    return (*before[len(before) - min(count, len(before)) :].tolist(), *after[:count].tolist())
