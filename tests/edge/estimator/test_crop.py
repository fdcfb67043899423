"""Tests of the crop: it equals a slow reference and is independent of the sensor's tilt and distance."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people_for_estimator import fresh, scene

from enliven_edge.tracking.estimator.crop import (
    CHANNELS,
    COLUMNS,
    CROP_MARGIN,
    MAX_CELL_M,
    MIN_CELL_M,
    ROWS,
    Crop,
    crop_person,
)
from enliven_synthesis.training.samples import crop_coordinates

SEEDS = st.integers(0, 100_000)
QUARTERS = (0.25, 0.75)


def slow_image(z, mask, camera, pose, crop: Crop) -> np.ndarray:
    """Returns the four channels as the mean of the four quarters of each cell, one quarter at a time."""
    image = np.zeros((CHANNELS, ROWS, COLUMNS))
    for below in QUARTERS:
        for right in QUARTERS:
            row, column = np.mgrid[:ROWS, :COLUMNS]
            flat = [(column + right - COLUMNS / 2) * crop.cell, (row + below - ROWS / 2) * crop.cell]
            plane = np.stack([*flat, np.zeros(row.shape)], -1).reshape(-1, 3)
            image += 0.25 * quarter(z, mask, camera, pose, crop, crop.to_camera(plane)).T.reshape(image.shape)
    return image


def quarter(z, mask, camera, pose, crop: Crop, points) -> np.ndarray:
    """Returns (N, 4) channels of the pixels nearest to N points in the camera's frame."""
    u = np.floor(camera[0] * points[:, 0] / points[:, 2] + camera[2] + 0.5).astype(int)
    v = np.floor(camera[1] * points[:, 1] / points[:, 2] + camera[3] + 0.5).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < z.shape[1]) & (v < z.shape[0])
    away = np.where(inside, z[v * inside, u * inside], 0.0)
    person = inside & mask[v * inside, u * inside]
    met = points / points[:, 2:] * away[:, None] @ pose[:3, :3].T + pose[:3, 3]
    hides = (away < crop.depth - 0.1) & (met[:, 1] > 0.08)
    unknown = (away == 0.0) | (hides & ~person)
    return np.stack([person, person * (away - crop.depth), person * met[:, 1], unknown], 1)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_compiled_crop_matches_the_slow_reference(seed):
    z, mask, camera, pose = scene(seed)
    crop = crop_person(z, mask, camera, pose)
    np.testing.assert_allclose(crop.image, slow_image(z, mask, camera, pose, crop), atol=1e-4)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_the_middle_is_that_of_the_person_without_their_outliers(seed):
    z, mask, camera, pose = scene(seed)
    crop = crop_person(z, mask, camera, pose)
    v, u = np.nonzero(mask)
    along = np.stack([(u - camera[2]) / camera[0], (v - camera[3]) / camera[1]], 1) @ crop.axes.T
    ordered, first = np.sort(along, 0), int(0.01 * len(v))
    low, high = ordered[first], ordered[len(v) - 1 - first]
    np.testing.assert_allclose(crop.centre, (low + high) / 2, atol=1e-12)
    assert crop.depth == np.sort(z[mask])[len(v) // 2]
    needed = CROP_MARGIN * crop.depth * max((high - low) / (COLUMNS, ROWS))
    assert crop.cell == pytest.approx(min(MAX_CELL_M, max(MIN_CELL_M, needed)))


@given(SEEDS, st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_a_cell_is_never_too_small_nor_too_large(seed, larger):
    z, mask, camera, pose = scene(seed)
    crop = crop_person(z, mask, camera, pose, np.array([0.0, 0.0, 0.0, larger]))
    assert MIN_CELL_M <= crop.cell <= MAX_CELL_M


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_up_in_the_world_is_up_in_the_crop(seed):
    *_, pose = case = scene(seed)
    crop = crop_person(*case)
    np.testing.assert_allclose(crop.axes @ crop.axes.T, np.eye(2), atol=1e-12)
    assert np.linalg.det(crop.axes) == pytest.approx(1.0), "left and right are never exchanged"
    right, down = crop.axes @ pose[1, :2]
    hanging = np.hypot(*pose[1, :2]) < 0.2  # seen from above or below, no direction in the image is vertical
    assert hanging or (abs(right) < 1e-9 and down < 0)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_crop_and_camera_frames_are_inverse(seed):
    crop = crop_person(*scene(seed))
    points = np.random.default_rng(seed).normal([0, 0, 2], [1, 1, 0.5], (30, 3))
    points = points[points[:, 2] > 0.2]
    np.testing.assert_allclose(crop.to_camera(crop_coordinates(crop, points)), points, atol=1e-9)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_ray_meets_the_cell_that_its_points_are_in(seed):
    """However far along the ray they are."""
    crop = crop_person(*scene(seed))
    dice = np.random.default_rng(seed)
    points = dice.normal([0, 0, 2], [1, 1, 0.2], (30, 3))
    flat = crop_coordinates(crop, points * dice.uniform(0.5, 2.0, (30, 1)))[:, :2]
    np.testing.assert_allclose(crop.cells(points[:, :2] / points[:, 2:]), flat / crop.cell, atol=1e-9)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_sensor_that_hangs_upside_down_sees_the_same(seed):
    z, mask, camera, pose = scene(seed)
    if np.hypot(*pose[1, :2]) < 0.2:
        return  # seen from above, no direction in the image is vertical
    height, width = z.shape
    turned, hung = pose.copy(), camera.copy()
    turned[:3, :2] *= -1.0
    hung[2:] = width - 1 - camera[2], height - 1 - camera[3]
    upright = crop_person(z, mask, camera, pose)
    other = crop_person(z[::-1, ::-1].copy(), mask[::-1, ::-1].copy(), hung, turned)
    np.testing.assert_allclose(other.image, upright.image, atol=1e-4)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_person_twice_as_far_through_twice_the_lens_looks_the_same(seed):
    """Only the perspective of a body with depth differs."""
    z, mask, camera, _ = scene(seed)
    level = np.diag([1.0, -1.0, -1.0, 1.0])
    near = crop_person(z, mask, camera, level)
    tele = camera * [2, 2, 1, 1]
    far = crop_person(np.where(z > 0, z + near.depth, 0.0), mask, tele, level)
    assert far.cell == pytest.approx(near.cell)
    assert np.abs(far.image[:2] - near.image[:2]).mean() < 0.01
    assert np.abs(far.image[2] - near.image[2]).mean() < 0.05


@given(SEEDS, st.floats(-0.5, 0.5))
@settings(max_examples=25, deadline=None)
def test_lower_floor_only_changes_the_persons_height(seed, raised):
    case = scene(seed)
    there, higher = crop_person(*case).image, crop_person(*case, raised=raised).image
    np.testing.assert_allclose(higher[2], there[2] + raised * there[0], atol=1e-5)
    assert np.array_equal(higher[[0, 1, 3]], there[[0, 1, 3]])


def test_people_fill_their_crops_and_fit_in():
    for number in range(12):
        case = fresh(number)
        crop = crop_person(case.z, case.mask, case.picture.camera, case.picture.world_from_camera)
        v, u = np.nonzero(case.mask)
        rays = (np.stack([u, v], 1) - case.picture.camera[2:]) / case.picture.camera[:2]
        cells = np.abs(crop.cells(rays))
        assert np.mean((cells[:, 0] < COLUMNS / 2) & (cells[:, 1] < ROWS / 2)) > 0.9, number
        spans = np.ptp(crop.cells(rays), axis=0) / (COLUMNS, ROWS)
        assert spans.max() > 0.6 or crop.cell == MIN_CELL_M, number


def test_an_image_is_not_touched():
    z, mask, camera, pose = scene(3)
    kept = z.copy(), mask.copy(), camera.copy(), pose.copy()
    crop = crop_person(z, mask, camera, pose)
    assert all(np.array_equal(a, b) for a, b in zip(kept, (z, mask, camera, pose), strict=True))
    assert dataclasses.replace(crop).image.dtype == np.float32


@settings(deadline=None, max_examples=30)
@given(SEEDS, st.floats(0.0, 6.3), st.floats(0.5, 6.0))
def test_points_go_to_the_camera_and_rays_to_cells_as_matrices_take_them(seed, angle, depth):
    rng = np.random.default_rng(seed)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    crop = Crop(np.zeros((CHANNELS, ROWS, COLUMNS), np.float32), depth, 0.03, axes, rng.normal(size=2))
    points, rays = rng.normal(size=(5, 3)), rng.normal(size=(4, 2))
    z = np.maximum(points[:, 2:] + depth, 0.1)
    at = np.concatenate([(points[:, :2] / depth + crop.centre) @ axes * z, z], 1)
    np.testing.assert_allclose(crop.to_camera(points), at, rtol=1e-12, atol=1e-12)
    cells = (rays @ axes.T - crop.centre) * (depth / crop.cell)
    np.testing.assert_allclose(crop.cells(rays), cells, rtol=1e-12, atol=1e-10)
