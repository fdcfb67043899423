"""Tests of a person's visible fraction: occlusion, parts outside the image, and the trunk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.fit.gauss_newton import apply_step
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people.person import heights_around, mean_point
from enliven_edge.tracking.people.visibility import compute_occluded_fractions, compute_visible_trunk_fraction

CAMERA = WorkingCamera(Intrinsics(80, 60, 50, 48, 39.2, 29.7), 80)
MOUNT = world_from_level_camera(1.2)
SHAPE = (60, 80)
TRUNK = (model.PELVIS, model.CHEST, model.HEAD)


def view_of(z, mount=MOUNT):
    return FrameView(0, z, world_points(z, CAMERA.ray, mount), CAMERA, mount)


def person(z=-2.5, x=0.0):
    return Posture(np.array([x, 0.95, z]), standing_pose(), lengths=model.lengths_for_height(1.75))


def wall(metres=4.0):
    return np.full(SHAPE, float(metres))


def random_person(random) -> Posture:
    """Returns a person with random limbs at a random position around the sensor, possibly behind it."""
    start = Posture(
        random.normal([0, 1, -1.5], [1, 0.3, 1.2]), standing_pose(), model.lengths_for_height(1.7)
    )
    step = np.concatenate([np.zeros(3), random.normal(0, 0.7, model.DOFS - 3), np.zeros(12)])
    return Posture(
        *apply_step(start.position, start.rotations, start.lengths, step, model.DOF_FRAME, model.DOF_AXIS)
    )


def random_view(random) -> FrameView:
    """Returns a view with random depth and holes, from a slightly rotated sensor."""
    z = random.uniform(0.3, 4.0, SHAPE) * (random.random(SHAPE) > 0.2)
    mount = MOUNT.copy()
    x, y, roll = random.normal(0, 0.4, 3)
    mount[:3, :3] = rotation(x=x, y=y, z=roll) @ mount[:3, :3]
    mount[:3, 3] += random.normal(0, 0.3, 3)
    return view_of(z, mount)


def samples_slowly(view: FrameView, posture: Posture, pixels, frames=range(13)):
    """Returns (S,) flags of the frames' capsule ends and centres: in the image, occluded, on own pixels."""
    rows = []
    camera_from_world = np.linalg.inv(view.world_from_camera)
    fx, fy, cx, cy = view.camera.camera
    for frame, (a, b), radii in zip(model.CAPSULES.frame, *posture.capsules(), strict=True):
        if frame not in frames:
            continue
        for point in (a, 0.5 * (a + b), b):
            x, y, z = camera_from_world[:3, :3] @ point + camera_from_world[:3, 3]
            if z <= 0.1:
                rows.append((False, False, False))
                continue
            v, u = round(fy * y / z + cy), round(fx * x / z + cx)
            if not (0 <= v < SHAPE[0] and 0 <= u < SHAPE[1]):
                rows.append((False, False, False))
                continue
            rows.append((True, 0 < view.z[v, u] < z - radii.max() - 0.12, bool(pixels[v, u])))
    return np.array(rows).T


@given(st.integers(0, 100_000))
@settings(max_examples=60, deadline=None)
def test_occlusion_matches_per_sample_reference(seed):
    random = np.random.default_rng(seed)
    view, posture, owner = random_view(random), random_person(random), random.integers(-1, 2, SHAPE)
    inside, behind, own = samples_slowly(view, posture, owner == 1)
    assert compute_occluded_fractions(view, posture, owner, 1) == pytest.approx(
        (np.mean(behind & ~own), np.mean(~inside))
    )


@given(st.integers(0, 100_000), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_visible_trunk_fraction_matches_the_slow_reference(seed, share):
    """Counts samples that are in the image and not occluded; all samples if only few of these are left."""
    random = np.random.default_rng(seed)
    view, posture, pixels = random_view(random), random_person(random), random.random(SHAPE) < share
    inside, behind, own = samples_slowly(view, posture, pixels, TRUNK)
    due = inside & (own | ~behind)
    expected = np.count_nonzero(own & due) / (due.sum() if due.mean() >= 0.25 else len(due))
    assert compute_visible_trunk_fraction(view, posture, pixels) == pytest.approx(expected)


def test_unoccluded_person_is_fully_visible():
    assert compute_occluded_fractions(view_of(wall()), person(), np.full(SHAPE, -1), 0) == (0.0, 0.0)
    assert compute_visible_trunk_fraction(view_of(wall()), person(), np.ones(SHAPE, bool)) == 1.0
    assert compute_visible_trunk_fraction(view_of(wall()), person(), np.zeros(SHAPE, bool)) == 0.0


def test_board_occludes_a_person_except_at_their_own_pixels():
    board = view_of(wall(1.0))
    assert compute_occluded_fractions(board, person(), np.full(SHAPE, -1), 0) == (1.0, 0.0)
    assert compute_occluded_fractions(board, person(), np.zeros(SHAPE, np.int64), 0) == (0.0, 0.0)


def test_missing_depth_does_not_occlude():
    assert compute_occluded_fractions(view_of(np.zeros(SHAPE)), person(), np.full(SHAPE, -1), 0) == (0.0, 0.0)


@pytest.mark.parametrize("away", [person(z=2.0), person(x=9.0)])
def test_person_next_to_or_behind_sensor_is_outside_the_image(away):
    assert compute_occluded_fractions(view_of(wall(1.0)), away, np.full(SHAPE, -1), 0) == (0.0, 1.0)
    assert compute_visible_trunk_fraction(view_of(wall(1.0)), away, np.ones(SHAPE, bool)) == 0.0


@given(st.integers(0, 100_000), st.floats(0.1, 1.0))
@settings(max_examples=30, deadline=None)
def test_the_middle_and_the_top_of_somebodys_points_are_those_of_the_list_of_them(seed, share):
    random = np.random.default_rng(seed)
    points, pixels = random_view(random).points, random.random(SHAPE) < share
    place, listed = points[30, 40] + random.normal(0, 0.1, 3), points[pixels]
    np.testing.assert_allclose(mean_point(points, pixels), listed.mean(0), atol=1e-9)
    away = np.linalg.norm((listed - place)[:, [0, 2]], axis=1)
    np.testing.assert_array_equal(heights_around(points, pixels, place, 0.3), listed[away < 0.3, 1])
