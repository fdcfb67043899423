"""Tests of cameras: framed subjects are in view, and walking ones stay in view."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_viewer.render.camera import FilmCamera, OrbitCamera, look_at, make_orthographic, make_perspective
from enliven_viewer.render.camera_moves import CameraMoves

number = st.floats(-3, 3)
size = st.floats(0.1, 2)
aspects = st.sampled_from([0.5, 1.0, 4 / 3, 16 / 9, 3.0])


def box_at(centre: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    return centre - half, centre + half


def inner_points(box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Returns (6, 3) the centres of a box's faces, which are inside the framed region."""
    middle, half = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
    return middle + np.vstack([np.diag(half), -np.diag(half)])


@given(number, st.floats(0.5, 2), number, size, aspects, st.floats(-3, 3), st.floats(-1, 1))
@settings(deadline=None, max_examples=80)
def test_framed_subject_is_in_view(x, y, z, half, aspect, across, up) -> None:
    camera = OrbitCamera()
    camera.orbit(across, up)
    box = box_at(np.array([x, y, z]), half)
    camera.frame(box, aspect, at_once=True)
    seen = camera.view(aspect).project(inner_points(box))
    assert np.abs(seen).max() < 1
    assert np.abs(seen).max() > 0.25


def test_the_default_view_is_from_the_front_right_and_above() -> None:
    camera = OrbitCamera()
    camera.frame(box_at(np.zeros(3), 1.0), 1.5, at_once=True, reset=True)
    eye = camera.view(1.5).eye
    assert eye[0] > 0 and eye[1] > 0 and eye[2] > eye[0]


def test_the_target_is_in_the_middle_and_up_is_up() -> None:
    target = np.array([1.0, 2.0, 3.0])
    view = look_at(np.array([4.0, 3.0, 8.0]), target)
    assert np.allclose((view @ [*target, 1])[:2], 0)
    assert (view @ [1, 3, 3, 1])[1] > 0
    assert np.allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3))


def test_perspective_and_orthographic_map_their_ends() -> None:
    clip = make_perspective(math.radians(60), 1.0, 0.5, 10) @ np.array([[0, 0, -0.5, 1], [0, 0, -10, 1]]).T
    assert np.allclose(clip[2] / clip[3], [-1, 1])
    corner = make_orthographic(np.array([-1.0, -2, -9]), np.array([3.0, 4, -1])) @ [3, 4, -9, 1]
    assert np.allclose(corner, [1, 1, 1, 1])


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=20))
@settings(deadline=None, max_examples=40)
def test_a_user_cannot_get_lost_below_the_floor(moves: list[tuple[float, float]]) -> None:
    camera = OrbitCamera()
    for across, up in moves:
        camera.orbit(across, up)
        camera.pan(across, up)
        camera.zoom(math.exp(across))
        camera.advance(0.1)
        view = camera.view(1.5)
        assert view.eye[1] > 0 and np.isfinite(view.clip_from_world).all()


def test_moves_are_eased_in_and_arrive() -> None:
    camera = OrbitCamera()
    start = camera.view(1.0).eye
    camera.orbit(1.0, 0.0)
    assert np.allclose(camera.view(1.0).eye, start)
    camera.advance(0.06)
    halfway = camera.view(1.0).eye
    camera.advance(60)
    assert 0 < np.linalg.norm(halfway - start) < np.linalg.norm(camera.view(1.0).eye - start)


def test_zooming_there_and_back_is_undone() -> None:
    camera = OrbitCamera()
    camera.advance(9)
    before = camera.view(1.0).eye
    camera.zoom(0.8)
    camera.zoom(1 / 0.8)
    camera.advance(9)
    assert np.allclose(camera.view(1.0).eye, before)


@pytest.mark.parametrize("speed", [0.5, 2.0, 6.0])
def test_a_film_keeps_whatever_walks_in_the_picture(speed: float) -> None:
    camera = FilmCamera()
    for k in range(240):
        centre = np.array([speed * k / 30, 0.9 + 0.2 * math.sin(k / 5), -speed * k / 60])
        box = box_at(centre, 0.8)
        camera.follow(box, 1 / 30, 16 / 9)
        assert np.abs(camera.view(16 / 9).project(centre[None])).max() < 0.6


def test_camera_moves_little_for_a_standing_person() -> None:
    camera = FilmCamera()
    eyes = []
    for _ in range(300):
        camera.follow(box_at(np.array([0, 0.9, 0]), 0.9), 1 / 30, 16 / 9)
        eyes.append(camera.view(16 / 9).eye)
    assert 0 < np.abs(np.diff(eyes, axis=0)).max() < 0.03


def test_a_film_does_not_shake_with_its_subject() -> None:
    camera, rng, eyes = FilmCamera(), np.random.default_rng(0), []
    for _ in range(120):
        camera.follow(box_at(np.array([0, 0.9, 0]) + rng.normal(0, 0.03, 3), 0.9), 1 / 30, 16 / 9)
        eyes.append(camera.view(16 / 9).eye)
    assert np.abs(np.diff(eyes, axis=0)).mean() < 0.01


@pytest.mark.slow
@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(-3, 3), st.floats(0.05, 1.0), st.floats(1 / 120, 0.1))
@settings(deadline=None, max_examples=60)
def test_followed_subject_stays_in_view_from_the_same_side(x, z, across, up, step) -> None:
    camera, moves = OrbitCamera(), CameraMoves()
    camera.orbit(across, up)
    half = np.array([0.3, 0.9, 0.3])
    begin, pace = np.array([0.0, 0.9, 0.0]), np.array([x, 0.0, z])
    camera.frame((begin - half, begin + half), 1.5, at_once=True, margin=1.6)
    moves.toggle_follow()
    offset = camera.view(1.5).eye - begin
    for k in range(80):
        middle = begin + pace * step * k
        moves.advance(camera, (middle - half, middle + half), step)
        camera.advance(step)
        seen = camera.view(1.5).project(middle[None])
        assert np.abs(seen).max() < 1
    for _ in range(200):
        moves.advance(camera, (middle - half, middle + half), 0.1)
        camera.advance(0.1)
    np.testing.assert_allclose(camera.view(1.5).eye - middle, offset, atol=1e-3)


def test_a_pan_while_it_follows_is_kept_and_switching_on_moves_nothing() -> None:
    camera, moves = OrbitCamera(), CameraMoves()
    box = (np.array([4.0, 0.0, 0.0]), np.array([5.0, 1.0, 1.0]))
    before = camera.target
    moves.toggle_follow()
    moves.advance(camera, box, 0.1)
    camera.advance(10.0)
    np.testing.assert_allclose(camera.target, before)
    camera.pan(0.2, 0.0)
    camera.advance(10.0)
    panned = camera.target
    moves.advance(camera, box, 0.1)
    camera.advance(10.0)
    np.testing.assert_allclose(camera.target, panned)


def test_turntable_returns_to_its_start() -> None:
    camera, moves = OrbitCamera(), CameraMoves()
    begin = camera.view(1.0).eye
    moves.toggle_turntable()
    eyes = []
    for _ in range(160):
        moves.advance(camera, None, 0.1)
        camera.advance(10.0)
        eyes.append(camera.view(1.0).eye)
    assert np.linalg.norm(eyes[79] - begin) > 5
    np.testing.assert_allclose(eyes[-1], begin, atol=1e-6)
