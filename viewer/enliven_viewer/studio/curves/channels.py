"""The curves of the selection: groups of channels of one unit, sampled at even times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphShape, MotionKey, Playing, Pose, Project, Puppet, RigBase, Shape, key_values
from enliven.modeling.edits import key_layer, keys_of, layer_keys, rig_of
from enliven.rotation import (
    conjugate,
    continuous,
    from_matrix,
    multiply,
    nearest_rotation,
    to_rotation_vector,
)

AXES = ("x", "y", "z")
NUMBERS: dict[str, Literal["weights", "speeds"]] = {"weight": "weights", "speed": "speeds"}
"""The groups of numbers of a layer, and which of its keys are theirs."""


@dataclass(frozen=True)
class Dot:
    """A key on a curve.

    Attributes:
        number: among the keys of the bone, or the key poses of the puppet.
        axis: the channel.
        time: seconds of the project.
        value: in the group's unit.
        ease: how it goes over into the next; empty if examples decide that.
    """

    number: int
    axis: int
    time: float
    value: float
    ease: str = ""


@dataclass(frozen=True, eq=False)
class CurveGroup:
    """Channels of one unit.

    Attributes:
        name: "keys", "moves", "turn", "place", "weight" or "speed".
        unit: what stands behind a value.
        channels: their names.
        values: (T, C) at the times that were asked for; nothing is drawn where one is not finite.
        dots: the keys on them, which can be dragged.
    """

    name: str
    unit: str
    channels: tuple[str, ...]
    values: Float
    dots: tuple[Dot, ...] = ()


@dataclass(frozen=True)
class Thing:
    """What curves are of: a character, and a handle or a layer of it."""

    character: str
    handle: int | None
    layer: int | None


def groups_of(project: Project, thing: Thing, times: Float) -> dict[str, CurveGroup]:
    """Returns the curves of a thing at times (T,); those of its keys are apart, in :func:`key_groups`.

    Raises:
        EnlivenError: if it cannot be played.
    """
    character = project.character(thing.character)
    found = list[CurveGroup]()
    moving = _moving(project, character, thing)
    if moving is not None:
        rows = [moving(float(time)) for time in times]
        turns = continuous(np.stack([turn for turn, _ in rows])[:, None])[:, 0]
        found.append(CurveGroup("turn", "\u00b0", AXES, _unwrapped(turns)))
        found.append(CurveGroup("place", "m", AXES, np.stack([place for _, place in rows])))
    layer = layer_of_thing(project, thing)
    if layer is not None:
        length = project.length_of(layer)
        heard = 0.0 if layer.muted else float(getattr(layer, "weight", 1.0))
        weights = [heard * layer.moment(float(time), length).weight for time in times]
        found.append(CurveGroup("weight", "", ("weight",), np.array(weights)[:, None]))
        speeds = [_speed(layer, float(time), length) for time in times]
        found.append(CurveGroup("speed", "x", ("speed",), np.array(speeds)[:, None]))
    return {group.name: group for group in found}


def key_groups(project: Project, thing: Thing, times: Float) -> dict[str, CurveGroup]:
    """Returns the keys of a thing and the curves through them: "keys" in degrees, and "moves" in metres.

    They are of the chosen bone or node, or else of the whole; a bone is only turned, and the control points
    of a puppet have key poses instead.
    """
    character = project.characters.get(thing.character)
    if character is None or (thing.handle is not None and thing.handle >= character.keyable):
        return {}
    number, known = key_layer(project, thing.character, thing.handle), np.zeros((len(times), 6))
    keys = keys_of(project, thing.character, thing.handle)
    if number is not None:
        layer = character.playing[number]
        length = project.length_of(layer)
        seconds = [layer.played(float(time), length)[0] for time in times]
        known = key_values([key for _, key in keys], np.array(seconds))
    made = {"keys": CurveGroup("keys", "\u00b0", AXES, known[:, :3], _dots(keys, "degrees"))}
    if thing.handle is None or not isinstance(character, Shape):
        made["moves"] = CurveGroup("moves", "m", AXES, known[:, 3:], _dots(keys, "metres"))
    return made


def _dots(keys: tuple[tuple[float, MotionKey], ...], values: str) -> tuple[Dot, ...]:
    """Returns a dot for each key and axis; ``values`` names what of a key they show."""
    return tuple(
        Dot(k, axis, time, getattr(key, values)[axis], key.ease)
        for k, (time, key) in enumerate(keys)
        for axis in range(3)
    )


def pose_dots(project: Project, thing: Thing) -> tuple[Dot, ...]:
    """Returns the places that the key poses of a puppet give the chosen control point, when they are
    played.
    """
    puppet, layer = project.characters.get(thing.character), layer_of_thing(project, thing)
    if not isinstance(puppet, Puppet) or thing.handle is None or layer is None:
        return ()
    length = project.length_of(layer)
    return tuple(
        Dot(k, axis, layer.time_of(pose.time, length), float(pose.places[thing.handle, axis]))
        for k, pose in enumerate(puppet.poses)
        if pose.take == layer.take and layer.plays(pose.time, length)
        for axis in range(3)
    )


def layer_dots(project: Project, thing: Thing, group: str) -> tuple[Dot, ...]:
    """Returns the keys of the weight or the speed of a thing's layer, with the values that are drawn."""
    number = layer_number(project, thing)
    if number is None or group not in NUMBERS:
        return ()
    keys = layer_keys(project, thing.character, number, NUMBERS[group])
    offset = project.character(thing.character).playing[number].offset
    return tuple(
        Dot(
            k,
            0,
            offset + key.second,
            key.value * scale_of(project, thing, group, offset + key.second),
            key.ease,
        )
        for k, key in enumerate(keys)
    )


def scale_of(project: Project, thing: Thing, group: str, time: float) -> float:
    """What a value of 1 of a key of a layer's weight or speed is drawn as: the layer's own number."""
    layer = layer_of_thing(project, thing)
    if layer is None or group == "weight":
        return float(getattr(layer, "weight", 1.0)) or 1.0
    plain: dict[str, Any] = {"speeds": ()}
    return _speed(replace(layer, **plain), layer.even(time), project.length_of(layer)) or layer.speed


def layer_of_thing(project: Project, thing: Thing) -> Playing | None:
    """Returns the chosen layer of a thing, or else the first that is heard."""
    number = layer_number(project, thing)
    return None if number is None else project.character(thing.character).playing[number]


def layer_number(project: Project, thing: Thing) -> int | None:
    """Returns the number of that layer; None if nothing is heard."""
    character = project.characters.get(thing.character)
    playing = () if character is None else character.playing
    if thing.layer is not None and thing.layer < len(playing):
        return thing.layer
    return next((number for number, one in enumerate(playing) if not one.muted), None)


def _moving(
    project: Project, character: RigBase, thing: Thing
) -> Callable[[float], tuple[Float, Float]] | None:
    """What gives the turn (4,) and the place (3,) of a thing at a time; None if none is chosen."""
    player = rig_of(character).player(project, character)
    if isinstance(character, GraphShape):
        if thing.handle is not None:
            return _of_node(player, thing.handle)
        number = min(thing.layer or 0, len(character.parts) - 1)
        part = slice(character.starts[number], character.starts[number + 1])

        def of_part(time: float) -> tuple[Float, Float]:
            pose = player(time).pose
            mean = np.asarray(pose.linear[part], np.float64).mean(0)
            return from_matrix(nearest_rotation(mean)), np.asarray(pose.positions[part], np.float64).mean(0)

        return of_part
    handle = thing.handle
    if handle is None or handle >= len(character.handles):
        return None
    above = int(character.parents[handle])

    def of_handle(time: float) -> tuple[Float, Float]:
        pose, handles = player(time)
        linear = np.asarray(pose.linear, np.float64)
        if isinstance(character, Puppet):  # in the mesh's own frame, as its key poses are
            frame, place = linear[0], handles[handle] - pose.positions[0]
            return from_matrix(frame), frame.T @ place
        turn = from_matrix(linear[handle])
        if above >= 0:
            turn = multiply(conjugate(from_matrix(linear[above])), turn)
        return turn, np.asarray(handles[handle], np.float64)

    return of_handle


def _of_node(
    player: Callable[[float], tuple[Pose, Float]], node: int
) -> Callable[[float], tuple[Float, Float]]:
    """What gives the turn and the place of a node of a deformation graph."""

    def at(time: float) -> tuple[Float, Float]:
        pose = player(time)[0]
        return from_matrix(pose.linear[node]), np.asarray(pose.positions[node], np.float64)

    return at


def _unwrapped(turns: Float) -> Float:
    """Returns (T, 3) degrees of rotation vectors of turns (T, 4) without jumps of whole rounds."""
    vectors = to_rotation_vector(turns)
    for k in range(1, len(vectors)):
        angle = float(np.linalg.norm(vectors[k]))
        if angle < 1e-6:
            continue
        rounds = vectors[k] * (1.0 + np.array([[-1.0], [0.0], [1.0]]) * 2 * np.pi / angle)
        vectors[k] = rounds[np.linalg.norm(rounds - vectors[k - 1], axis=1).argmin()]
    return np.asarray(np.degrees(vectors))


def _speed(layer: Playing, time: float, length: float, wide: float = 1e-4) -> float:
    """Returns seconds of the take for a second of the project at a time; 0 if it stands."""
    one, other = layer.moment(time, length), layer.moment(time + wide, length)
    if one.rounds != other.rounds:
        return float("nan")
    return (other.second - one.second) / wide
