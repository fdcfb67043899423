"""Edits of several characters as a group: move, rotate, scale, mirror and copy.

For a single character, these edits have the same effect as those in :mod:`enliven.modeling.edits.characters`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project
from enliven.modeling.edits.characters import (
    change_layers,
    mirror_character,
    move_character,
    paste_character,
    scale_character,
    shift_character,
)
from enliven.modeling.edits.rigs import get_rig_edits
from enliven.rotation import IDENTITY


def group_centre(project: Project, names: Sequence[str]) -> Float:
    """Returns the mean (3,) in metres of the centres of some characters."""
    return np.asarray(np.mean([_character_centre(project, name) for name in names], axis=0))


def move_characters(
    project: Project,
    names: Sequence[str],
    offset: AnyArray | Sequence[float],
    turn: AnyArray = IDENTITY,
    about: AnyArray | Sequence[float] = (0.0, 0.0, 0.0),
) -> Project:
    """Moves characters at every time: x becomes turn (x - about) + about + offset."""
    for name in names:
        project = move_character(project, name, offset, turn, about)
    return project


def turn_characters(project: Project, names: Sequence[str], turn: AnyArray) -> Project:
    """Rotates characters by the unit quaternion ``turn`` (4,) about the centre of the group."""
    return move_characters(project, names, np.zeros(3), turn, group_centre(project, names))


def scale_characters(project: Project, names: Sequence[str], factor: float) -> Project:
    """Scales characters by ``factor``. A group is scaled about the point on the floor below its centre."""
    floor = group_centre(project, names) * [1.0, 0.0, 1.0]
    for name in names:
        centre = _character_centre(project, name)
        project = scale_character(project, name, factor)
        if len(names) > 1:
            project = move_character(project, name, (factor - 1.0) * (centre - floor))
    return project


def mirror_characters(project: Project, names: Sequence[str], normal: AnyArray) -> Project:
    """Mirrors characters in the plane through the centre of the group with a unit normal (3,)."""
    middle, distance = group_centre(project, names), np.asarray(normal, np.float64)
    for name in names:
        offset = 2.0 * distance * (distance @ (middle - _character_centre(project, name)))
        project = move_character(mirror_character(project, name, distance), name, offset)
    return project


def copy_characters(
    project: Project, source: Project, names: Sequence[str], offset: AnyArray
) -> tuple[Project, tuple[str, ...]]:
    """Copies characters of another project, all with the same ``offset`` (3,) metres. Returns the project and
    the ids of the copies."""
    copies: list[str] = []
    for name in names:
        project, copied = paste_character(project, source, name, offset=offset)
        copies.append(copied)
    return project, tuple(copies)


def shift_characters(project: Project, names: Sequence[str], delay: float) -> Project:
    """Delays all motion of characters by ``delay`` seconds."""
    for name in names:
        project = shift_character(project, name, delay)
    return project


def mute_characters(project: Project, names: Sequence[str], muted: bool) -> Project:
    """Mutes or unmutes all layers of some characters."""
    for name in names:
        count = len(project.character(name).playing)
        project = change_layers(project, name, range(count), muted=muted)
    return project


def _character_centre(project: Project, name: str) -> Float:
    character = project.character(name)
    return get_rig_edits(character).centre(character)
