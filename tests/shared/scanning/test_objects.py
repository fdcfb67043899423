"""Tests of finding moved objects in any pose or rejecting them, of the floor, and of choosing among
objects.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning import CutOutSettings, GroundPlane, TsdfVolume, cut_out, extract_surface, find_parts
from enliven.scanning.depth_view import restrict_view
from enliven.scanning.objects.floor import floor_plane
from enliven.scanning.objects.free_space import seen_depth, seen_through
from enliven.scanning.objects.registration import ScannedSurface, register_part, spread_rotations
from enliven.scanning.objects.surface_points import make_nearest_grid, sample_surface
from enliven.scanning.rigid import invert_pose, pose_difference

sys.path.insert(0, str(Path(__file__).parent))
from scenes import SETTINGS, looking, plane_depth, prepared, sphere_depth

GROUND = GroundPlane(np.array([0.0, 1.0, 0.0]), 0.0, 1.0)


def box(low, high):
    """Returns a closed box of 12 triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [[a, b, c] for a, b, c, d in quads] + [[a, c, d] for a, b, c, d in quads]
    low, high = np.array(low, float), np.array(high, float)
    return Mesh(low + corners * (high - low), np.array(faces, np.int32))


def together(*meshes):
    """Returns several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces.astype(np.int32))


CRANE = together(
    box((0.0, 0.0, 0.0), (0.12, 0.6, 0.1)),
    box((0.12, 0.5, 0.0), (0.5, 0.6, 0.06)),
    box((0.0, 0.0, 0.1), (0.2, 0.08, 0.4)),
)
"""A post with an arm to one side and a foot to another. No rotation maps it onto itself."""
WIDE = Intrinsics(192, 144, 180.0, 180.0, 95.5, 71.5)
units = st.tuples(*[st.floats(-1, 1)] * 3)


def pose_of(turn, move):
    """Returns (4, 4) the pose of a rotation vector and a translation."""
    pose = np.eye(4)
    pose[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(np.array(turn)))
    pose[:3, 3] = move
    return pose


def seen_from(mesh, side, pose):
    """Returns the points of a mesh that face a direction (3,), transformed by a pose."""
    points = sample_surface(mesh, 6000)
    faces = points.normals @ rotation.unit(np.array(side, float)) > -0.2
    return replace(points, points=points.points[faces], normals=points.normals[faces]).transform(pose)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(turn=units, move=units)
def test_a_part_is_found_in_any_pose(turn, move):
    pose = pose_of(3.0 * np.array(turn), move)
    part = ScannedSurface(seen_from(CRANE, (0.3, 0.5, 1.0), pose), [])
    match = register_part(ScannedSurface(sample_surface(CRANE, 6000), []), part)
    assert match is not None and match.agreeing > 0.8
    metres, radians = pose_difference(match.model_from_part, invert_pose(pose))
    # Points lie five millimetres apart.
    assert metres < 0.005 and radians < 0.01


def test_ambiguous_pose_is_rejected():
    brick = ScannedSurface(sample_surface(box((-0.2, 0, -0.1), (0.2, 0.1, 0.1)), 6000), [])
    assert (
        register_part(brick, ScannedSurface(brick.surface.transform(pose_of((0.4, 1.0, 0.2), (1, 0, 0))), []))
        is None
    )


def test_different_object_is_rejected():
    ball = sample_surface(CRANE, 3000)
    ball = replace(ball, points=0.3 * ball.normals + 0.01 * ball.points)
    assert register_part(ScannedSurface(sample_surface(CRANE, 6000), []), ScannedSurface(ball, [])) is None


@settings(max_examples=30)
@given(turn=units)
def test_tried_rotations_cover_all_rotations(turn):
    wanted = rotation.to_matrix(rotation.from_rotation_vector(3.1 * np.array(turn)))
    cosine = (np.einsum("nij,ij->n", spread_rotations(900), wanted).max() - 1) / 2
    assert np.arccos(np.clip(cosine, -1, 1)) < 0.45
    np.testing.assert_allclose(np.linalg.det(spread_rotations(20)), 1.0)


@settings(max_examples=20)
@given(at=units)
def test_the_grid_knows_the_nearest_point(at):
    points, cell = sample_surface(CRANE, 2000), 0.02
    grid = make_nearest_grid(points, cell, 0.2)
    place = np.array(at) * 0.3 + [0.2, 0.3, 0.2]
    x, y, z = np.clip(np.floor((place - grid.origin) / cell).astype(int), 0, np.array(grid.nearest.shape) - 1)
    distance = np.linalg.norm(points.points[grid.nearest[x, y, z]] - place)
    # The slow twin looks at all; a cell stands for the places in it, on both ends.
    assert distance <= np.linalg.norm(points.points - place, axis=1).min() + 2 * np.sqrt(3) * cell


@settings(max_examples=10)
@given(points=st.lists(units, min_size=1, max_size=20))
def test_point_is_seen_through_if_two_images_see_behind_it(points):
    poses = [looking(0.0), looking(0.3), looking(0.6)]
    views = [seen_depth(prepared(sphere_depth((0, 0, 0), 0.3, pose)), pose) for pose in poses]
    is_through = seen_through(np.array(points), views, 0.05)
    for point, through in zip(np.array(points), is_through, strict=True):
        clear = [_clear(view, invert_pose(view.frame_from_camera) @ [*point, 1.0]) for view in views]
        assert through == (sum(clear) >= 2)


def _clear(view, local):
    """Returns True if a small image measured depth beyond a point (camera frame)."""
    lens = view.intrinsics
    if local[2] <= 0.2:
        return False
    u, v = lens.fx * local[0] / local[2] + lens.cx, lens.fy * local[1] / local[2] + lens.cy
    column, row = int(np.floor((u + 0.5) / view.scale)), int(np.floor((v + 0.5) / view.scale))
    if not (0 <= row < view.depth.shape[0] and 0 <= column < view.depth.shape[1]):
        return False
    return view.depth[row, column] > local[2] + 0.05


@settings(max_examples=15)
@given(raised=st.floats(-0.02, 0.02), tilts=st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)))
def test_floor_plane_is_estimated(raised, tilts):
    pose = looking(0.4, 1.2, tilt=0.9)
    normal = rotation.unit(np.array([-tilts[0], 1.0, -tilts[1]]))
    view = prepared(plane_depth(normal, raised * normal[1], pose, WIDE), WIDE)
    nothing = np.zeros(view.worth.shape, bool)
    plane = floor_plane(view, pose, GROUND, np.zeros(3), nothing)
    assert plane is not None and plane[0] == pytest.approx(raised, abs=1e-3)
    assert np.hypot(*plane[1:]) == pytest.approx(np.hypot(*tilts), abs=2e-3)
    assert floor_plane(view, pose, GROUND, np.zeros(3), ~nothing) is None


def test_pixels_that_are_left_out_carve_and_make_no_surface():
    pose, volume = looking(0.0), TsdfVolume(SETTINGS)
    view = prepared(sphere_depth((0, 0, 0), 0.25, pose))
    volume.integrate(view, pose)
    behind = prepared(plane_depth(np.array([0.0, 0.0, 1.0]), 0.9, pose))
    before = len(extract_surface(volume).faces)
    empty = restrict_view(behind, np.zeros(behind.worth.shape, bool))
    assert empty.known == 0
    for _ in range(3):
        volume.integrate(empty, pose)
    assert before > 100 and len(extract_surface(volume).faces) == 0
    assert volume.integrate(empty, pose).new == 0


def test_object_at_the_view_target_comes_first():
    floor = box((-2, -0.05, -2), (2, 0, 2))
    small, large = box((-0.1, 0.0, -0.1), (0.1, 0.3, 0.1)), box((0.6, 0.0, -0.3), (1.1, 0.8, 0.3))
    scene, focus = together(floor, small, large), np.zeros(3)
    parts = find_parts(scene, GROUND, focus)
    assert [round(float(part.bounds[1, 1]), 2) for part in parts] == [0.8, 0.3]
    near = CutOutSettings(about=0.45)
    heights = [cut_out(scene, GROUND, focus, replace(near, number=n)).bounds[1, 1] for n in (1, 2)]
    np.testing.assert_allclose(heights, [0.3, 0.8])
    with pytest.raises(InputError, match="object number 3 does not exist; the camera looked at 2 objects"):
        cut_out(scene, GROUND, focus, replace(near, number=3))
