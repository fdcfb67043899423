"""Tests of puppets on the wire: unchanged after a round trip, rigid for older programs, small, and
validated."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.document.character import Character, Pose
from enliven.document.puppet import ControlPoint, ExampleCharacter, character_from_puppet
from enliven.document.surface_settings import ArapSettings
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.wire.characters import CharacterMessage, SurfaceMessage
from enliven.wire.convert import message_to_pose, pose_to_message
from enliven.wire.convert_characters import character_to_message, message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.quantize import POSITION_STEP

few = settings(max_examples=40, deadline=None)
SOFT = ArapSettings(
    iterations=5, squash_and_stretch=False, hold=0.7, exaggeration=2.0, most_stretch=3.0, volume=0.5,
    coarse_above=900, coarse_vertices=300, guide_vertices=100,
)  # fmt: skip
CHAIR = make_chair()
TWELVE = np.linspace(0, len(CHAIR.vertices) - 1, 12).astype(int)
SMALL = Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32))


def character(count: int = 12, surface: ArapSettings = SOFT) -> Character:
    points = tuple(ControlPoint(str(k), int(v), weight=k or None) for k, v in enumerate(TWELVE[:count]))
    return character_from_puppet(ExampleCharacter("cactus", CHAIR, points, surface=surface))


def acting(seed: int, character: Character, far: float = 0.4) -> Pose:
    """Returns a pose with the puppet at a random position and rotation, and random control point
    positions.
    """
    rng = np.random.default_rng(seed)
    turn = to_matrix(from_rotation_vector(np.array([0.0, rng.uniform(-3, 3), 0.0])))
    away = rng.normal(0, far, (len(character.pivots), 3))
    away[0] = 0.0
    positions = (character.pivots + away) @ turn.T + rng.uniform(-3, 3, 3)
    linear = np.tile(turn, (len(positions), 1, 1))
    return Pose("cactus", 5, linear.astype(np.float32), positions.astype(np.float32))


PUPPET = character()
CODEC = PoseCodec(PUPPET)


def there_and_back(message: CharacterMessage) -> Character:
    data = msgspec.msgpack.encode(message)
    return message_to_character(msgspec.msgpack.decode(data, type=CharacterMessage))


def test_everything_that_the_solve_needs_comes_through() -> None:
    sent = character()
    got = there_and_back(character_to_message(sent, 3))
    assert got.kind == "points"
    assert got.surface == SOFT
    for name in ("vertices", "faces", "pivots", "held", "pulls"):
        np.testing.assert_array_equal(getattr(got, name), getattr(sent, name))
    assert got.pulls is not None
    assert got.pulls[0] == 0.0
    assert got.pulls[3] == 3.0


def test_older_program_sees_puppet_as_one_rigid_piece() -> None:
    class Before(msgspec.Struct, tag="CharacterMessage", frozen=True):
        """The message class of programs before control points were added."""

        kind: Literal["graph", "bones"]
        indices: bytes
        weights: bytes

    sent = character_to_message(character(), 0)
    old = msgspec.msgpack.decode(msgspec.msgpack.encode(sent), type=Before)
    assert not np.frombuffer(old.indices, "<u2").any()
    np.testing.assert_array_equal(np.frombuffer(old.weights, "<f4").reshape(-1, 4)[:, 0], 1.0)


def test_message_without_surface_settings_is_read() -> None:
    sent = character_to_message(character(), 0)
    older = replace_fields(sent, kind="points", pulls=None, surface=None)
    got = there_and_back(older)
    assert (got.kind, got.pulls, got.surface) == ("points", None, None)


def test_a_large_mesh_travels_without_weights_that_nobody_needs() -> None:
    side = 320
    x, z = np.meshgrid(np.arange(side), np.arange(side))
    vertices = np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3) * 0.01
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + side, corner + 1], 1)])
    puppet = ExampleCharacter("sheet", Mesh(vertices, faces), (ControlPoint("a", 0),))
    message = character_to_message(character_from_puppet(puppet), 0)
    assert message.indices == message.weights == b""
    got = there_and_back(message)
    assert got.kind == "points"
    assert got.skin.indices.shape == (side * side, 4)
    assert float(got.skin.weights.sum()) == side * side


@few
@given(st.integers(0, 10**6))
def test_a_pose_of_twelve_points_comes_through_in_few_bytes(seed: int) -> None:
    pose = acting(seed, PUPPET)
    message = pose_to_message(pose, CODEC, revision=1)
    assert len(message.transforms) < 120
    assert len(msgspec.msgpack.encode(message)) < 200
    got = message_to_pose(message, CODEC)
    assert np.abs(got.positions - pose.positions).max() <= POSITION_STEP
    assert np.abs(got.linear - pose.linear).max() < 0.01


def test_unbounded_settings_are_clamped_for_the_wire() -> None:
    wild = ArapSettings(iterations=10**6, hold=1e300, most_stretch=1e300)
    got = there_and_back(character_to_message(character(surface=wild), 0))
    assert got.surface is not None
    assert got.surface.iterations == 100
    assert np.isfinite([got.surface.hold, got.surface.most_stretch]).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"held": b"\0\0\0"},
        {"pulls": b"\0" * 8},
        {"indices": b"\0" * 8},
        {"kind": "points", "weights": b""},
    ],
)
def test_arrays_of_another_length_are_refused(changes: dict[str, object]) -> None:
    data = msgspec.msgpack.encode(msgspec.to_builtins(character_to_message(character(), 0)) | changes)
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(data, type=CharacterMessage)


@pytest.mark.parametrize(
    "changes",
    [
        {"held": np.full(12, 10**6, "<i4").tobytes()},
        {"held": np.full(12, -1, "<i4").tobytes()},
        {"pulls": np.full(12, np.nan, "<f4").tobytes()},
        {"pulls": np.full(12, -1.0, "<f4").tobytes()},
        {"kind": "points", "held": None},
    ],
)
def test_control_points_that_cannot_be_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match="points"):
        message_to_character(replace_fields(character_to_message(character(), 0), **changes))


@pytest.mark.parametrize(
    "surface", [{"iterations": 10**9}, {"hold": -1.0}, {"most_stretch": 0.1}, {"exaggeration": 1e9}, 3]
)
def test_settings_out_of_range_are_refused(surface: object) -> None:
    data = msgspec.msgpack.encode(
        msgspec.to_builtins(character_to_message(character(), 0)) | {"surface": surface}
    )
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(data, type=CharacterMessage)


@few
@given(st.data())
def test_cut_and_flipped_characters_raise_nothing_else(data: st.DataObject) -> None:
    points = tuple(ControlPoint(str(k), k, weight=k or None) for k in range(3))
    sent = character_from_puppet(ExampleCharacter("three", SMALL, points, surface=SOFT))
    raw = bytearray(msgspec.msgpack.encode(character_to_message(sent, 0)))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(raw)))
    for broken in (bytes(raw), bytes(raw[:cut])):
        try:
            got = message_to_character(msgspec.msgpack.decode(broken, type=CharacterMessage))
        except (msgspec.MsgspecError, InputError, ValueError):
            continue
        assert len(got.vertices) == 3


def test_the_message_has_the_solvers_own_defaults() -> None:
    ours, theirs = SurfaceMessage(), ArapSettings()
    assert {n: getattr(ours, n) for n in ours.__struct_fields__} == {
        n: getattr(theirs, n) for n in ours.__struct_fields__
    }


def replace_fields(message: CharacterMessage, **changes: object) -> CharacterMessage:
    """Returns a message with some fields replaced."""
    return msgspec.structs.replace(message, **changes)


def test_invalid_points_are_reported() -> None:
    with pytest.raises(InputError, match="handle weights"):
        replace(character(), pulls=np.zeros(3, np.float32))


def test_equal_poses_are_equal_bytes() -> None:
    pose = acting(3, PUPPET)
    again = replace(pose, positions=pose.positions.copy())
    assert CODEC.encode(pose).data == CODEC.encode(again).data
