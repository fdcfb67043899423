"""Tests of cutting a selection out of a scan: by a box, and as a new object in space that was empty
before.
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
from scenes import CAMERA, looking
from test_cut_out import grid, joined, scene, standing

from enliven import rotation
from enliven.errors import InputError
from enliven.meshes import Mesh, shells
from enliven.scanning import (
    CutBox,
    CutOutSettings,
    GroundPlane,
    KnownImage,
    cut_by_box,
    cut_new_object,
    draw_mesh,
    find_ground,
    upright_frame,
)
from enliven.scanning.cutting.moved import compare_with_images
from enliven.scanning.holes import find_rims

FLOOR = GroundPlane(np.array([0.0, 1.0, 0.0]), 0.0, 4.0)
LEVEL = np.eye(4)
FINE = 0.03
"""Side length of triangles in metres, as in a scan with 2 cm voxels."""
ROOM = joined(grid(-1.0, 1.0, -1.0, 1.0, 0.0), standing((0.7, 0.6)), standing((-0.8, -0.8), (0.3, 0.9, 0.3)))


def box(low, high, frame=LEVEL):
    return CutBox(np.array(low, float), np.array(high, float), frame)


def parts_of(mesh):
    return len(np.unique(np.asarray(shells(mesh.faces, len(mesh.vertices)))[mesh.faces[:, 0]]))


@example(low=(-0.1, -0.1), high=(0.1, 0.1), tall=(0.0, 0.5), lean=0.0, turn=0.0)
@example(low=(-0.1, -0.1), high=(0.1, 0.1), tall=(0.0, 0.75), lean=0.1, turn=1.0)
@settings(max_examples=20)
@given(
    low=st.tuples(*[st.floats(-0.5, -0.05)] * 2),
    high=st.tuples(*[st.floats(0.05, 0.5)] * 2),
    tall=st.tuples(st.floats(-0.01, 0.2), st.floats(0.3, 0.9)),
    lean=st.floats(-0.3, 0.3),
    turn=st.floats(-3, 3),
)
def test_box_keeps_only_its_content(low, high, tall, lean, turn):
    """The kept surface is that of the clipped box, whose area is known, in any frame of the scan."""
    # A side of the thing that lies in a side of the box may count as in it, or not.
    assume(all(abs(abs(side) - 0.15) > 1e-6 for side in (*low, *high)))
    standing_mesh = Mesh(*standing((0.0, 0.0)))
    move = rotation.to_matrix(rotation.from_rotation_vector([lean, 0.0, 0.0]))
    move = move @ rotation.to_matrix(rotation.from_rotation_vector([0.0, turn, 0.0]))
    place = np.array([0.4, 0.3, -0.2])
    world = Mesh(standing_mesh.vertices @ move.T + place, standing_mesh.faces)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = move.T, -move.T @ place
    limits = box((low[0], tall[0], low[1]), (high[0], tall[1], high[1]), frame)
    # The thing is 0.3 x 0.6 x 0.3 m and stands 1 mm in the floor.
    x = max(low[0], -0.15), min(high[0], 0.15)
    z = max(low[1], -0.15), min(high[1], 0.15)
    bottom = tall[0] if tall[0] >= 0.012 else 0.012
    top = min(tall[1], 0.599)
    sides = (low[0] < -0.15) + (high[0] > 0.15), (low[1] < -0.15) + (high[1] > 0.15)
    area = (top - bottom) * (sides[0] * (z[1] - z[0]) + sides[1] * (x[1] - x[0]))
    area += (x[1] - x[0]) * (z[1] - z[0]) * (tall[1] > 0.599)
    if area == 0.0:  # The box lies inside the thing.
        with pytest.raises(InputError, match="no surface was scanned in the box"):
            cut_by_box(world, limits)
        return
    cut = cut_by_box(world, limits)
    assert cut.area == pytest.approx(area, abs=1e-6)
    size = cut.mesh.bounds[1] - cut.mesh.bounds[0]
    assert cut.mesh.bounds[0, 1] == pytest.approx(0.0, abs=1e-9)
    given_back = bottom if tall[0] < 0.012 + 1e-9 else 0.0
    # If only the top lies in the box, the mesh is flat.
    height = top - bottom + given_back if any(sides) else 0.0
    assert size[1] == pytest.approx(height, abs=1e-6)
    np.testing.assert_allclose(cut.mesh.bounds.sum(0)[[0, 2]], 0.0, atol=1e-9)


def test_box_keeps_several_objects_without_floor_and_closes_below():
    mesh = scene()
    cut = cut_by_box(mesh, box((-0.4, 0.0, -0.4), (1.0, 0.9, 0.9)))
    assert cut.parts == 2 and parts_of(cut.mesh) == 2
    assert not find_rims(cut.mesh), "both have soles"
    assert (cut.mesh.colours == (200, 120, 40)).all()
    # A box that begins 2 cm below the floor includes the floor.
    floor = cut_by_box(mesh, box((-0.4, -0.03, -0.4), (1.0, 0.9, 0.9)))
    assert floor.area > cut.area + 1.0 and floor.mesh.bounds[0, 1] == pytest.approx(0.0, abs=2e-3)


def test_box_cut_is_closed_only_below():
    cut = cut_by_box(scene(), box((-0.4, 0.3, -0.4), (0.4, 0.9, 0.4)))
    assert not find_rims(cut.mesh) and cut.mesh.bounds[1, 1] == pytest.approx(0.299, abs=1e-6)
    half = cut_by_box(scene(), box((-0.4, 0.0, -0.4), (0.0, 0.9, 0.4)))
    (rim,) = find_rims(half.mesh)
    assert (half.mesh.vertices[rim][:, 0] > 0.074).mean() > 0.55, "it stays open at its upright side"


def test_empty_box_error_names_surface_position():
    with pytest.raises(InputError, match=r"no surface .* extends from -1\.00,-?0\.00,-1\.00 to 1\.88"):
        cut_by_box(scene(), box((4.0, 0.0, 4.0), (5.0, 1.0, 5.0)))
    with pytest.raises(InputError, match="only the floor"):
        cut_by_box(scene(), box((-1.0, 0.0, -1.0), (1.0, 0.01, 1.0)))
    for corner in ((1.0, 2.0, 3.0), (np.nan, 2.0, 3.0)):
        with pytest.raises(InputError, match="two corners"):
            box((1.0, 0.0, 0.0), corner)


@settings(max_examples=20)
@given(
    lean=st.tuples(*[st.floats(-0.5, 0.5)] * 2),
    offset=st.floats(-2, 2),
    at=st.tuples(*[st.floats(-2, 2)] * 3),
)
def test_upright_frame_has_floor_at_zero_under_target(lean, offset, at):
    normal = rotation.unit(np.array([lean[0], 1.0, lean[1]]))
    frame = upright_frame(GroundPlane(normal, offset, 1.0), np.array(at))
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    origin = np.linalg.inv(frame)[:3, 3]
    assert origin @ normal == pytest.approx(offset, abs=1e-9)
    np.testing.assert_allclose(np.cross(origin - at, normal), 0.0, atol=1e-9)
    np.testing.assert_allclose(frame[:3, :3] @ normal, [0.0, 1.0, 0.0], atol=1e-9)


def images_of(vertices, faces, count=10, noise=0.0):
    """Returns depth images of a place from all around, millimetres."""
    images, random = [], np.random.default_rng(0)
    for n in range(count):
        pose = looking(2 * np.pi * n / count, 1.6, tilt=0.5)
        depth = draw_mesh(Mesh(vertices, faces), CAMERA, pose).depth
        depth = depth + random.normal(0, noise, depth.shape)
        millimetres = np.where(np.isfinite(depth), depth * 1000.0, 0.0).astype(np.float32)
        images.append(KnownImage(millimetres, CAMERA, pose))
    return images


BEFORE = images_of(*ROOM, noise=0.002)


@pytest.mark.slow
@settings(max_examples=15)
@given(
    at=st.tuples(*[st.floats(-0.35, 0.35)] * 2),
    tall=st.floats(0.15, 0.7),
    seed=st.integers(0, 1000),
)
@example(at=(-0.18584285883112323, -0.04553671344240057), tall=0.6858024062925904, seed=652)
def test_new_object_is_found_anywhere(at, tall, seed):
    vertices, faces = joined(ROOM, standing(at, (0.25, tall, 0.2), FINE))
    vertices = vertices + np.random.default_rng(seed).normal(0, 0.001, vertices.shape)
    cut = cut_new_object(Mesh(vertices, faces), BEFORE, FLOOR)
    assert cut.parts == 1 and not find_rims(cut.mesh)
    np.testing.assert_allclose(np.ptp(cut.mesh.vertices, axis=0), [0.25, tall, 0.2], atol=0.012)
    sides = 2 * (0.25 + 0.2) * (tall - 0.012) + 0.25 * 0.2
    assert cut.area == pytest.approx(sides, rel=0.06)


def test_object_on_table_stands_on_table():
    table = joined(ROOM, grid(-0.5, 0.5, -0.4, 0.4, 0.3))
    before = images_of(*table)
    thing, at = standing((0.1, 0.0), (0.2, 0.25, 0.2), FINE), np.array([0.0, 0.3, 0.0])
    vertices, faces = joined(table, (thing[0] + at, thing[1]))
    cut = cut_new_object(Mesh(vertices, faces), before, find_ground(Mesh(vertices, faces)))
    np.testing.assert_allclose(np.ptp(cut.mesh.vertices, axis=0), [0.2, 0.25, 0.2], atol=0.005)
    assert not find_rims(cut.mesh)


def test_moved_object_is_kept_at_its_new_position():
    before = joined(ROOM, standing((-0.3, 0.1), (0.2, 0.4, 0.2), FINE))
    after = Mesh(*joined(ROOM, standing((0.25, 0.0), (0.2, 0.4, 0.2), FINE)))
    cut = cut_new_object(after, images_of(*before), FLOOR)
    assert cut.parts == 1
    np.testing.assert_allclose(np.ptp(cut.mesh.vertices, axis=0), [0.2, 0.4, 0.2], atol=0.01)


def test_missing_new_object_is_reported():
    with pytest.raises(InputError, match="no new object was found"):
        cut_new_object(Mesh(*ROOM), BEFORE, FLOOR)
    with pytest.raises(InputError, match="no new object was found"):
        cut_new_object(Mesh(*joined(ROOM, standing((0.0, 0.0)))), [], FLOOR)


@settings(max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_background_matches_slow_reference(seed):
    """The twin walks each ray's pixel by itself, with the camera's own projection."""
    from enliven.camera import project
    from enliven.scanning import DepthNoiseModel

    random, noise = np.random.default_rng(seed), DepthNoiseModel()
    points = random.uniform([-1.2, -0.2, -1.2], [1.2, 1.2, 1.2], (40, 3))
    slow = []
    for point in points:
        visible = through = 0
        for image in BEFORE:
            local = (np.linalg.inv(image.world_from_camera) @ [*point, 1.0])[:3]
            if local[2] < 0.05:
                continue
            u, v = np.floor(project(local[None], CAMERA)[0] + 0.5).astype(int)
            if not (0 <= u < CAMERA.width and 0 <= v < CAMERA.height) or image.depth[v, u] == 0:
                continue
            deep = image.depth[v, u] / 1000.0
            # 12 mm for a camera that is found off, and three deviations of the depth.
            near = 0.012 + 3 * noise.sigma(deep)
            visible += bool(local[2] <= deep + near)
            through += bool(local[2] < deep - near)
        slow.append(-1 if through < 0.7 * visible else 1 if through >= 2 else 0)
    compared_signs = compare_with_images(points, BEFORE)
    # Rounding may put a point on the other side of a pixel's edge.
    assert (compared_signs != np.array(slow)).sum() <= 1
    assert not compare_with_images(points, []).any()


def test_minimum_size_setting_applies_to_boxes():
    tiny = CutOutSettings(least_area=0.5)
    with pytest.raises(InputError, match="no surface"):
        cut_by_box(scene(), box((-0.4, 0.0, -0.4), (0.4, 0.3, 0.4)), tiny)
