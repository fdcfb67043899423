"""Tests of the pose code: the stated errors hold for every transform, and no input can break the decoder."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from enliven import rotation
from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError
from enliven.wire import bits, quantize
from enliven.wire.posecode import MAX_TRANSFORMS, PoseCodec, find_spanning_tree

SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=40, deadline=None)


def character(count: int, seed: int = 0, kind: str = "graph") -> Character:
    """Returns a character with random pivots in two cubic metres, each linked to the previous one."""
    pivots = np.random.default_rng(seed).uniform(-1, 1, (count, 3)).astype(np.float32)
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], -1).astype(np.int32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.full((3, 4), 0.25, np.float32))
    vertices = np.zeros((3, 3), np.float32)
    return Character("thing", vertices, np.array([[0, 1, 2]], np.int32), skin, pivots, edges, kind)


def random_pose(count: int, seed: int, spread: float) -> Pose:
    """Returns a random pose: any rotation, times any stretch within ``spread`` of the identity, anywhere on a
    stage.
    """
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(count, 4))
    rotation = np.stack([matrix(each) for each in q])
    a = rng.uniform(-spread, spread, (count, 3, 3))
    linear = rotation @ (np.eye(3) + 0.5 * (a + a.transpose(0, 2, 1)))
    positions = rng.uniform(-5, 5, (count, 3))
    return Pose("thing", 7, linear.astype(np.float32), positions.astype(np.float32))


def matrix(q: np.ndarray) -> np.ndarray:
    """Returns the matrix by q v q* on the axes, as a reference for ``rotation_matrix``."""
    w, x, y, z = q / np.linalg.norm(q)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * k + 2 * k @ k


def polar(a: np.ndarray) -> np.ndarray:
    """Returns the nearest rotation by singular values, as a reference for ``nearest_rotation``."""
    u, _, vt = np.linalg.svd(a)
    return u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Returns radians between two rotation matrices, accurate near 0."""
    return 2 * np.arcsin(min(1.0, float(np.linalg.norm(a - b)) / np.sqrt(8)))


def in_room(a: np.ndarray) -> np.ndarray:
    """Returns a (3, 3) view into a larger array, in the form that the codec passes to the kernels."""
    room = np.empty((4, 6))
    room[:3, :3] = a
    return room[:3, :3]


@few
@given(SEEDS, st.floats(1e-3, 30.0), st.booleans())
def test_nearest_rotation_is_that_of_the_singular_values(seed: int, scale: float, reflected: bool) -> None:
    a = scale * np.random.default_rng(seed).normal(size=(3, 3))
    if (np.linalg.det(a) < 0) != reflected:
        a[0] *= -1
    singular = np.linalg.svd(a, compute_uv=False)
    q, r, stretch = np.empty(4), in_room(np.zeros((3, 3))), np.empty(6)
    a = in_room(a)
    quantize.nearest_rotation(a, np.empty((2, 4, 6))[:, :, :4], q)
    rotation.rotation_matrix(q, r)
    assert q[0] >= 0 and np.isclose(np.linalg.norm(q), 1)
    assert np.allclose(r, matrix(q), atol=1e-12)
    assert np.trace(r.T @ a) >= np.trace(polar(a).T @ a) - 1e-9 * singular[0]
    quantize.compute_stretch(a, r, stretch)
    again = np.empty((3, 3))
    quantize.apply_stretch_entries(r, stretch, again)
    assert np.allclose(again, a, atol=1e-7 * singular[0]), "Q S must be A, reflected or not"


@pytest.mark.parametrize(
    "a",
    [np.zeros((3, 3)), np.diag([1.0, 0, 0]), -np.eye(3), np.diag([1.0, 1, -1]), np.diag([2.0, 1, 0.5]),
     np.diag([1.0, 1, 1e-9]), np.ones((3, 3)), 1e-30 * np.eye(3), np.diag([-1.0, -1, 1])],
)  # fmt: skip
def test_degenerate_matrices_still_get_a_rotation_and_their_stretch(a: np.ndarray) -> None:
    q, r, stretch, again = np.empty(4), in_room(np.zeros((3, 3))), np.empty(6), np.empty((3, 3))
    a = in_room(a)
    quantize.nearest_rotation(a, np.empty((2, 4, 6))[:, :, :4], q)
    rotation.rotation_matrix(q, r)
    assert np.isclose(np.linalg.norm(q), 1) and np.isclose(np.linalg.det(r), 1)
    quantize.compute_stretch(a, r, stretch)
    quantize.apply_stretch_entries(r, stretch, again)
    assert np.allclose(again, a, atol=1e-9)


@few
@given(SEEDS, st.floats(0.0, np.pi))
def test_rotation_vector_and_back_and_antipodes(seed: int, turn: float) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    q = np.concatenate([[np.cos(turn / 2)], np.sin(turn / 2) * axis])
    v, opposite, back = np.empty(3), np.empty(3), np.empty(4)
    quantize.rotation_vector(q, v)
    quantize.rotation_vector(-q, opposite)
    quantize.rotate_by_vector(np.array([1.0, 0, 0, 0]), *v, back)
    assert back[0] >= 0 and np.linalg.norm(v) <= np.pi + 1e-12
    assert np.allclose(np.abs(back @ q), 1, atol=1e-12)
    if turn < np.pi - 1e-6:
        assert np.array_equal(v, opposite), "q and -q are one rotation"


@few
@given(SEEDS, st.floats(0.0, 0.9), st.sampled_from(["graph", "bones"]))
def test_the_stated_errors_hold(seed: int, spread: float, kind: str) -> None:
    codec = PoseCodec(character(24, seed, kind))
    pose = random_pose(24, seed, spread)
    encoded = codec.encode(pose)
    linear, positions = codec.decode(encoded.data)
    assert encoded.clamped == 0
    assert np.abs(positions - pose.positions).max() <= quantize.POSITION_ERROR + 1e-6
    for a, b in zip(linear.astype(float), pose.linear.astype(float), strict=True):
        qa, qb = polar(a), polar(b)
        assert angle(qa, qb) <= quantize.ROTATION_ERROR + 1e-5
        assert np.abs(qa.T @ a - qb.T @ b).max() <= quantize.STRETCH_ERROR + 1e-5


@few
@given(SEEDS)
def test_encoding_is_deterministic_and_reencoding_is_stable(seed: int) -> None:
    codec, pose = PoseCodec(character(16, seed)), random_pose(16, seed, 0.3)
    data = codec.encode(pose).data
    assert codec.encode(pose).data == data == PoseCodec(character(16, seed)).encode(pose).data
    linear, positions = codec.decode(data)
    again, moved = codec.decode(codec.encode(Pose("thing", 7, linear, positions)).data)
    assert np.abs(moved - positions).max() <= quantize.POSITION_ERROR + 1e-6
    assert np.abs(again - linear).max() < 6e-3


def test_errors_do_not_add_up_along_a_chain() -> None:
    count = 600
    codec, pose = PoseCodec(character(count, 3, "bones")), random_pose(count, 3, 0.2)
    _, positions = codec.decode(codec.encode(pose).data)
    assert np.abs(positions - pose.positions).max() <= quantize.POSITION_ERROR + 1e-6


def test_a_rotation_takes_at_most_six_bytes_and_a_smooth_pose_far_less() -> None:
    thing = character(128, 1)
    codec = PoseCodec(thing)
    wild = len(codec.encode(random_pose(128, 1, 0.0)).data)
    assert wild <= 128 * (6 + 3 * 2.5), "positions at random take up to 20 bits an axis"
    still = len(codec.encode(thing.rest_pose()).data)
    assert still < 16
    turned = matrix(np.array([0.8, 0.1, 0.5, -0.2]))
    whole = Pose("thing", 0, np.tile(turned, (128, 1, 1)), thing.pivots @ turned.T + [1, 2, 3])
    assert len(codec.encode(whole).data) < 128 * 3, "a body that moves as one costs almost nothing"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_bad_transforms_are_pulled_back_and_counted_and_hurt_nobody_else(bad: float) -> None:
    codec, pose = PoseCodec(character(12, 5)), random_pose(12, 5, 0.1)
    pose.linear[3, 0, 0] = bad
    pose.positions[7, 2] = bad
    encoded = codec.encode(pose)
    linear, positions = codec.decode(encoded.data)
    assert encoded.clamped == 2
    assert np.isfinite(linear).all() and np.isfinite(positions).all()
    assert np.abs(linear).max() <= quantize.MAX_LINEAR_ENTRY * 1.01
    good = [i for i in range(12) if i not in (3, 7)]
    assert np.abs(positions - pose.positions)[good].max() <= quantize.POSITION_ERROR + 1e-6


def test_a_pose_of_another_count_is_refused_and_too_many_transforms_too() -> None:
    codec = PoseCodec(character(12))
    with pytest.raises(InputError, match="12"):
        codec.encode(random_pose(11, 0, 0.0))
    with pytest.raises(InputError, match=str(MAX_TRANSFORMS)):
        PoseCodec(character(MAX_TRANSFORMS + 1))


def test_a_pose_of_another_character_or_damaged_bytes_are_refused() -> None:
    codec, other = PoseCodec(character(12, 1)), PoseCodec(character(12, 2))
    data = codec.encode(random_pose(12, 0, 0.2)).data
    with pytest.raises(ValueError, match="another revision"):
        other.decode(data)
    for broken in (data[:-1], data + b"\0", data[:4], data[:3], b"", data[:4] + b"\xff" * 300):
        with pytest.raises(ValueError):
            codec.decode(broken)


WARM_UP = """
import numpy as np
from enliven.document.character import Character, SkinWeights
from enliven.wire import bits, posecode
posecode.warm_up()
kernels = posecode._prediction_residuals, bits.encode_columns, bits.decode_columns, posecode._restore_pose
print([len(kernel.signatures) for kernel in kernels])
skin = SkinWeights(np.zeros((3, 4), np.uint16), np.full((3, 4), 0.25, np.float32))
mesh = np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32)
edge = np.array([[0, 1]], np.int32)
character = Character("thing", *mesh, skin, np.eye(3, dtype=np.float32)[:2], edge, "graph")
codec = posecode.PoseCodec(character)
codec.decode(codec.encode(character.rest_pose()).data)
print([len(kernel.signatures) for kernel in kernels])
"""
"""Program that prints the number of compiled versions of each kernel after the warm-up, and after a pose."""


def test_warm_up_compiles_pose_kernels() -> None:
    shown = subprocess.run([sys.executable, "-c", WARM_UP], capture_output=True, text=True, check=True)
    assert shown.stdout == "[1, 1, 1, 1]\n" * 2


@few
@given(st.binary(max_size=400))
def test_random_bytes_decode_to_finite_numbers_or_are_refused(noise: bytes) -> None:
    codec = PoseCodec(character(6))
    head = codec.encode(character(6).rest_pose()).data[:4]
    try:
        linear, positions = codec.decode(head + noise)
    except ValueError:
        return
    assert np.isfinite(linear).all() and np.isfinite(positions).all()


@few
@given(arrays(np.int32, (7, 3), elements=st.integers(-bits.MAX_VALUE, bits.MAX_VALUE) | st.integers(-5, 5)))
def test_integers_survive_with_size_of_slow_reference(table: np.ndarray) -> None:
    data = bits.encode_columns(table)
    data.setflags(write=False)  # as the bytes of a message are
    back = np.empty_like(table)
    assert bits.decode_columns(data, back) and np.array_equal(back, table)
    text = "".join(slow_column([int(n) for n in column]) for column in table.T)
    text += "0" * (-len(text) % 8)
    assert data.tobytes() == bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8))


def slow_column(column: list[int]) -> str:
    """Returns a Rice-coded column as a string of bits."""
    if not any(column):
        return "1111"
    return min((slow_rice(column, k) for k in range(bits.ALL_ZERO_PARAMETER)), key=len)


def slow_rice(column: list[int], k: int) -> str:
    text = f"{k:04b}"
    for n in column:
        u = 2 * n if n >= 0 else -2 * n - 1
        low = f"{u % 2**k:0{k}b}" if k else ""
        text += (
            "1" * (u >> k) + "0" + low
            if u >> k < bits.ESCAPE_LENGTH
            else "1" * bits.ESCAPE_LENGTH + f"{u:022b}"
        )
    return text


@few
@given(SEEDS, st.integers(1, 30))
def test_the_tree_spans_and_parents_come_first(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    pivots = rng.normal(size=(count, 3))
    edges = rng.integers(0, count, (count, 2))
    order, parents = find_spanning_tree(pivots, edges)
    assert sorted(order) == list(range(count)) and parents[order[0]] == -1
    place = np.argsort(order)
    assert all(place[parents[i]] < place[i] for i in order[1:])


def test_the_tree_prefers_edges_to_neighbours() -> None:
    pivots = np.array([[0.0, 0, 0], [0, 1, 0], [0.1, 0, 0], [0.1, 1, 0]])
    _, parents = find_spanning_tree(pivots, np.array([[0, 1], [1, 3], [3, 2]]))
    assert parents.tolist() == [-1, 0, 3, 1]
