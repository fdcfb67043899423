"""The curves of the selection (F-curves): groups of channels with a common unit, sampled at regular times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    LayerBase,
    MotionKey,
    Project,
    key_values,
)
from enliven.modeling.edits import find_keys, get_rig_edits, key_layer, layer_keys
from enliven.rotation import (
    remove_sign_jumps,
    to_rotation_vector,
)

AXES = ("x", "y", "z")
LAYER_KEY_ATTRIBUTES: dict[str, Literal["weights", "speeds"]] = {"weight": "weights", "speed": "speeds"}
"""The attribute of a layer that contains the keys, for each numeric group of a layer."""


@dataclass(frozen=True)
class CurveDot:
    """A key on a curve.

    Attributes:
        number: index of the key among the keys of the bone, or among the key poses of the puppet.
        axis: index of the channel.
        time: time in the project in seconds.
        value: value in the group's unit.
        ease: interpolation to the next key; empty for key poses, because the solver interpolates between
            them.
    """

    number: int
    axis: int
    time: float
    value: float
    ease: str = ""


@dataclass(frozen=True, eq=False)
class CurveGroup:
    """Channels with a common unit.

    Attributes:
        name: "keys", "moves", "turn", "place", "weight" or "speed".
        unit: unit shown after a value.
        channels: names of the channels.
        values: (T, C) at the requested times. Values that are not finite are not drawn.
        dots: the draggable keys on the curves.
    """

    name: str
    unit: str
    channels: tuple[str, ...]
    values: Float
    dots: tuple[CurveDot, ...] = ()


@dataclass(frozen=True)
class CurveSubject:
    """The object of the shown curves: a character, and optionally one of its handles or layers."""

    character: str
    handle: int | None
    layer: int | None


def sample_groups(project: Project, subject: CurveSubject, times: Float) -> dict[str, CurveGroup]:
    """Returns the curves of an object at times (T,). Its keys are excluded, because :func:`make_key_groups`
    returns them.

    Raises:
        EnlivenError: if the character cannot be played.
    """
    character = project.character(subject.character)
    groups = list[CurveGroup]()
    rig = get_rig_edits(character)
    player = rig.create_player(project, character)
    moving = rig.handle_motion(character, player, subject.handle, subject.layer)
    if moving is not None:
        rows = [moving(float(time)) for time in times]
        turns = remove_sign_jumps(np.stack([turn for turn, _ in rows])[:, None])[:, 0]
        groups.append(CurveGroup("turn", "\u00b0", AXES, _unwrap_rotations(turns)))
        groups.append(CurveGroup("place", "m", AXES, np.stack([place for _, place in rows])))
    layer = find_layer(project, subject)
    if layer is not None:
        length = project.length_of(layer)
        layer_weight = 0.0 if layer.muted else float(getattr(layer, "weight", 1.0))
        weights = [layer_weight * layer.moment(float(time), length).weight for time in times]
        groups.append(CurveGroup("weight", "", ("weight",), np.array(weights)[:, None]))
        speeds = [_find_speed(layer, float(time), length) for time in times]
        groups.append(CurveGroup("speed", "x", ("speed",), np.array(speeds)[:, None]))
    return {group.name: group for group in groups}


def make_key_groups(project: Project, subject: CurveSubject, times: Float) -> dict[str, CurveGroup]:
    """Returns the keys of an object and the curves through them: "keys" in degrees, and "moves" in metres.

    The keys are those of the selected bone or node, or else of the whole character. A bone has only
    rotations. Control points of a puppet have key poses instead.
    """
    character = project.characters.get(subject.character)
    if character is None or (subject.handle is not None and subject.handle >= character.keyable):
        return {}
    number, values = key_layer(project, subject.character, subject.handle), np.zeros((len(times), 6))
    keys = find_keys(project, subject.character, subject.handle)
    if number is not None:
        layer = character.playing[number]
        length = project.length_of(layer)
        seconds = [layer.find_played_time(float(time), length)[0] for time in times]
        values = key_values([key for _, key in keys], np.array(seconds))
    groups = {"keys": CurveGroup("keys", "\u00b0", AXES, values[:, :3], _make_dots(keys, "degrees"))}
    if subject.handle is None or not character.jointed:
        groups["moves"] = CurveGroup("moves", "m", AXES, values[:, 3:], _make_dots(keys, "metres"))
    return groups


def _make_dots(keys: tuple[tuple[float, MotionKey], ...], values: str) -> tuple[CurveDot, ...]:
    """Returns a dot for each key and axis. ``values`` is the name of the shown attribute of a key."""
    return tuple(
        CurveDot(k, axis, time, getattr(key, values)[axis], key.ease)
        for k, (time, key) in enumerate(keys)
        for axis in range(3)
    )


def make_pose_dots(project: Project, subject: CurveSubject) -> tuple[CurveDot, ...]:
    """Returns the selected control point's positions in the puppet's key poses.

    Their times are those at which the key poses are played.
    """
    character, layer = project.characters.get(subject.character), find_layer(project, subject)
    if character is None or subject.handle is None or layer is None:
        return ()
    length, examples = project.length_of(layer), character.examples_of(layer)
    return tuple(
        CurveDot(k, axis, layer.time_of(pose.time, length), float(pose.places[subject.handle, axis]))
        for k, pose in examples
        if layer.plays(pose.time, length)
        for axis in range(3)
    )


def make_layer_dots(project: Project, subject: CurveSubject, group: str) -> tuple[CurveDot, ...]:
    """Returns the keys of the weight or the speed of an object's layer, with the drawn values."""
    number = find_layer_number(project, subject)
    if number is None or group not in LAYER_KEY_ATTRIBUTES:
        return ()
    keys = layer_keys(project, subject.character, number, LAYER_KEY_ATTRIBUTES[group])
    offset = project.character(subject.character).playing[number].offset
    return tuple(
        CurveDot(
            k,
            0,
            offset + key.second,
            key.value * find_value_scale(project, subject, group, offset + key.second),
            key.ease,
        )
        for k, key in enumerate(keys)
    )


def find_value_scale(project: Project, subject: CurveSubject, group: str, time: float) -> float:
    """Returns the factor from a layer key's value to its drawn value: the layer's own weight or speed."""
    layer = find_layer(project, subject)
    if layer is None or group == "weight":
        return float(getattr(layer, "weight", 1.0)) or 1.0
    plain: dict[str, Any] = {"speeds": ()}
    return (
        _find_speed(replace(layer, **plain), layer.convert_to_unwarped_time(time), project.length_of(layer))
        or layer.speed
    )


def find_layer(project: Project, subject: CurveSubject) -> LayerBase | None:
    """Returns the selected layer of an object, otherwise its first unmuted layer."""
    number = find_layer_number(project, subject)
    return None if number is None else project.character(subject.character).playing[number]


def find_layer_number(project: Project, subject: CurveSubject) -> int | None:
    """Returns the number of the layer of :func:`find_layer`, or None if all layers are muted."""
    character = project.characters.get(subject.character)
    playing = () if character is None else character.playing
    if subject.layer is not None and subject.layer < len(playing):
        return subject.layer
    return next((number for number, layer in enumerate(playing) if not layer.muted), None)


def _unwrap_rotations(turns: Float) -> Float:
    """Converts rotations (T, 4) to rotation vectors (T, 3) in degrees, unwrapped to avoid jumps by full
    turns.
    """
    vectors = to_rotation_vector(turns)
    for k in range(1, len(vectors)):
        angle = float(np.linalg.norm(vectors[k]))
        if angle < 1e-6:
            continue
        rounds = vectors[k] * (1.0 + np.array([[-1.0], [0.0], [1.0]]) * 2 * np.pi / angle)
        vectors[k] = rounds[np.linalg.norm(rounds - vectors[k - 1], axis=1).argmin()]
    return np.asarray(np.degrees(vectors))


def _find_speed(layer: LayerBase, time: float, length: float, width: float = 1e-4) -> float:
    """Returns the playback speed at a time: seconds of the take per second of the project.

    It is 0 while the layer holds one frame of the take, and NaN where a loop restarts.
    """
    start_second, end_second = layer.moment(time, length), layer.moment(time + width, length)
    if start_second.rounds != end_second.rounds:
        return float("nan")
    return (end_second.second - start_second.second) / width
