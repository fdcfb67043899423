"""Keyframes by dragging: dragging a joint, a node or a whole character at a time adds a key at that time.

project = key_handle(project, "squid", "hand", place, 1.5)            # the hand's bone points at `place`
project = key_handle(project, "chair", 17, place, 0.8)                # node 17 moves to `place`
project = key_characters(project, ["bean"], 2.0, offset)              # moves the whole character
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import GraphCharacter, GraphLayer, Project, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.edits.keys import key_at, key_layer, set_key
from enliven.modeling.edits.root_layers import about as motion_about
from enliven.modeling.edits.root_layers import root_motion, root_values
from enliven.modeling.possessed.pose import evaluate_layer
from enliven.modeling.rigged.axes import Axes
from enliven.modeling.rigged.bones import bone_number
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.rotation import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    swing,
    to_rotation_vector,
)

_ORIGIN = (0.0, 0.0, 0.0)
"""The zero vector in metres: the default for offsets and positions."""


def key_handle(
    project: Project, character_id: str, handle: int | str, place: AnyArray, time: float
) -> Project:
    """Sets a key that moves a handle or a node to ``place`` (3,) metres in the world, at a time.

    For a joint, its bone is rotated to point at ``place``. A node of a possessed mesh moves there, and the
    mesh bends.

    Raises:
        InputError: if the handle is the root (no bone ends there), if ``place`` is not finite, or if the
            handles of this rig cannot have keys.
    """
    character, target = project.character(character_id), np.asarray(place, np.float64)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise InputError(
            f"{place} is not a valid position",
            where=character.where,
            remedy="Pass three finite numbers in metres.",
        )
    target = root_motion(project, character, time).inverse(target[None])[0]
    if isinstance(character, RiggedCharacter):
        return _key_joint(project, character, bone_number(character, handle), target, time)
    if isinstance(character, GraphCharacter) and not isinstance(handle, str):
        return _key_node(project, character, handle, target, time)
    remedy = "Set keys for the whole character, or change the key poses of a puppet."
    raise InputError("the handles of this character cannot have keys", where=character.where, remedy=remedy)


def key_characters(
    project: Project,
    names: Iterable[str],
    time: float,
    offset: AnyArray | Sequence[float] = _ORIGIN,
    turn: AnyArray = IDENTITY,
    about: AnyArray | Sequence[float] = _ORIGIN,
) -> Project:
    """Sets keys that move characters at a time: x becomes turn (x - about) + about + offset.

    Args:
        offset, turn, about: as in :func:`~enliven.modeling.edits.characters.move_character`.

    Raises:
        InputError: if the character does not exist, its keys do not play at that time, or a number is not
            finite.
    """
    shift, centre, key_rotation = (np.asarray(values, np.float64) for values in (offset, about, turn))
    shapes = (shift.shape, centre.shape, key_rotation.shape) == ((3,), (3,), (4,))
    if not (shapes and np.isfinite([*shift, *centre, *key_rotation]).all()):
        raise InputError(
            f"the displacement {offset} or the rotation {turn} is not valid",
            where="keys",
            remedy=(
                "Pass three finite numbers in metres and a rotation of four finite numbers (w, x, y, z)."
            ),
        )
    new_key = motion_about(normalized(key_rotation), shift, centre)
    for name in names:
        moved = new_key.after(root_motion(project, project.character(name), time))
        if key_layer(project, name, None) is None:
            project = set_key(project, name, None, time)
        character, number = project.character(name), key_layer(project, name, None)
        assert number is not None
        root = number - (len(character.playing) - len(character.root_layers))
        radians, metres = root_values(project, character, root, moved, time)
        key_degrees = np.array(key_at(project, name, None, time).degrees)
        project = set_key(
            project,
            name,
            None,
            time,
            _find_nearest_degrees(radians, key_degrees).tolist(),
            None,
            metres.tolist(),
        )
    return project


def _key_joint(project: Project, shape: RiggedCharacter, j: int, place: Float, time: float) -> Project:
    """Sets a key that points the bone of a joint at a position.

    The position ``place`` (3,) is in metres, without the effect of the root layers.
    """
    if j == 0:
        remedy = "Drag another joint, or move the whole character."
        raise InputError(
            "dragging the root joint cannot rotate a bone, because no bone ends there",
            where=shape.where,
            remedy=remedy,
        )
    seen_at = evaluate_pose(project, shape.id, time)
    turns, joints = seen_at.turns, seen_at.joints
    start = joints[int(shape.skeleton.parents[j])]
    target, bone = place - start, joints[j] - start
    if min(np.linalg.norm(target), np.linalg.norm(bone)) < 1e-9:
        return project
    turn = swing(bone / np.linalg.norm(bone), target / np.linalg.norm(target))
    # The joint's world rotation is D = P K, with the key's rotation K and the product P of the rotations
    # before it. After a further rotation w in the world it is w D = P K', so the new key is K' = K D^-1 w D.
    key_rotation = multiply(multiply(conjugate(turns[j]), turn), turns[j])
    key_degrees, axes = np.array(key_at(project, shape.id, j, time).degrees), Axes(IDENTITY, False)
    number = key_layer(project, shape.id, j)
    if number is not None:
        axes = Axes(shape.layers[number].basis, shape.layers[number].mirrored)
    added = multiply(axes.rotations(from_rotation_vector(np.radians(key_degrees))), key_rotation)
    # The layer's axes map a rotation q to L q L^-1 with L = basis S. S is the reflection of a mirrored layer.
    # It is its own inverse, so L^-1 = S basis^-1.
    own_rotation = multiply(multiply(conjugate(axes.turn), added), axes.turn)
    own_rotation = Axes(IDENTITY, axes.mirrored).rotations(own_rotation)
    degrees = _find_nearest_degrees(to_rotation_vector(normalized(own_rotation)), key_degrees)
    return set_key(project, shape.id, j, time, degrees.tolist())


def _key_node(project: Project, shape: GraphCharacter, node: int, place: Float, time: float) -> Project:
    """Sets a key that moves a node of a possessed mesh to a position.

    The position ``place`` (3,) is in metres, without the effect of the root layers.
    """
    if key_layer(project, shape.id, node) is None:
        project = set_key(project, shape.id, node, time)
    number = key_layer(project, shape.id, node)
    shape = project.graph(shape.id)
    assert number is not None
    layer = shape.playing[number]
    assert isinstance(layer, GraphLayer)
    linear, node_place, weight = evaluate_layer(project, shape, number - len(shape.parts), node, time)
    if weight <= 0.0:
        remedy = (
            "Unmute the layer, raise its weight, or move the playhead to a time at which the layer plays."
        )
        raise InputError(
            "the keys of this layer have no effect at the current time",
            where=f"layer {layer.id!r}",
            remedy=remedy,
        )
    new_key = np.linalg.solve(linear, place - node_place) / (weight * layer.size)
    back, flip = Axes(conjugate(layer.axes), False), Axes(IDENTITY, layer.mirrored)
    key_metres = np.array(key_at(project, shape.id, node, time).metres)
    return set_key(
        project, shape.id, node, time, metres=(key_metres + flip.vectors(back.vectors(new_key))).tolist()
    )


def _find_nearest_degrees(radians: Float, previous_degrees: Float) -> Float:
    """Converts a rotation vector (3,) from radians to degrees. Full turns are added so that the result is
    nearest to ``previous_degrees`` (3,).
    """
    vector = np.degrees(radians)
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        return vector
    full_turns = [vector * (1.0 + k * 360.0 / angle) for k in (-2, -1, 0, 1, 2)]
    return min(full_turns, key=lambda one: float(np.linalg.norm(one - previous_degrees)))
