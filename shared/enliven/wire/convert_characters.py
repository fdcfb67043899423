"""Converts between characters and their messages, with pure functions."""

from __future__ import annotations

import numpy as np
from msgspec.structs import asdict

from enliven.arrays import Float32, UInt16
from enliven.document import ArapSettings, Character, SkinWeights
from enliven.errors import InputError
from enliven.wire.characters import (
    MAX_ITERATIONS,
    MAX_JOINT_NAME,
    MAX_SOLVED_VERTICES,
    MAX_STIFFNESS,
    CharacterMessage,
    SurfaceMessage,
)
from enliven.wire.convert_materials import materials_to_message, message_to_materials
from enliven.wire.fields import MAX_FACES, MAX_VERTICES, from_bytes, to_bytes

_MAX_RIGID_VERTICES = 100_000
"""Maximum number of vertices for which skin weights are sent although all vertices follow one transform.
Older viewers need the weights, which take 24 bytes per vertex."""


def character_to_message(character: Character, revision: int) -> CharacterMessage:
    """Returns the message of a complete character.

    Raises:
        InputError: if its id or its mesh is too large for a message.
    """
    _check_size(character)
    skinned = character.kind != "points" or len(character.vertices) <= _MAX_RIGID_VERTICES
    colours, surface = character.colours, character.surface
    return CharacterMessage(
        character.id,
        revision,
        "bones" if character.kind == "points" and skinned else character.kind,  # type: ignore[arg-type]
        len(character.vertices),
        len(character.faces),
        len(character.pivots),
        len(character.edges),
        to_bytes(character.vertices, "<f4"),
        to_bytes(character.faces, "<i4"),
        to_bytes(character.skin.indices, "<u2") if skinned else b"",
        to_bytes(character.skin.weights, "<f4") if skinned else b"",
        to_bytes(character.pivots, "<f4"),
        to_bytes(character.edges, "<i4"),
        None if colours is None else to_bytes(colours, "u1"),
        None if character.held is None else to_bytes(character.held, "<i4"),
        None if character.pulls is None else to_bytes(character.pulls, "<f4"),
        None if surface is None else _surface_message(surface),
        _joint_names(character),
        materials_to_message(character.materials),
        None if character.stiffness is None else to_bytes(character.stiffness, "<f4"),
    )


def message_to_character(message: CharacterMessage) -> Character:
    """Returns the character of a message. All checks of :class:`Character` are applied.

    Raises:
        InputError: if a number is not finite or an index is out of range.
    """
    numbers = [from_bytes(d, "<f4", 1) for d in (message.vertices, message.weights, message.pivots)]
    if not all(np.isfinite(a).all() for a in numbers):
        raise InputError(
            "a vertex, weight or pivot is not a finite number", where=f"character {message.id!r}"
        )
    colours = message.colours
    surface = message.surface
    return Character(
        message.id,
        from_bytes(message.vertices, "<f4", 3),
        from_bytes(message.faces, "<i4", 3),
        _skin_weights(message),
        from_bytes(message.pivots, "<f4", 3),
        from_bytes(message.edges, "<i4", 2),
        message.kind if message.held is None else "points",
        None if colours is None else from_bytes(colours, "u1", 3),
        None if message.held is None else from_bytes(message.held, "<i4", 1)[:, 0],
        None if message.pulls is None else from_bytes(message.pulls, "<f4", 1)[:, 0],
        None if surface is None else ArapSettings(**asdict(surface)),
        None if message.names is None else tuple(message.names),
        message_to_materials(message.materials),
        None if message.stiffness is None else from_bytes(message.stiffness, "<f4", 1)[:, 0],
    )


def _joint_names(character: Character) -> list[str] | None:
    """Returns the names of the joints, or None if a name is empty or too long for a message."""
    names = list(character.names or ())
    return names if names and all(0 < len(name) <= MAX_JOINT_NAME for name in names) else None


def _skin_weights(message: CharacterMessage) -> SkinWeights:
    """Returns the skin weights. If the message contains none, every vertex follows the first transform."""
    if message.indices:
        return SkinWeights(from_bytes(message.indices, "<u2", 4), from_bytes(message.weights, "<f4", 4))
    shape = (message.vertex_count, 4)
    indices: UInt16 = np.broadcast_to(np.zeros(4, np.uint16), shape)
    weights: Float32 = np.broadcast_to(np.array([1, 0, 0, 0], np.float32), shape)
    return SkinWeights(indices, weights)


def _surface_message(settings: ArapSettings) -> SurfaceMessage:
    """Returns the message of the settings. Infinite limits are replaced by the largest values that a message
    can contain."""
    return SurfaceMessage(
        min(settings.iterations, MAX_ITERATIONS),
        settings.squash_and_stretch,
        min(settings.hold, MAX_STIFFNESS),
        settings.exaggeration,
        min(settings.most_stretch, MAX_STIFFNESS),
        settings.follow,
        settings.volume,
        min(settings.coarse_above, MAX_VERTICES),
        min(settings.coarse_vertices, MAX_SOLVED_VERTICES),
        min(settings.guide_vertices, MAX_SOLVED_VERTICES),
    )


def _check_size(character: Character) -> None:
    if not 1 <= len(character.id) <= 64:
        raise InputError(
            f"the id has {len(character.id)} characters, but must have 1 to 64",
            where=f"character {character.id[:80]!r}",
            remedy="Choose an id with 1 to 64 characters.",
        )
    if len(character.vertices) > MAX_VERTICES or len(character.faces) > MAX_FACES:
        raise InputError(
            f"the mesh has {len(character.vertices)} vertices and {len(character.faces)} faces, but at most "
            f"{MAX_VERTICES} vertices and {MAX_FACES} faces can be sent",
            where=f"character {character.id!r}",
            remedy="Simplify the mesh.",
        )
