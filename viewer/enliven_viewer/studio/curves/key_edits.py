"""Edits of keys in every group of curves: add, move, ease and remove."""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.document import MAX_SPEED, MIN_SPEED, Project
from enliven.errors import InputError
from enliven.modeling.edits import (
    ease_key,
    key_at,
    keys_of,
    move_key,
    move_layer_key,
    remove_key,
    remove_layer_key,
    set_key,
    set_layer_key,
)
from enliven.modeling.puppet import change_key_pose, remove_key_pose
from enliven_viewer.language import tr
from enliven_viewer.studio.curves.channels import NUMBERS, CurveDot, CurveSubject, layer_of_thing, scale_of

KEYED = {"keys": "degrees", "moves": "metres"}
"""The groups of motion keys, and the attribute of a key that each shows."""
_VALUE_LIMITS = {"weight": (0.0, 1.0), "speed": (MIN_SPEED, MAX_SPEED)}
"""Minimum and maximum value of the keys of a layer's weight and speed."""
Lane = tuple[int, ...]


def add_curve_key(
    project: Project, thing: CurveSubject, lane: Lane, group: str, time: float, value: float
) -> Project:
    """Returns a project with a new key at a time. The channel with the nearest value gets the given value.

    Args:
        lane: the numbers of the layers in the object's lane.
    """
    if group in NUMBERS:
        own = clamp_value(project, thing, group, time, value)
        return set_layer_key(project, thing.character, lane, NUMBERS[group], time, own)
    word = KEYED[group]
    values = list(getattr(key_at(project, thing.character, thing.handle, time), word))
    values[int(np.abs(np.array(values) - value).argmin())] = value
    how: dict[str, Any] = {word: values}
    return set_key(project, thing.character, thing.handle, time, **how)


def move_curve_key(
    project: Project, thing: CurveSubject, lane: Lane, group: str, dot: CurveDot, time: float, value: float
) -> Project:
    """Returns a project with a key moved to another time and value."""
    if group in NUMBERS:
        own = clamp_value(project, thing, group, time, value)
        number = NUMBERS[group]
        return move_layer_key(project, thing.character, lane, number, dot.number, time, own)
    if group not in KEYED:
        return _pose_moved(project, thing, dot, time, value)
    word = KEYED[group]
    values = list(getattr(keys_of(project, thing.character, thing.handle)[dot.number][1], word))
    values[dot.axis] = value
    how: dict[str, Any] = {word: values}
    return move_key(project, thing.character, thing.handle, dot.number, time, **how)


def set_interpolation(
    project: Project, thing: CurveSubject, lane: Lane, group: str, number: int, ease: str
) -> Project:
    """Returns a project with another interpolation from a key to the next one."""
    if group in NUMBERS:
        return move_layer_key(project, thing.character, lane, NUMBERS[group], number, ease=ease)
    return ease_key(project, thing.character, thing.handle, number, ease)


def remove_curve_key(project: Project, thing: CurveSubject, lane: Lane, group: str, number: int) -> Project:
    """Returns a project without a key, or without a key pose of a puppet."""
    if group in NUMBERS:
        return remove_layer_key(project, thing.character, lane, NUMBERS[group], number)
    if group in KEYED:
        return remove_key(project, thing.character, thing.handle, number)
    return remove_key_pose(project, thing.character, number)


def clamp_value(project: Project, thing: CurveSubject, group: str, time: float, value: float) -> float:
    """Returns the value of a layer's key that is drawn at ``value``, clamped to the playable range."""
    low, high = _VALUE_LIMITS[group]
    return min(max(value / scale_of(project, thing, group, time), low), high)


def clamp_warning(project: Project, thing: CurveSubject, group: str, time: float, value: float) -> str:
    """Returns a sentence if a value is outside the playable range and was clamped; else empty."""
    if group not in NUMBERS or not np.isfinite(value):
        return ""
    wanted = value / scale_of(project, thing, group, time)
    if abs(clamp_value(project, thing, group, time, value) - wanted) < 1e-9:
        return ""
    if group == "weight":
        return tr("A weight is from 0 to 1")
    return tr(
        "A clip plays {0:g} to {1:g} times as fast: time does not stand or go back", MIN_SPEED, MAX_SPEED
    )


def _pose_moved(project: Project, thing: CurveSubject, dot: CurveDot, time: float, value: float) -> Project:
    """Returns a project with a key pose of a puppet changed.

    The control point gets another position, or the key pose another time.
    """
    puppet, layer = project.puppet(thing.character), layer_of_thing(project, thing)
    if layer is None or thing.handle is None:
        raise InputError(tr("no control point is chosen"), where=puppet.where, mend=tr("Click one first."))
    places = puppet.poses[dot.number].places.copy()
    places[thing.handle, dot.axis] = value
    changes: dict[str, object] = {"places": places}
    if time != dot.time:
        changes["time"] = layer.played(time, project.length_of(layer))[0]
    return change_key_pose(project, puppet.id, dot.number, **changes)
