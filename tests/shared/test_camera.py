"""Tests of the camera: projection and its inverse, mountings, and invalid calibrations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, pixel_rays, project, unproject_depth, world_from_level_camera
from enliven.errors import InputError
from enliven.frames import DepthFrame

LENS = st.tuples(
    st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), st.floats(-0.002, 0.002), st.floats(-0.002, 0.002)
)


@given(LENS, st.integers(300, 60000))
@settings(max_examples=30, deadline=None)
def test_projecting_undoes_unprojecting(lens, millimetres):
    camera = Intrinsics(80, 60, 70.0, 71.0, 39.0, 31.0, (*lens, 0.0))
    points = unproject_depth(np.full((60, 80), millimetres, np.uint16), pixel_rays(camera))
    u, v = np.meshgrid(np.arange(80), np.arange(60))
    np.testing.assert_allclose(project(points, camera), np.stack([u, v], -1), atol=1e-6)


@pytest.mark.parametrize("fx", [0.0, -5.0, float("nan"), float("inf")])
def test_impossible_focal_length_is_refused(fx):
    with pytest.raises(InputError, match="focal length"):
        Intrinsics(640, 480, fx, 500.0, 320.0, 240.0)


def test_impossible_size_is_refused():
    with pytest.raises(InputError, match="image size"):
        Intrinsics(0, 480, 500.0, 500.0, 320.0, 240.0)


def test_halving_keeps_the_corners_of_the_image():
    camera = Intrinsics(640, 480, 500.0, 510.0, 321.0, 242.0)
    half = camera.scale(0.5)
    corner = np.array([[(-0.5 - camera.cx) / camera.fx, (-0.5 - camera.cy) / camera.fy, 1.0]])
    np.testing.assert_allclose(project(corner, half), [[-0.5, -0.5]])


@given(st.floats(0.1, 3), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
@settings(max_examples=30, deadline=None)
def test_camera_mounting_is_rigid_with_stated_direction(height, tilt, roll):
    mount = world_from_level_camera(height, tilt, roll)
    rotation = mount[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ [0, 0, 1], [0, -np.sin(tilt), -np.cos(tilt)], atol=1e-12)
    assert mount[1, 3] == height


def test_depth_must_belong_to_the_intrinsics():
    camera = Intrinsics(4, 3, 3.0, 3.0, 1.5, 1.0)
    DepthFrame(np.zeros((3, 4), np.uint16), camera, 0, "test")
    with pytest.raises(InputError, match="expected uint16"):
        DepthFrame(np.zeros((4, 3), np.uint16), camera, 0, "test")
    with pytest.raises(InputError, match="float32"):
        DepthFrame(np.zeros((3, 4), np.float32), camera, 0, "test")
