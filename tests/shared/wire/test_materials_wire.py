"""Tests of materials on the wire: sent materials arrive, too large ones are omitted, and invalid ones
refused.
"""

from __future__ import annotations

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document import Character, SkinWeights
from enliven.errors import InputError
from enliven.meshes import MeshMaterials, Texture
from enliven.wire import CharacterMessage, character_to_message, message_to_character

PNG = b"\x89PNG\r\n\x1a\n"


def texture(size: int = 40, sampler: str = "") -> Texture:
    return Texture(np.frombuffer(PNG + bytes(size), np.uint8), sampler)


def painted(faces: int, sets: int = 1, tinted: bool = False, textures: int = 1) -> Character:
    dice = np.random.default_rng(faces)
    definitions = [json.dumps({"emissiveTexture": {"index": k}}) for k in range(textures)] or ["{}"]
    uvs = dice.random((faces, 3, sets, 2)).astype(np.float32)
    tints = dice.random((faces, 3, 4)).astype(np.float32) if tinted else None
    of = dice.integers(-1, len(definitions), faces).astype(np.int32)
    pictures = tuple(texture(40 + k, '{"wrapS": 33071}') for k in range(textures))
    skin = SkinWeights(np.zeros((5, 4), np.uint16), np.eye(4, dtype=np.float32)[np.zeros(5, int)])
    where = dice.random((5, 3)).astype(np.float32)
    own = MeshMaterials(tuple(definitions), pictures, of, uvs, tints)
    none, pivots = np.zeros((0, 2), np.int32), np.zeros((1, 3), np.float32)
    corners = dice.integers(0, 5, (faces, 3)).astype(np.int32)
    return Character("made up", where, corners, skin, pivots, none, materials=own)


def sent(character: Character) -> Character:
    data = msgspec.msgpack.encode(character_to_message(character, 3))
    return message_to_character(msgspec.msgpack.decode(data, type=CharacterMessage))


@given(st.integers(1, 9), st.integers(0, 3), st.booleans(), st.integers(0, 3))
@settings(deadline=None, max_examples=40)
def test_materials_arrive_as_they_were_sent(faces: int, sets: int, tinted: bool, textures: int) -> None:
    character = painted(faces, sets, tinted, textures)
    before, after = character.materials, sent(character).materials
    assert before is not None and after is not None
    assert after.definitions == before.definitions
    for name in ("of", "uvs", "tints"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    pictures = [[(t.image.tobytes(), t.sampler) for t in each.textures] for each in (before, after)]
    assert pictures[0] == pictures[1]


def test_message_without_materials_is_unchanged() -> None:
    assert sent(replace(painted(2), materials=None)).materials is None


def test_too_large_textures_are_left_out_of_the_character() -> None:
    character = painted(2)
    large = replace(character.materials, textures=(texture(1 << 24),))
    assert sent(replace(character, materials=large)).materials is None


WRONG = {
    "of": bytes(4),
    "uvs": bytes(8),
    "tints": bytes(3),
    "sets": 2,
    "definitions": ["{}", "no json"],
    "textures": [{"image": b"GIF89a..", "sampler": ""}],
}


@pytest.mark.parametrize("name", WRONG)
def test_materials_that_do_not_fit_the_character_are_refused(name: str) -> None:
    plain = msgspec.to_builtins(character_to_message(painted(2), 1))
    plain["materials"][name] = WRONG[name]
    with pytest.raises((InputError, msgspec.ValidationError)):
        message_to_character(msgspec.convert(plain, CharacterMessage))


def test_a_definition_that_is_nested_without_end_is_refused() -> None:
    plain = msgspec.to_builtins(character_to_message(painted(2), 1))
    plain["materials"]["definitions"][0] = '{"a":' * 2500 + "1" + "}" * 2500
    with pytest.raises(InputError):
        message_to_character(msgspec.convert(plain, CharacterMessage))
    plain["materials"]["definitions"][0] = '{"a":' * 900 + "1" + "}" * 900
    try:
        message_to_character(msgspec.convert(plain, CharacterMessage))  # read, or an InputError
    except InputError as error:
        assert "nested" in str(error) or "JSON" in str(error)


def test_textures_of_more_bytes_than_allowed_are_refused() -> None:
    plain = msgspec.to_builtins(character_to_message(painted(2), 1))
    plain["materials"]["textures"] = [{"image": PNG + bytes(9 << 20), "sampler": ""}] * 2
    with pytest.raises(msgspec.ValidationError, match="textures have"):
        msgspec.convert(plain, CharacterMessage)
