"""Keys on a bone over its motion: a layer of turns that are added to whatever moves the bone.

    project = set_key(project, "squid", "arm", 1.2, (0.0, 30.0, 0.0))     # degrees, from there on
    project = set_key(project, "squid", "arm", 1.8, (0.0, 0.0, 0.0))      # and back to what was performed
    project = key_joint(project, "squid", "hand", place, 1.5)             # posed by hand at a time

The keys of a bone are a take of their own, and what plays it is a layer as any: it is muted, weighted,
shifted, stretched, copied, cut and exported as others are. At a key the bone is turned, after its motion,
by the key's degrees, in its own axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import KEY_STEP, Layer, Project, Ref, Shape, TurnKey, eased_degrees, keyed_clip, unused
from enliven.errors import InputError
from enliven.modeling.edits.characters import remove_layer
from enliven.modeling.rigged import Axes, bone_number
from enliven.motion.layers import pose_of
from enliven.rotation import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    swing,
    to_rotation_vector,
)

Degrees = tuple[float, float, float]


def key_layer(project: Project, shape_id: str, bone: int | str) -> int | None:
    """The number of the layer that plays a bone's keys; None where it has none."""
    shape = project.shape(shape_id)
    laid = {ref.layer for span in shape.spans[bone_number(shape, bone)] for ref in span.refs}
    for number, layer in enumerate(shape.layers):
        if layer.id in laid and project.takes[layer.take].keys:
            return number
    return None


def keys_of(project: Project, shape_id: str, bone: int | str) -> tuple[tuple[float, TurnKey], ...]:
    """The keys of a bone, each with the second of the project at which it is played."""
    number = key_layer(project, shape_id, bone)
    if number is None:
        return ()
    layer = project.shape(shape_id).layers[number]
    clip = project.takes[layer.take]
    return tuple((layer.time_of(key.second, clip.duration), key) for key in clip.keys)


def added_degrees(project: Project, shape_id: str, bone: int | str, time: float) -> Degrees:
    """What the keys of a bone turn it by at a time: a rotation vector in degrees."""
    number = key_layer(project, shape_id, bone)
    if number is None:
        return (0.0, 0.0, 0.0)
    layer = project.shape(shape_id).layers[number]
    clip = project.takes[layer.take]
    second = layer.played(time, clip.duration)[0]
    known = [key for key in clip.keys if abs(key.second - second) < 1e-6]
    x, y, z = known[0].degrees if known else eased_degrees(clip.keys, np.array([second]))[0]
    return float(x), float(y), float(z)


def set_key(
    project: Project,
    shape_id: str,
    bone: int | str,
    time: float,
    degrees: Sequence[float] | None = None,
    ease: str | None = None,
) -> Project:
    """A project with a key of a bone at a time, in the place of one that is on that frame.

    Args:
        degrees: what it is turned by; None: by what it is turned there already.
        ease: how it goes over into the next; None as before, or smooth.

    Raises:
        InputError: where there is no such shape or bone, or the numbers are no key.
    """
    shape = project.shape(shape_id)
    j = bone_number(shape, bone)
    if degrees is None:
        degrees = added_degrees(project, shape_id, j, time)
    x, y, z = (float(one) for one in degrees)
    number = key_layer(project, shape_id, j)
    if number is None:
        return _with_layer(project, shape, j, TurnKey(max(float(time), 0.0), (x, y, z), ease or "smooth"))
    layer = shape.layers[number]
    second = _second(project, layer, time)
    keys = project.takes[layer.take].keys
    here = [key for key in keys if _frame(key.second) == _frame(second)]
    made = TurnKey(second, (x, y, z), ease or (here[0].ease if here else "smooth"))
    return _with_keys(project, shape_id, number, (*(key for key in keys if key not in here), made))


def move_key(
    project: Project, shape_id: str, bone: int | str, key: int, time: float, degrees: Sequence[float]
) -> Project:
    """A project with a key of a bone at another time, or with other degrees.

    Raises:
        InputError: where there is no such key, or another is on that frame.
    """
    number, found = _key(project, shape_id, bone, key)
    layer = project.shape(shape_id).layers[number]
    x, y, z = (float(one) for one in degrees)
    moved = replace(found, second=_second(project, layer, time), degrees=(x, y, z))
    others = [one for one in project.takes[layer.take].keys if one is not found]
    return _with_keys(project, shape_id, number, (*others, moved))


def ease_key(project: Project, shape_id: str, bone: int | str, key: int, ease: str) -> Project:
    """A project in which a key goes over into the next in another way: "smooth", "linear" or "step".

    Raises:
        InputError: where there is no such key or way.
    """
    number, found = _key(project, shape_id, bone, key)
    keys = project.takes[project.shape(shape_id).layers[number].take].keys
    changed = [replace(one, ease=ease) if one is found else one for one in keys]
    return _with_keys(project, shape_id, number, changed)


def remove_key(project: Project, shape_id: str, bone: int | str, key: int) -> Project:
    """A project without a key of a bone; with the last one goes its layer, and its take.

    Raises:
        InputError: where there is no such key.
    """
    number, found = _key(project, shape_id, bone, key)
    take = project.shape(shape_id).layers[number].take
    left = [one for one in project.takes[take].keys if one is not found]
    if left:
        return _with_keys(project, shape_id, number, left)
    project = remove_layer(project, shape_id, number)
    if any(take in one.needed()["takes"] for one in project.characters.values()):
        return project
    return replace(project, takes={key: one for key, one in project.takes.items() if key != take})


def key_joint(project: Project, shape_id: str, joint: int | str, place: AnyArray, time: float) -> Project:
    """A project in which a key lets the bone of a joint point at ``place`` (3,) metres at a time.

    Raises:
        InputError: for the root, which no bone carries, and for a place that is not finite.
    """
    shape = project.shape(shape_id)
    j, place = bone_number(shape, joint), np.asarray(place, np.float64)
    if j == 0 or place.shape != (3,) or not np.isfinite(place).all():
        what = "the root is moved, not turned" if j == 0 else f"{place} is no place"
        raise InputError(what, where=shape.where, mend="Drag another joint.")
    seen_at = pose_of(project, shape_id, time)
    turns, joints = seen_at.turns, seen_at.joints
    start = joints[int(shape.skeleton.parents[j])]
    way, bone = place - start, joints[j] - start
    if min(np.linalg.norm(way), np.linalg.norm(bone)) < 1e-9:
        return project
    turn = swing(bone / np.linalg.norm(bone), way / np.linalg.norm(way))
    # D = above K, so turned in the world by w it is above K', K' = K D^-1 w D.
    own = multiply(multiply(conjugate(turns[j]), turn), turns[j])
    known, seen = np.array(added_degrees(project, shape_id, j, time)), Axes(IDENTITY, False)
    number = key_layer(project, shape_id, j)
    if number is not None:
        seen = Axes(shape.layers[number].basis, shape.layers[number].mirrored)
    added = multiply(seen.rotations(from_rotation_vector(np.radians(known))), own)
    # The reflection is its own inverse, and so L^-1 = S basis^-1.
    mine = multiply(multiply(conjugate(seen.turn), added), seen.turn)
    mine = Axes(IDENTITY, seen.mirrored).rotations(mine)
    return set_key(project, shape_id, j, time, _nearest(normalized(mine), known).tolist())


def _nearest(turn: Float, known: Float) -> Float:
    """(3,) degrees of a rotation vector of a turn (4,): of all its rounds the nearest to ``known``."""
    vector = np.degrees(to_rotation_vector(turn))
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        return vector
    rounds = [vector * (1.0 + k * 360.0 / angle) for k in (-2, -1, 0, 1, 2)]
    return min(rounds, key=lambda one: float(np.linalg.norm(one - known)))


def _frame(second: float) -> int:
    return round(second / KEY_STEP)


def _key(project: Project, shape_id: str, bone: int | str, key: int) -> tuple[int, TurnKey]:
    """The layer of a bone's keys, and one of them."""
    number = key_layer(project, shape_id, bone)
    keys = () if number is None else project.takes[project.shape(shape_id).layers[number].take].keys
    if number is None or not 0 <= key < len(keys):
        mend = f"It has {len(keys)}."
        raise InputError(f"there is no key {key}", where=f"bone {bone!r} of {shape_id!r}", mend=mend)
    return number, keys[key]


def _second(project: Project, layer: Layer, time: float) -> float:
    """The second of a layer's keys at a time, also after their end.

    Raises:
        InputError: for a time before they begin.
    """
    if layer.segments or layer.loop or layer.speed < 0.0:
        return layer.played(time, project.length_of(layer))[0]
    second = (time - layer.offset) * layer.speed
    if _frame(second) < 0:
        what = f"the clip of its keys begins at {layer.offset:.2f} s"
        raise InputError(what, where=f"layer {layer.id!r}", mend="Move that clip earlier first.")
    return max(second, 0.0)


def _with_layer(project: Project, shape: Shape, j: int, key: TurnKey) -> Project:
    """A project with the first key of a bone: a take, and a layer that plays it after all others."""
    bone = shape.skeleton.names[j]
    clip = keyed_clip(unused(f"{bone} keys", project.takes), bone, [key])
    name = unused(f"{bone} keys", project.layer_names)
    *others, last = shape.spans[j]
    spans = list(shape.spans)
    spans[j] = (*others, replace(last, refs=(*last.refs, Ref(name, 0.0, 1.0))))
    layers = (*shape.layers, Layer(name, clip.id, (0,)))
    return project.with_takes(clip).with_characters(shape.with_changes(spans=tuple(spans), layers=layers))


def _with_keys(project: Project, shape_id: str, number: int, keys: Sequence[TurnKey]) -> Project:
    """A project with other keys of a layer; other layers that play the same ones keep theirs."""
    shape = project.shape(shape_id)
    layer = shape.layers[number]
    old = project.takes[layer.take]
    played = sum(one.take == old.id for each in project.characters.values() for one in each.playing)
    name = old.id if played < 2 else unused(old.id, project.takes)
    project = project.with_takes(keyed_clip(name, old.skeleton.names[0], keys))
    if name == old.id:
        return project
    layers = [replace(one, take=name) if k == number else one for k, one in enumerate(shape.layers)]
    return project.with_characters(shape.with_changes(layers=tuple(layers)))
