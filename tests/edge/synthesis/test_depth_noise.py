"""Tests of simulated sensor faults: statistics match the profile, and a seed gives the same faults."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from enliven.arrays import Float
from enliven.camera import Intrinsics, pixel_rays
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import SensorProfile, load_profile

CAMERA = Intrinsics(320, 240, 290.0, 290.0, 159.5, 119.5)


def _profile(name: str, **changed: object) -> SensorProfile:
    """Returns a shipped profile with some of its fault parameters changed."""
    profile = load_profile(name)
    return dataclasses.replace(profile, faults=dataclasses.replace(profile.faults, **changed))


def _wall(z: float) -> tuple[Float, np.ndarray]:
    return np.full((240, 320), z), np.zeros((240, 320), np.uint8)


@pytest.mark.parametrize("name", ["kinect1", "tof", "oak-d", "realsense-d415"])
@pytest.mark.parametrize("z", [1.1, 2.03, 3.4])
def test_a_wall_scatters_as_published(name: str, z: float) -> None:
    profile = load_profile(name)
    # Only the scatter is measured, at many phases of the quantisation: a flat wall is moved through one step.
    noise = DepthNoise(
        dataclasses.replace(profile, noise=dataclasses.replace(profile.noise, slant=0.0)), CAMERA, seed=5
    )
    errors = []
    for n in range(8):
        true = z + profile.step(z) * n / 8
        depth, material = _wall(true)
        errors.append(noise.add_noise(depth, material, n)[::4, ::4] / 1000.0 - true)
    all_errors = np.stack(errors)
    assert all_errors.std() == pytest.approx(profile.sigma(z), rel=0.12, abs=0.0004)
    assert abs(all_errors.mean()) < 0.25 * profile.sigma(z)


def test_depth_comes_in_steps_of_disparity() -> None:
    profile = load_profile("kinect1")
    depth, material = _wall(1.0)
    depth *= np.linspace(1.0, 3.6, 320)
    seen = DepthNoise(profile, CAMERA).add_noise(depth, material, 0)
    values = np.unique(seen[seen > 0])
    eighths = 8 * 580.0 * 75.0 / values
    assert np.abs(eighths - np.rint(eighths)).max() * values.max() ** 2 / (8 * 580 * 75) < 30.0
    allowed = {round(8 * 580.0 * 75.0 / n) for n in range(80, 500)}
    assert set(values.tolist()) <= allowed
    assert np.diff(values).max() > 30  # far quantisation steps are coarse


def test_neighbours_and_frames_share_noise_as_far_as_the_profile_says() -> None:
    depth, material = _wall(2.6)
    frozen = load_profile("kinect1").noise.frozen
    kinect = DepthNoise(_profile("kinect1"), CAMERA, seed=2)
    first, second = (kinect.add_noise(depth, material, n).astype(float) for n in (0, 1))
    a, b = first - first.mean(), second - second.mean()
    assert (a[:, 1:] * a[:, :-1]).mean() / a.var() > 0.6
    assert abs((a[:, 12:] * a[:, :-12]).mean()) / a.var() < 0.02
    # The fixed pattern is a part of the scatter before quantisation. Quantisation adds 1/9 to 1/3 of the
    # variance.
    assert 0.6 * frozen < (a * b).mean() / a.var() < frozen + 0.05
    tof = DepthNoise(_profile("tof"), CAMERA, seed=2).add_noise(depth, material, 0)
    c = tof - tof.mean()
    assert abs((c[:, 1:] * c[:, :-1]).mean()) / c.var() < 0.01


def _before_a_wall(profile: SensorProfile) -> np.ndarray:
    """Returns (H, W) depth of a board at 1.5 m in columns 100..219, in front of a wall at 3 m."""
    depth, material = _wall(3.0)
    depth[60:180, 100:220] = 1.5
    return DepthNoise(profile, CAMERA, seed=1).add_noise(depth, material, 0)


def test_the_projectors_shadow_is_as_wide_as_geometry_says() -> None:
    profile = _profile("kinect1", edge=0.0)
    seen = _before_a_wall(profile)
    width = 290.0 * 0.075 * (1 / 1.5 - 1 / 3.0)
    holes = (seen[80:160] == 0).sum(1)
    assert np.abs(holes - width).max() <= 1.0
    # The shadow is on the image's right, since the projector is on the left.
    assert (seen[80:160, 220 : 220 + int(width)] == 0).all()
    mirrored = dataclasses.replace(profile, range=dataclasses.replace(profile.range, baseline=0.075))
    seen = _before_a_wall(mirrored)
    assert (seen[80:160, 100 - int(width) : 100] == 0).all() and (seen[80:160, 220:] > 0).all()
    assert (_before_a_wall(_profile("tof", edge=0.0)) > 0).all()


def test_edges_have_missing_and_flying_pixels() -> None:
    seen = _before_a_wall(_profile("tof", edge=1.0, edge_holes=0.5, flying=0.5))
    rim = seen[80:160, 97:103]
    assert 0.05 < (rim == 0).mean() < 0.5
    between = (seen > 1600) & (seen < 2900)
    assert 0.1 < between[80:160, 99:101].mean() < 0.7
    assert not between[80:160, 110:210].any() and not between[:, :90].any()
    calm = _before_a_wall(_profile("tof", edge=1.0, edge_holes=0.0, flying=0.0))
    assert (calm > 0).all() and not ((calm > 1700) & (calm < 2800)).any()


def test_dark_and_reflective_surfaces_lose_pixels() -> None:
    depth, material = _wall(2.0)
    material[:, :160], material[:, 160:] = 1, 2
    seen = np.stack(
        [
            DepthNoise(_profile("kinect1", dark=0.3, mirror=0.8), CAMERA, s).add_noise(depth, material, 0)
            for s in range(8)
        ]
    )
    assert (seen[..., :160] == 0).mean() == pytest.approx(0.3, abs=0.06)
    assert (seen[..., 160:] == 0).mean() == pytest.approx(0.8, abs=0.06)


def test_depth_out_of_range_is_not_reported() -> None:
    profile = load_profile("kinect1")
    for z in (0.1, 0.6, 4.4, 60.0, math.inf):
        depth, material = _wall(z)
        assert not DepthNoise(profile, CAMERA).add_noise(depth, material, 0).any()


def test_a_floor_seen_at_a_grazing_angle_is_lost() -> None:
    ray = pixel_rays(CAMERA)
    with np.errstate(divide="ignore"):
        floor = np.where(ray[..., 1] > 0, 0.35 / ray[..., 1], np.inf)  # The floor is 35 cm below the camera.
    profile = _profile("kinect1", grazing=80.0, edge=0.0)
    seen = DepthNoise(profile, CAMERA).add_noise(floor, np.zeros((240, 320), np.uint8), 0)
    slant = np.degrees(np.arctan2(np.sqrt(1 + ray[..., 0] ** 2), ray[..., 1]))
    middle = np.s_[:, 150:170]
    assert not seen[middle][slant[middle] > 80.5].any()
    near = (slant[middle] < 79.5) & (floor[middle] > 0.95) & (floor[middle] < 3.5)
    assert seen[middle][near].all() and near.sum() > 300


def test_the_same_seed_and_number_give_the_same_image() -> None:
    depth, material = _wall(2.0)
    depth[50:, 40:90] = 1.2
    first, again, other = (
        DepthNoise(load_profile("oak-d"), CAMERA, seed).add_noise(depth, material, 3) for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert (first != other).mean() > 0.7
    sensor = DepthNoise(load_profile("oak-d"), CAMERA, 1)
    sensor.add_noise(depth, material, 0)  # the result does not depend on the order of the frames
    assert (sensor.add_noise(depth, material, 3) == first).all()
    assert (sensor.add_noise(depth, material, 4) != first).any()


@pytest.mark.parametrize("window", [1, 2, 5, 9, 14])
def test_noise_fields_are_the_box_filters_they_claim(window: int) -> None:
    noise = DepthNoise(load_profile("kinect1"), CAMERA, seed=9)
    field = noise.noise_field(4, 0, window)
    box = max(1, round(0.7 * window))
    assert field.std() == pytest.approx(1.0, abs=0.05) and abs(field.mean()) < 0.05
    if box == 1:
        return
    raw = noise.random_bytes(4, 0, (240 + 2 * box - 2, 320 + 2 * box - 2)).astype(float)
    kernel = np.convolve(np.ones(box), np.ones(box))
    patch = raw[30 : 30 + len(kernel), 77 : 77 + len(kernel)]
    slow = (kernel @ (patch - 127.5) @ kernel) / ((kernel**2).sum() * math.sqrt((256**2 - 1) / 12))
    assert field[30, 77] == pytest.approx(slow, rel=1e-9)
