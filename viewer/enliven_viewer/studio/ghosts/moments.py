"""Chooses the moments at which ghosts stand: key poses, or else even steps of time."""

from __future__ import annotations

import numpy as np

from enliven.document import Project, Puppet, RigBase

_SAME = 1e-3
"""Seconds within which a ghost would stand in the character itself."""


def key_moments(project: Project, character: RigBase) -> tuple[float, ...]:
    """The seconds of the project at which a character plays its key poses, in order; empty without any."""
    found = set[float]()
    for layer in character.playing:
        if layer.muted or not isinstance(character, Puppet):
            continue
        length = project.length_of(layer)
        for pose in character.poses:
            if pose.take == layer.take and layer.plays(pose.time, length):
                found.add(layer.time_of(pose.time, length))
    return tuple(sorted(found))


def ghost_moments(
    keys: tuple[float, ...], time: float, length: float, count: int, step: float
) -> tuple[float, ...]:
    """The seconds of at most ``count`` ghosts before ``time`` and as many after it, in order.

    Without keys they stand ``step`` seconds apart at places that stay while the playhead moves.
    """
    if not keys:
        middle = round(time / step)
        keys = tuple(step * k for k in range(middle - count - 1, middle + count + 2))
    inside = np.array([one for one in keys if -_SAME <= one <= length + _SAME])
    before, after = inside[inside < time - _SAME], inside[inside > time + _SAME]
    return (*before[len(before) - min(count, len(before)) :].tolist(), *after[:count].tolist())
