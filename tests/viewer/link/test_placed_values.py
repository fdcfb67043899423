"""Tests of transforming values from the world of one edge into that of another."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from enliven.document import Pose, Props
from enliven.matching.match_list import MatchList, MatchRow
from enliven.person import Body
from enliven.rotation import rotate
from enliven.space.rigid_transform import compose_transform, invert, rotation_from_vector, transform_points
from enliven.wire import CameraMessage
from enliven_viewer.link.frame_clock import FrameClock
from enliven_viewer.link.placed_values import place_value
from enliven_viewer.link.received_data import ReceivedBodies, ReceivedPose

MS = 1_000_000


@st.composite
def transforms(draw: st.DrawFn) -> np.ndarray:
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    return compose_transform(rotation_from_vector(rng.normal(size=3)), rng.normal(size=3))


def values(seed: int) -> list[object]:
    rng = np.random.default_rng(seed)
    linear = rng.normal(size=(4, 3, 3)).astype(np.float32)
    pose = Pose("chair", 5, linear, rng.normal(size=(4, 3)).astype(np.float32))
    turns = rng.normal(size=(20, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    body = Body(1, rng.normal(size=(20, 3)), np.ones(20), turns)
    props = Props(
        *(5, np.arange(2), np.zeros(2, np.uint8), np.ones((2, 3), np.float32)),
        *(np.zeros((2, 3), np.uint8), rng.normal(size=(2, 3)), turns[:2]),
    )
    row = MatchRow("hip", 0, 1.0, (rng.normal(size=(3, 3)), np.zeros((0, 3))))
    return [
        ReceivedPose(pose, "edge", 1, 0, 0, 0),
        ReceivedBodies("edge", 5, 0, (body,)),
        props,
        MatchList("chair", "choosing", rows=(row,)),
        CameraMessage([1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0], [1, 1, 0.5, 0.5]),
    ]


def numbers(value: object) -> np.ndarray:
    """Returns all numbers of a value that a transform changes."""
    match value:
        case ReceivedPose():
            return np.concatenate([value.pose.linear.ravel(), value.pose.positions.ravel()])
        case ReceivedBodies():
            (body,) = value.bodies
            axes = rotate(body.orientations, np.array([1.0, 2.0, 3.0]))
            return np.concatenate([body.joints.ravel(), axes.ravel()])
        case Props():
            return np.concatenate([value.positions.ravel(), rotate(value.turns, np.ones(3)).ravel()])
        case MatchList():
            return np.concatenate([line.ravel() for line in value.rows[0].lines])
        case CameraMessage():
            return np.array(value.place)
    raise AssertionError(value)


@given(transforms(), transforms(), st.integers(0, 2**31))
def test_transforms_are_undone_and_composed(a: np.ndarray, b: np.ndarray, seed: int) -> None:
    for value in values(seed):
        there_and_back = place_value(place_value(value, a), invert(a))
        np.testing.assert_allclose(numbers(there_and_back), numbers(value), atol=1e-4)
        both = place_value(place_value(value, a), b)
        np.testing.assert_allclose(numbers(both), numbers(place_value(value, b @ a)), atol=1e-4)


@given(transforms(), st.integers(0, 2**31))
def test_a_vertex_moves_with_its_pose(transform: np.ndarray, seed: int) -> None:
    (received, *_) = values(seed)
    assert isinstance(received, ReceivedPose)
    placed = place_value(received, transform)
    vertex = np.array([0.3, -0.2, 0.8])

    def moved(pose: Pose) -> np.ndarray:
        return (np.einsum("jab,b->ja", pose.linear, vertex) + pose.positions).mean(0)

    expected = transform_points(transform, moved(received.pose))
    np.testing.assert_allclose(moved(placed.pose), expected, atol=1e-4)


def test_values_without_positions_stay_the_same() -> None:
    assert place_value("cue", np.eye(4)) == "cue"


def test_late_frames_do_not_move_the_clock_and_a_set_clock_does() -> None:
    clock, rng = FrameClock(), np.random.default_rng(0)
    for k in range(100):
        clock.add(33 * MS * k, 5_000_000 * MS + 33 * MS * k + int(rng.uniform(2, 30) * MS))
    assert abs(clock.local_ns(0, 0) - 5_000_002 * MS) < 2 * MS
    clock.add(33 * MS * 100, 9_000_000 * MS)
    assert clock.local_ns(33 * MS * 100, 0) == 9_000_000 * MS
    clock.add(0, 0)
    assert clock.local_ns(33 * MS * 100, 0) == 9_000_000 * MS, "no time is no information"
