"""The edits of several characters as one: moved, turned, scaled, mirrored and copied together.

Of one character alone they are the edits of :mod:`enliven.modeling.edits.characters`.
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
from enliven.modeling.edits.rigs import rig_of
from enliven.rotation import IDENTITY


def middle_of(project: Project, names: Sequence[str]) -> Float:
    """(3,) metres: the middle of what each of some characters is turned about."""
    return np.asarray(np.mean([_centre(project, name) for name in names], axis=0))


def move_characters(
    project: Project,
    names: Sequence[str],
    offset: AnyArray | Sequence[float],
    turn: AnyArray = IDENTITY,
    about: AnyArray | Sequence[float] = (0.0, 0.0, 0.0),
) -> Project:
    """A project with characters moved at every time: x becomes turn (x - about) + about + offset."""
    for name in names:
        project = move_character(project, name, offset, turn, about)
    return project


def turn_characters(project: Project, names: Sequence[str], turn: AnyArray) -> Project:
    """A project with characters turned by a rotation (4,) about their middle."""
    return move_characters(project, names, np.zeros(3), turn, middle_of(project, names))


def scale_characters(project: Project, names: Sequence[str], factor: float) -> Project:
    """A project with characters ``factor`` times as large: several about the floor below their middle."""
    floor = middle_of(project, names) * [1.0, 0.0, 1.0]
    for name in names:
        centre = _centre(project, name)
        project = scale_character(project, name, factor)
        if len(names) > 1:
            project = move_character(project, name, (factor - 1.0) * (centre - floor))
    return project


def mirror_characters(project: Project, names: Sequence[str], normal: AnyArray) -> Project:
    """A project with characters mirrored across a plane through their middle with a unit normal (3,)."""
    middle, way = middle_of(project, names), np.asarray(normal, np.float64)
    for name in names:
        offset = 2.0 * way * (way @ (middle - _centre(project, name)))
        project = move_character(mirror_character(project, name, way), name, offset)
    return project


def copy_characters(
    project: Project, source: Project, names: Sequence[str], offset: AnyArray
) -> tuple[Project, tuple[str, ...]]:
    """A project with copies of characters of another, all ``offset`` (3,) metres away, and their ids."""
    made: list[str] = []
    for name in names:
        project, copied = paste_character(project, source, name, offset=offset)
        made.append(copied)
    return project, tuple(made)


def shift_characters(project: Project, names: Sequence[str], delay: float) -> Project:
    """A project in which characters do everything ``delay`` seconds later."""
    for name in names:
        project = shift_character(project, name, delay)
    return project


def mute_characters(project: Project, names: Sequence[str], muted: bool) -> Project:
    """A project in which no layer of some characters plays, or every one does."""
    for name in names:
        count = len(project.character(name).playing)
        project = change_layers(project, name, range(count), muted=muted)
    return project


def _centre(project: Project, name: str) -> Float:
    character = project.character(name)
    return rig_of(character).centre(character)
