"""Edits of keys in every group of curves: add, move, ease and remove."""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.document import MAX_SPEED, MIN_SPEED, Project
from enliven.errors import InputError
from enliven.modeling.edits import (
    ease_key,
    find_keys,
    key_at,
    move_key,
    move_layer_key,
    remove_key,
    remove_layer_key,
    set_key,
    set_layer_key,
)
from enliven.modeling.puppet.poses import change_key_pose, remove_key_pose
from enliven_viewer.language import tr
from enliven_viewer.studio.features.animation.channels import (
    LAYER_KEY_ATTRIBUTES,
    CurveDot,
    CurveSubject,
    find_layer,
    find_value_scale,
)

KEY_ATTRIBUTES = {"keys": "degrees", "moves": "metres"}
"""The attribute of a key that each group of motion keys shows."""
_VALUE_LIMITS = {"weight": (0.0, 1.0), "speed": (MIN_SPEED, MAX_SPEED)}
"""Minimum and maximum value of the keys of a layer's weight and speed."""
Lane = tuple[int, ...]


def add_curve_key(
    project: Project, subject: CurveSubject, lane: Lane, group: str, time: float, value: float
) -> Project:
    """Returns a project with a new key at a time. The channel with the nearest value gets the given value.

    Args:
        lane: numbers of the layers in the same timeline row as the object's layer.
    """
    if group in LAYER_KEY_ATTRIBUTES:
        clamped_value = clamp_value(project, subject, group, time, value)
        return set_layer_key(
            project, subject.character, lane, LAYER_KEY_ATTRIBUTES[group], time, clamped_value
        )
    attribute = KEY_ATTRIBUTES[group]
    values = list(getattr(key_at(project, subject.character, subject.handle, time), attribute))
    values[int(np.abs(np.array(values) - value).argmin())] = value
    changes: dict[str, Any] = {attribute: values}
    return set_key(project, subject.character, subject.handle, time, **changes)


def move_curve_key(
    project: Project, subject: CurveSubject, lane: Lane, group: str, dot: CurveDot, time: float, value: float
) -> Project:
    """Returns a project with a key moved to another time and value."""
    if group in LAYER_KEY_ATTRIBUTES:
        clamped_value = clamp_value(project, subject, group, time, value)
        number = LAYER_KEY_ATTRIBUTES[group]
        return move_layer_key(project, subject.character, lane, number, dot.number, time, clamped_value)
    if group not in KEY_ATTRIBUTES:
        return _move_pose(project, subject, dot, time, value)
    attribute = KEY_ATTRIBUTES[group]
    values = list(getattr(find_keys(project, subject.character, subject.handle)[dot.number][1], attribute))
    values[dot.axis] = value
    changes: dict[str, Any] = {attribute: values}
    return move_key(project, subject.character, subject.handle, dot.number, time, **changes)


def set_interpolation(
    project: Project, subject: CurveSubject, lane: Lane, group: str, number: int, ease: str
) -> Project:
    """Returns a project with a changed interpolation from a key to the next key."""
    if group in LAYER_KEY_ATTRIBUTES:
        return move_layer_key(
            project, subject.character, lane, LAYER_KEY_ATTRIBUTES[group], number, ease=ease
        )
    return ease_key(project, subject.character, subject.handle, number, ease)


def remove_curve_key(project: Project, subject: CurveSubject, lane: Lane, group: str, number: int) -> Project:
    """Returns a project without a key, or without a key pose of a puppet."""
    if group in LAYER_KEY_ATTRIBUTES:
        return remove_layer_key(project, subject.character, lane, LAYER_KEY_ATTRIBUTES[group], number)
    if group in KEY_ATTRIBUTES:
        return remove_key(project, subject.character, subject.handle, number)
    return remove_key_pose(project, subject.character, number)


def clamp_value(project: Project, subject: CurveSubject, group: str, time: float, value: float) -> float:
    """Converts a drawn value to the value of a layer's key, clamped to the playable range."""
    low, high = _VALUE_LIMITS[group]
    return min(max(value / find_value_scale(project, subject, group, time), low), high)


def describe_clamping(project: Project, subject: CurveSubject, group: str, time: float, value: float) -> str:
    """Returns a sentence for the user if a value was clamped to the playable range, otherwise
    an empty text.
    """
    if group not in LAYER_KEY_ATTRIBUTES or not np.isfinite(value):
        return ""
    layer_value = value / find_value_scale(project, subject, group, time)
    if abs(clamp_value(project, subject, group, time, value) - layer_value) < 1e-9:
        return ""
    if group == "weight":
        return tr("A weight must be between 0 and 1")
    return tr(
        "The speed must be between {0:g} and {1:g}: a curve of speed cannot stop a clip or play it backwards",
        MIN_SPEED,
        MAX_SPEED,
    )


def _move_pose(project: Project, subject: CurveSubject, dot: CurveDot, time: float, value: float) -> Project:
    """Returns a project with a changed key pose of a puppet: another position of the control point, or
    another time of the key pose.
    """
    puppet, layer = project.puppet(subject.character), find_layer(project, subject)
    if layer is None or subject.handle is None:
        raise InputError(
            tr("no control point is chosen"), where=puppet.where, remedy=tr("Click a control point first.")
        )
    places = puppet.poses[dot.number].places.copy()
    places[subject.handle, dot.axis] = value
    changes: dict[str, object] = {"places": places}
    if time != dot.time:
        changes["time"] = layer.find_played_time(time, project.length_of(layer))[0]
    return change_key_pose(project, puppet.id, dot.number, **changes)
