"""Converts between the materials of characters and their messages, without decoding textures."""

from __future__ import annotations

import numpy as np

from enliven.errors import InputError
from enliven.meshes import MeshMaterials, Texture
from enliven.wire.characters import (
    MAX_DEFINITION,
    MAX_MATERIALS,
    MAX_TEXTURE_BYTES,
    MaterialsMessage,
    TextureMessage,
)
from enliven.wire.fields import from_bytes, to_bytes

_MAX_UV_SETS = 4
"""Maximum number of sets of texture coordinates in a message."""


def materials_to_message(materials: MeshMaterials | None) -> MaterialsMessage | None:
    """Returns the message of materials. Returns None if there are none, or if they are too large for a
    message."""
    if materials is None:
        return None
    size = sum(len(texture.image) for texture in materials.textures)
    longest = max(map(len, materials.definitions), default=0)
    part_count = max(len(materials.definitions), len(materials.textures))
    samplers = max((len(texture.sampler) for texture in materials.textures), default=0)
    sets = materials.uvs.shape[2]
    if size > MAX_TEXTURE_BYTES or part_count > MAX_MATERIALS or sets > _MAX_UV_SETS:
        return None
    if max(longest, samplers) > MAX_DEFINITION:
        return None
    textures = [
        TextureMessage(np.asarray(texture.image).tobytes(), texture.sampler) for texture in materials.textures
    ]
    tints = None if materials.tints is None else to_bytes(materials.tints, "<f4")
    of, uvs = to_bytes(materials.of, "<i4"), to_bytes(materials.uvs, "<f4")
    return MaterialsMessage(list(materials.definitions), textures, of, sets, uvs, tints)


def message_to_materials(message: MaterialsMessage | None) -> MeshMaterials | None:
    """Returns the materials of a message. The checks are the same as for the materials of a file.

    Raises:
        InputError: if the arrays are inconsistent, or a material is not a JSON object.
    """
    if message is None:
        return None
    of = from_bytes(message.of, "<i4", 1)[:, 0]
    uvs = np.frombuffer(message.uvs, "<f4").reshape(len(of), 3, message.sets, 2)
    tints = None if message.tints is None else from_bytes(message.tints, "<f4", 4).reshape(-1, 3, 4)
    try:
        textures = tuple(
            Texture(np.frombuffer(texture.image, np.uint8), texture.sampler) for texture in message.textures
        )
        return MeshMaterials(tuple(message.definitions), textures, of, uvs, tints)
    except RecursionError:
        raise InputError("a material is nested too deeply", where="materials") from None
