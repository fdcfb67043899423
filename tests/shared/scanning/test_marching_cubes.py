"""Tests of marching cubes over blocks: no cracks for any signs, and the surface is at distance 0."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.scanning import TsdfVolume, VolumeSettings, extract_surface
from enliven.scanning.blocks import SIDE, VOXELS
from enliven.scanning.cube_table import triangle_table

sys.path.insert(0, str(Path(__file__).parent))
from scenes import SETTINGS, fused_sphere


def filled(distance, voxel=1.0):
    """Returns a volume of 2 x 2 x 2 blocks filled with (16, 16, 16) distances, z first, all observed."""
    volume = TsdfVolume(VolumeSettings(voxel=0.01), voxel=voxel)
    volume.blocks.places[:8] = [(k & 1, k >> 1 & 1, k >> 2) for k in range(8)]
    volume.blocks.count = 8
    volume.blocks.keep_blocks(np.arange(8))
    for k, (x, y, z) in enumerate(volume.blocks.places[:8] * SIDE):
        part = distance[z : z + SIDE, y : y + SIDE, x : x + SIDE].reshape(VOXELS)
        volume.distance[k], volume.weight[k], volume.solid[k] = part, 1.0, (part < 0).any()
    return volume


def sides(faces):
    """Returns the count of each directed edge of the faces."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(pairs, axis=0, return_counts=True)


@pytest.mark.slow
@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), share=st.floats(0.05, 0.95))
def test_a_surface_of_any_signs_is_closed(seed, share):
    random = np.random.default_rng(seed)
    distance = np.ones((16, 16, 16), np.float32)
    inner = random.uniform(0.1, 1.0, (12, 12, 12))
    distance[2:14, 2:14, 2:14] = np.where(random.random((12, 12, 12)) < share, -inner, inner)
    mesh = extract_surface(filled(distance))
    pairs, counts = sides(mesh.faces)
    # Each side is met once from either face: no hole, no side of three faces, no face turned round.
    assert (counts == 1).all()
    there = set(map(tuple, pairs))
    assert all((b, a) in there for a, b in there)
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)


def test_each_crossing_is_where_the_distance_is_nothing():
    z, y, x = np.mgrid[0:16, 0:16, 0:16].astype(float)
    distance = np.sqrt((x - 7.3) ** 2 + (y - 7.9) ** 2 + (z - 8.2) ** 2) - 5.1
    mesh = extract_surface(filled(distance.astype(np.float32)))
    radius = np.linalg.norm(mesh.vertices - [7.3, 7.9, 8.2], axis=1)
    assert np.abs(radius - 5.1).max() < 0.05  # interpolation is linear, but the field is only nearly so
    outward = (mesh.face_normals() * (mesh.vertices[mesh.faces].mean(1) - [7.3, 7.9, 8.2])).sum(1)
    assert (outward > 0).all()
    assert len(mesh.vertices) - 1.5 * len(mesh.faces) + len(mesh.faces) == 2  # Euler: one ball


def test_cases_that_mirror_one_another_have_no_surface_or_as_much():
    table = triangle_table()
    assert (table[0] == -1).all() and (table[255] == -1).all()
    assert all((table[case] >= 0).any() for case in range(1, 255))
    single = [(table[1 << k] >= 0).sum() for k in range(8)]
    assert single == [3] * 8


def test_fused_ball_is_closed_and_unseen_parts_stay_open():
    mesh = extract_surface(fused_sphere())
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.25).mean() < 0.02 * SETTINGS.voxel * 5
    normals = (mesh.face_normals() * mesh.vertices[mesh.faces].mean(1)).sum(1)
    assert (normals > 0).mean() > 0.999
    half = fused_sphere(count=1)
    half.weight[half.blocks.places[:, 2].argmax()] = 0.0
    _, counts = sides(extract_surface(half).faces)
    assert (counts == 1).all()
