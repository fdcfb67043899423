"""Tests of vacated space, and of distances between points and a surface, against known cases and slow
references.
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.scanning import ScanSettings, VolumeSettings
from enliven.scanning.depth_view import restrict_view
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven.scanning.objects.nearness import surface_distances
from enliven.scanning.objects.object_model import ObjectModel
from enliven.scanning.objects.vacated import compute_vacated_fraction

sys.path.insert(0, str(Path(__file__).parent))
from scenes import fused_sphere, looking, plane_depth, prepared, sphere_depth

RADIUS = 0.25
CLEAR = 0.03
angles = st.floats(-3.0, 3.0)


@pytest.fixture(scope="module")
def sphere():
    return fused_sphere(RADIUS)


def on_sphere(radius=RADIUS, count=900, seed=0):
    """Returns (N, 3) points evenly on a sphere about the origin."""
    return radius * rotation.unit(np.random.default_rng(seed).normal(size=(count, 3)))


def slow_share(points, view, pose, clearance):
    """Returns the fraction of vacated points by its definition, one point at a time, with the nearest of nine
    pixels.
    """
    depth = np.where(view.worth > 0, view.points[..., 2], np.inf)
    rows, columns = depth.shape
    lens, gone, shown = view.intrinsics, 0, 0
    for point in points:
        x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
        if z <= 0.2:
            continue
        u = int(np.floor((lens.fx * x / z + lens.cx + 0.5) / 2))
        v = int(np.floor((lens.fy * y / z + lens.cy + 0.5) / 2))
        if not (0 <= u < columns and 0 <= v < rows):
            continue
        seen = depth[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2].min()
        if np.isfinite(seen) and z < seen + clearance:
            shown += 1
            gone += z < seen - clearance
    return gone / shown if shown >= 50 else 0.0


@settings(max_examples=12)
@given(angle=angles, aside=st.floats(0.0, 0.4))
def test_vacated_space_matches_slow_reference(angle, aside):
    pose = looking(angle)
    image = sphere_depth((aside, 0.0, 0.0), RADIUS, pose)
    wall = plane_depth(-pose[:3, 2], -0.7, pose)
    view, points = prepared(np.minimum(image, wall)), on_sphere()
    # A point on a pixel's border may be rounded into either.
    assert compute_vacated_fraction(points, view, pose, CLEAR) == pytest.approx(
        slow_share(points, view, pose, CLEAR), abs=0.01
    )


@settings(max_examples=12)
@given(angle=angles)
def test_only_visible_removed_objects_count_as_vacated(angle):
    pose, points = looking(angle), on_sphere()
    there = prepared(sphere_depth((0, 0, 0), RADIUS, pose))
    behind = prepared(plane_depth(-pose[:3, 2], -0.7, pose))
    before = prepared(plane_depth(-pose[:3, 2], 0.5, pose))
    assert compute_vacated_fraction(points, there, pose, CLEAR) < 0.02
    assert compute_vacated_fraction(points, behind, pose, CLEAR) == 1.0
    assert compute_vacated_fraction(points, before, pose, CLEAR) == 0.0
    assert compute_vacated_fraction(points[:10], behind, pose, CLEAR) == 0.0, "too few to tell"
    nothing = prepared(np.full((72, 96), np.inf))
    assert compute_vacated_fraction(points, nothing, pose, CLEAR) == 0.0, "no depth is known"


@settings(max_examples=12)
@given(angle=angles, out=st.floats(-0.03, 0.03))
def test_distance_of_offset_point_is_its_offset(sphere, angle, out):
    pose = looking(angle)
    distances = surface_distances(sphere, prepared(sphere_depth((0, 0, 0), RADIUS + out, pose)), pose)
    view = prepared(sphere_depth((0, 0, 0), RADIUS + out, pose))
    is_known = np.isfinite(distances)
    truth = np.linalg.norm(view.points @ pose[:3, :3].T + pose[:3, 3], axis=-1) - RADIUS
    # Half a voxel of 2 cm: what is fused is planes along a pixel's ray, of a curved surface.
    assert is_known.sum() > 100 and np.abs(distances[is_known] - truth[is_known]).mean() < 0.01
    assert np.isnan(distances[view.worth == 0]).all(), "a pixel without depth has no distance"


def test_distance_next_to_surface_is_unknown(sphere):
    pose = looking(0.0)
    view = prepared(plane_depth(-pose[:3, 2], -0.9, pose))
    assert np.isnan(surface_distances(sphere, view, pose)).all()


def test_an_object_that_fills_the_memory_ends_its_scan():
    volume = VolumeSettings(voxel=0.001, memory=16)
    scanner, pose = MovedScanner(ScanSettings(volume=volume)), looking(0.0)
    scanner.model = ObjectModel(scanner.settings)
    view = prepared(sphere_depth((0, 0, 0), RADIUS, pose))
    scanner.model.fuse(restrict_view(view, view.worth < 0), pose)
    assert not scanner.is_full
    for n in range(40):
        pose = looking(0.15 * n)
        scanner.model.fuse(prepared(sphere_depth((0, 0, 0), RADIUS, pose)), pose)
    assert scanner.is_full
