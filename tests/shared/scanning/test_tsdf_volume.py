"""Tests of the fusion of depth images: its invariants, and a slow reference."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.scanning import TsdfVolume, VolumeSettings, extract_surface
from enliven.scanning.blocks import SIDE, VOXELS, BlockTable

sys.path.insert(0, str(Path(__file__).parent))
from scenes import CAMERA, EVEN, SETTINGS, fused_sphere, looking, plane_depth, prepared, sphere_depth


def slow_distance(volume, view, pose, voxel):
    """Returns (distance, weight) that one image gives the voxel (3,), computed as documented."""
    band, lens = volume.band, view.intrinsics
    x, y, z = pose[:3, :3].T @ (voxel * band.voxel - pose[:3, 3])
    if z <= 0.01:
        return None
    u, v = lens.fx * x / z + lens.cx + 0.5, lens.fy * y / z + lens.cy + 0.5
    if not (0 <= u < lens.width and 0 <= v < lens.height):
        return None
    plane, worth = view.planes[int(v), int(u)], view.weights[int(v), int(u)]
    along = plane[:3] @ [x, y, z]
    distance = along - plane[3]
    if distance <= -band.behind or distance * z / along > 2.0 * band.behind:
        return None
    if distance >= band.front:
        return band.front, 1.0
    return distance, worth * max(0.1, 1.0 - abs(distance) / band.behind)


def test_compiled_fusion_matches_the_slow_reference():
    volume, poses = TsdfVolume(SETTINGS), [looking(0.0), looking(0.5), looking(-0.4, 1.2, 0.3)]
    views = [prepared(sphere_depth((0.02, 0, 0.05), 0.3, pose)) for pose in poses]
    for view, pose in zip(views, poses, strict=True):
        volume.allocate(view, pose)
    for view, pose in zip(views, poses, strict=True):
        volume.integrate(view, pose)
    random, compared = np.random.default_rng(1), 0
    for b in random.choice(volume.blocks.count, 12, replace=False):
        for i in random.choice(VOXELS, 40, replace=False):
            place = volume.blocks.places[b] * SIDE + [i % SIDE, i // SIDE % SIDE, i // SIDE**2]
            samples = [
                slow_distance(volume, view, pose, place) for view, pose in zip(views, poses, strict=True)
            ]
            samples = [pair for pair in samples if pair is not None]
            total = sum(weight for _, weight in samples)
            # Rounding may assign a voxel at the border of two pixels to either.
            if total == 0 or not np.isclose(volume.weight[b, i], total, rtol=1e-3):
                continue
            mean = sum(distance * weight for distance, weight in samples) / total
            assert volume.distance[b, i] == pytest.approx(mean, abs=2e-4)
            compared += 1
    assert compared > 100


@settings(max_examples=10)
@given(order=st.permutations(range(5)))
def test_the_order_of_images_does_not_matter(order):
    poses = [looking(0.2 * k, 1.0 + 0.05 * k) for k in range(5)]
    views = [prepared(sphere_depth((0, 0, 0), 0.3, pose)) for pose in poses]
    volumes = [TsdfVolume(SETTINGS), TsdfVolume(SETTINGS)]
    for volume, turn in zip(volumes, (range(5), order), strict=True):
        for k in range(5):
            volume.allocate(views[k], poses[k])
        for k in turn:
            volume.integrate(views[k], poses[k])
    a, b = volumes
    at = b.blocks.find(a.blocks.places[: a.blocks.count])
    assert (at >= 0).all()
    np.testing.assert_allclose(a.weight[: len(at)], b.weight[at], rtol=1e-5)
    # Averages in float32: some units in the last place of the band.
    np.testing.assert_allclose(a.distance[: len(at)], b.distance[at], atol=1e-6)


@settings(max_examples=20)
@given(
    tilt=st.floats(-0.5, 0.5), turn=st.floats(-0.5, 0.5), distance=st.floats(0.7, 1.6), roll=st.floats(-3, 3)
)
def test_the_surface_of_a_plane_is_the_plane(tilt, turn, distance, roll):
    pose = looking(roll)
    normal = (
        pose[:3, :3] @ rotation.to_matrix(rotation.from_rotation_vector([tilt, turn, 0.0])) @ [0, 0, -1.0]
    )
    offset = normal @ (pose[:3, 3] + distance * pose[:3, 2])
    volume = TsdfVolume(SETTINGS)
    view = prepared(plane_depth(normal, offset, pose))
    volume.allocate(view, pose)
    volume.integrate(view, pose)
    surface = extract_surface(volume)
    assert len(surface.faces) > 100
    # float32: a ten-thousandth of a voxel and of the distance.
    assert np.abs(surface.vertices @ normal - offset).max() < 2e-5


@settings(max_examples=6)
@given(sigma=st.floats(0.005, 0.02), seed=st.integers(0, 1000))
def test_noise_does_not_move_a_surface(sigma, seed):
    volume, pose, random = TsdfVolume(SETTINGS), looking(0.0), np.random.default_rng(seed)
    true = plane_depth(np.array([0.0, 0.0, -1.0]), 0.0, pose)
    for _ in range(40):
        # The noise of a whole image, up to a third of the band behind: planes through it stay planes.
        volume.integrate(prepared(true + random.normal(0.0, sigma)), pose)
    # The mean of 40 draws; one of ten thousand is 4 deviations off.
    assert abs(np.median(extract_surface(volume).vertices[:, 2])) < 4 * sigma / np.sqrt(40)
    bias = []
    for side in (-1, 1):
        both = TsdfVolume(SETTINGS)
        for off in (sigma, -sigma)[::side]:
            both.integrate(prepared(true + off), pose)
        bias.append(np.median(extract_surface(both).vertices[:, 2]))
    assert np.abs(bias).max() < 0.02 * sigma


def test_a_world_moved_by_whole_blocks_gives_the_same_numbers():
    step = np.eye(4)
    step[:3, 3] = np.array([3, -2, 5]) * SIDE * SETTINGS.voxel
    here, there = fused_sphere(), fused_sphere(move=step)
    at = there.blocks.find(here.blocks.places[: here.blocks.count] + np.array([3, -2, 5], np.int32))
    seen = (at >= 0).mean()
    assert seen > 0.99  # float32 rounding may put a point at a border into either block
    near = np.abs(here.distance[: len(at)][at >= 0] - there.distance[at[at >= 0]])
    assert np.quantile(near, 0.99) < 1e-5


@settings(max_examples=5)
@given(vector=st.tuples(*[st.floats(-2, 2)] * 6))
def test_a_moved_world_gives_a_moved_surface(vector):
    move = np.eye(4)
    move[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(np.array(vector[:3])))
    move[:3, 3] = vector[3:]
    vertices = extract_surface(fused_sphere(move=move)).vertices - move[:3, 3]
    radius = np.linalg.norm(vertices, axis=1)
    assert abs(radius.mean() - 0.25) < 0.001 and np.abs(radius - 0.25).max() < 0.5 * SETTINGS.voxel


def test_a_hand_that_passed_is_carved_away_and_its_memory_given_back():
    volume, pose = TsdfVolume(SETTINGS), looking(0.0, 1.5)
    wall = plane_depth(np.array([0.0, 0.0, -1.0]), -0.3, pose)
    hand = np.minimum(wall, sphere_depth((0, 0, -0.5), 0.1, pose))
    for depth in (hand, hand):
        volume.integrate(prepared(depth), pose)
    assert (extract_surface(volume).vertices[:, 2] < -0.2).any()
    for _ in range(6):
        volume.integrate(prepared(wall), pose)
    before, vertices = volume.blocks.count, extract_surface(volume).vertices
    assert not (vertices[:, 2] < -0.2).any() and len(vertices) > 100
    assert volume.clean() > 0 and volume.blocks.count < before
    np.testing.assert_allclose(
        np.sort(extract_surface(volume).vertices, axis=0), np.sort(vertices, axis=0), atol=1e-12
    )


def test_reset_volume_equals_a_new_one():
    poses = [looking(0.2 * k) for k in range(4)]
    views = [prepared(sphere_depth((0, 0, 0), 0.3, pose)) for pose in poses]
    again, new = TsdfVolume(SETTINGS), TsdfVolume(SETTINGS)
    for view, pose in zip(views[:2], poses[:2], strict=True):
        again.integrate(view, pose)
    again.clear()
    assert not len(extract_surface(again).faces) and not again.blocks.count
    for view, pose in zip(views[2:], poses[2:], strict=True):
        again.integrate(view, pose)
        new.integrate(view, pose)
    count = new.blocks.count
    assert again.blocks.count == count and (again.blocks.find(new.blocks.places[:count]) >= 0).all()
    np.testing.assert_array_equal(again.distance[:count], new.distance[:count])
    np.testing.assert_array_equal(again.weight[:count], new.weight[:count])


def test_memory_follows_the_surface_and_keeps_to_its_limit():
    fine = fused_sphere(settings=replace(SETTINGS, voxel=0.01)).blocks.count
    finer = fused_sphere(settings=replace(SETTINGS, voxel=0.005)).blocks.count
    assert 3.0 < finer / fine < 5.5  # four times the blocks for a quarter of the area, not eight times
    small = TsdfVolume(replace(SETTINGS, voxel=0.004, memory=16))
    pose = looking(0.0, 1.5)
    view = prepared(plane_depth(np.array([0.0, 0.0, -1.0]), 0.0, pose))
    results = [small.integrate(view, pose) for _ in range(4)]
    assert not results[-1].has_memory and small.megabytes <= 16
    assert len(extract_surface(small).faces) > 100  # existing data is kept


def test_thin_parts_stay_whole_from_both_sides():
    volume = TsdfVolume(VolumeSettings(voxel=0.005, noise=EVEN, reach=5.0))
    normal = np.array([0.0, 0.0, 1.0])
    for angle in (0.0, np.pi, 0.4, np.pi + 0.4, -0.4, np.pi - 0.4):
        pose = looking(angle)
        # A board 2 cm thick, seen from the front and from behind.
        near = -0.01 if np.cos(angle) > 0 else 0.01
        volume.integrate(prepared(plane_depth(normal, near, pose)), pose)
    z = extract_surface(volume).vertices[:, 2]
    assert np.abs(np.abs(z) - 0.01).max() < 0.0005
    assert 0.4 < (z > 0).mean() < 0.6


def test_colours_are_those_of_the_image():
    volume, pose = TsdfVolume(SETTINGS), looking(0.0)
    colour = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    colour[:, : CAMERA.width // 2], colour[:, CAMERA.width // 2 :] = (200, 10, 30), (20, 220, 60)
    view = prepared(plane_depth(np.array([0.0, 0.0, -1.0]), 0.0, pose), colour=colour)
    volume.integrate(view, pose)
    mesh = extract_surface(volume)
    left, right = mesh.vertices[:, 0] < -0.03, mesh.vertices[:, 0] > 0.03
    inside = np.abs(mesh.vertices).max(1) < 0.3
    assert np.abs(mesh.colours[left & inside].astype(int) - (200, 10, 30)).max() <= 1
    assert np.abs(mesh.colours[right & inside].astype(int) - (20, 220, 60)).max() <= 1


def test_images_without_colour_do_not_darken_and_gaps_take_nearest_colour():
    volume, pose = TsdfVolume(SETTINGS), looking(0.0)
    wall = plane_depth(np.array([0.0, 0.0, -1.0]), 0.0, pose)
    for _ in range(5):
        volume.integrate(prepared(wall), pose)
    colour = np.full((CAMERA.height, CAMERA.width, 3), (180, 0, 90), np.uint8)
    half = np.where(np.arange(CAMERA.width) < CAMERA.width // 2, wall, np.inf)
    volume.integrate(prepared(half, colour=colour), pose)
    volume.integrate(prepared(wall), pose)
    mesh = extract_surface(volume)
    # The right half was seen without colours only. Black pixels of the image stay black.
    assert (mesh.vertices[:, 0] < -0.1).any() and (mesh.vertices[:, 0] > 0.1).any()
    assert np.abs(mesh.colours.astype(int) - (180, 0, 90)).max() <= 1


@settings(max_examples=20)
@given(places=st.sets(st.tuples(*[st.integers(-40, 40)] * 3), min_size=1, max_size=60))
def test_every_block_is_found_again_also_after_others_are_gone(places):
    table, wanted = BlockTable(), np.array(sorted(places), np.int32)
    table.places[: len(wanted)], table.count = wanted, len(wanted)
    table.keep_blocks(np.arange(len(wanted)))
    assert (table.find(wanted) == np.arange(len(wanted))).all()
    assert (table.find(wanted + 100) == -1).all()
    for b, place in enumerate(wanted):
        for k in range(8):
            beside = tuple(int(c) for c in np.add(place, (k & 1, k >> 1 & 1, k >> 2)))
            number = sorted(places).index(beside) if beside in places else -1
            assert table.neighbour_blocks[b, k] == number
    table.keep_blocks(np.arange(0, len(wanted), 2))
    assert (table.find(wanted[::2]) == np.arange(len(wanted[::2]))).all()
    assert (table.find(wanted[1::2]) == -1).all()
