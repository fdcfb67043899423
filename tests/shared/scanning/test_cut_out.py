"""Tests of cutting out objects on the floor: the floor is found, and contact areas and small holes are
closed.
"""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning import CutOutSettings, cut_out, find_focus, find_ground
from enliven.scanning.holes import find_open_sides, find_rims


def grid(x0, x1, z0, z1, y, step=0.02):
    """Returns a horizontal grid that faces up."""
    x, z = np.meshgrid(np.arange(x0, x1, step), np.arange(z0, z1, step), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x.ravel(), np.full(x.size, y), z.ravel()], 1), faces


def joined(*parts):
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = np.concatenate([f + n for (_, f), n in zip(parts, counts[:-1], strict=True)])
    return np.concatenate([vertices for vertices, _ in parts]), faces


def standing(at, size=(0.3, 0.6, 0.3), fine=0.06):
    """Returns a box without a bottom that stands on y = 0, made of small triangles."""
    box = trimesh.creation.box(size).subdivide_to_size(fine)
    vertices, faces = np.array(box.vertices), np.array(box.faces)
    vertices += [at[0], size[1] / 2 - 0.001, at[1]]
    open_ = faces[~(vertices[faces][:, :, 1] < 0.0).all(1)]
    return vertices, open_


def scene(noise=0.0, seed=0):
    """Returns a floor, a table top, the object at the origin, and another object."""
    vertices, faces = joined(
        grid(-1.0, 1.0, -1.0, 1.0, 0.0),
        grid(1.2, 1.9, -0.6, 0.6, 0.7),
        standing((0.0, 0.0)),
        standing((0.7, 0.6)),
    )
    vertices = vertices + np.random.default_rng(seed).normal(0, noise, vertices.shape) if noise else vertices
    colours = np.tile(np.array([[200, 120, 40]], np.uint8), (len(vertices), 1))
    return Mesh(vertices, faces, colours=colours)


@pytest.mark.slow
@settings(max_examples=8)
@given(lean=st.tuples(*[st.floats(-0.35, 0.35)] * 2), turn=st.floats(-3, 3), high=st.floats(-1, 1))
def test_object_is_upright_on_the_floor_for_any_scan_frame(lean, turn, high):
    move = rotation.multiply(
        rotation.from_rotation_vector([lean[0], 0.0, lean[1]]),
        rotation.from_rotation_vector([0.0, turn, 0.0]),
    )
    whole = scene()
    vertices = rotation.rotate(move, whole.vertices) + np.array([0.3, high, -0.2])
    mesh = Mesh(vertices, whole.faces, colours=whole.colours)
    ground = find_ground(mesh)
    np.testing.assert_allclose(ground.normal, rotation.rotate(move, np.array([0.0, 1.0, 0.0])), atol=2e-3)
    thing = cut_out(
        mesh, ground, rotation.rotate(move, np.array([0.0, 0.3, 0.0])) + np.array([0.3, high, -0.2])
    )
    height = thing.bounds[1, 1]
    assert thing.bounds[0, 1] == 0.0 and abs(height - 0.6) < 0.004
    assert abs(thing.vertices[:, [0, 2]].mean(0)).max() < 0.02
    assert (thing.colours == (200, 120, 40)).all()


def test_contact_area_of_object_is_closed():
    mesh = scene(noise=0.001)
    thing = cut_out(mesh, find_ground(mesh), np.array([0.0, 0.3, 0.0]))
    assert not find_rims(thing)
    volume = trimesh.Trimesh(thing.vertices, thing.faces, process=False).volume
    assert volume == pytest.approx(0.3 * 0.6 * 0.3, rel=0.03)


def test_a_small_hole_is_closed_and_a_large_one_stays_open():
    vertices, faces = scene().vertices, scene().faces
    middles = vertices[faces].mean(1)
    front = (np.abs(middles[:, 0]) < 0.16) & (middles[:, 2] > 0.149) & (middles[:, 2] < 0.16)
    high = np.flatnonzero(front & (middles[:, 1] > 0.3))
    small = faces[np.arange(len(faces)) != high[0]]
    whole = Mesh(vertices, small)
    assert not find_rims(cut_out(whole, find_ground(whole), np.array([0.0, 0.3, 0.0])))
    torn = Mesh(vertices, faces[~(front & (middles[:, 1] > 0.2))])
    left = find_rims(cut_out(torn, find_ground(torn), np.array([0.0, 0.3, 0.0])))
    assert len(left) == 1 and len(left[0]) > 8


def test_the_lower_plane_is_the_floor_where_a_table_is_as_large():
    vertices, faces = joined(grid(-1, 1, -1, 1, 0.0), grid(-1, 1, 1.5, 3.5, 0.75))
    assert abs(find_ground(Mesh(vertices, faces)).offset) < 1e-6


def test_target_is_the_intersection_of_optical_axes():
    poses, target = [], np.array([0.4, 0.5, -0.3])
    for angle in (0.0, 1.0, 2.5):
        pose = np.eye(4)
        pose[:3, 3] = target + np.array([np.sin(angle), 0.4, np.cos(angle)])
        pose[:3, 2] = rotation.unit(target - pose[:3, 3])
        poses.append(pose)
    np.testing.assert_allclose(find_focus(poses), target, atol=1e-4)
    np.testing.assert_allclose(find_focus(poses[:1]), poses[0][:3, 3] + poses[0][:3, 2], atol=1e-6)


def test_empty_cut_out_is_refused():
    vertices, faces = grid(-1, 1, -1, 1, 0.0)
    floor = Mesh(vertices, faces)
    with pytest.raises(InputError, match="no object on the floor"):
        cut_out(floor, find_ground(floor), np.zeros(3), CutOutSettings())
    wall = Mesh(vertices[:, [0, 2, 1]], faces)
    with pytest.raises(InputError, match="no floor and no table"):
        find_ground(wall)
    with pytest.raises(InputError, match="no floor"):
        find_ground(Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32)))


@settings(max_examples=30)
@given(st.integers(3, 12), st.lists(st.tuples(*[st.integers(0, 11)] * 3), min_size=1, max_size=40))
def test_open_side_has_no_opposite_face(count, corners):
    """The kernel finds what a set of all sides tells, for any faces."""
    faces = np.array(corners, np.int32) % count
    there = {(int(face[k]), int(face[(k + 1) % 3])) for face in faces for k in range(3)}
    slow = [[(face[(k + 1) % 3], face[k]) not in there for k in range(3)] for face in faces.tolist()]
    np.testing.assert_array_equal(find_open_sides(faces, count), slow)
