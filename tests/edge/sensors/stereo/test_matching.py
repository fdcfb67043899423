"""Tests of depth from two rendered cameras against the truth. Rendering and matching share no code."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("cv2", reason='OpenCV is not installed: pip install "./edge[libcamera]"')
from stereo_rig import calibration_of, create_lenses, rectified_left
from stereo_scene import Plane, Renderer, person, room

from enliven.errors import InputError
from enliven_edge.sensors.stereo.matching import StereoMatcher, depth_table
from enliven_edge.sensors.stereo.rectification import Rectification

WIDTH, HEIGHT = 256, 160
CAMERAS = create_lenses(WIDTH, HEIGHT)
RECTIFIED = Rectification(calibration_of(*CAMERAS))
TRUE = rectified_left(RECTIFIED)
FOCAL_BASELINE = RECTIFIED.intrinsics.fx * RECTIFIED.baseline


def pair(things, seed=0, gains=(1.0, 1.1)):
    """Returns (left, right) images with noise, vignetting and two exposures, and the true depth in metres."""
    photographer = Renderer(things, seed)
    images = [
        photographer.render_image(lens, gain=gain, vignette=0.3, noise=2.0)
        for lens, gain in zip(CAMERAS, gains, strict=True)
    ]
    return *images, photographer.render_depth(TRUE)


def disparity_error(depth, truth):
    """Returns the errors of the known depths, as disparities in pixels."""
    has_depth = depth > 0
    return FOCAL_BASELINE * np.abs(1e3 / depth[has_depth] - 1 / truth[has_depth])


@settings(max_examples=2)
@given(st.floats(1.0, 2.5), st.floats(0.1, 0.5), st.floats(-0.4, 0.4), st.integers(0, 99))
def test_depth_of_a_slanted_plane_is_accurate(distance, across, down, seed):
    left, right, truth = pair([Plane((0, 0, distance), (across, down, -1))], seed)
    depth = StereoMatcher(RECTIFIED, 0.5, 8.0).depth(left, right)
    assert depth.dtype == np.uint16 and depth.shape == (HEIGHT, WIDTH)
    within = (truth > 0.55) & (truth < 7.5)
    # The first columns may show points that the right camera does not see.
    within[:, : int(FOCAL_BASELINE / truth[within].min()) + 8] = False
    assert (depth[within] > 0).mean() > 0.9
    off = disparity_error(np.where(within, depth, 0), truth)
    assert np.median(off) < 0.2 and (off < 1.0).mean() > 0.97


PERFORMANCE = [*room(wall=3.0), *person(0.1, 1.2)[:4]]
"""Surfaces of a room with a head, a trunk and an arm."""


@pytest.fixture(scope="module")
def performance():
    """Renders a person in a room for two cameras with very different exposures."""
    return pair(PERFORMANCE, gains=(1.0, 1.25))


@pytest.fixture(scope="module")
def wall():
    """Renders only a wall."""
    return pair([Plane((0, 0, 1.5), (0, 0, -1))])


def test_depth_of_a_person_is_accurate_at_two_exposures(performance):
    left, right, truth = performance
    depth = StereoMatcher(RECTIFIED).depth(left, right)
    body = (truth > 0.9) & (truth < 1.35)
    assert (depth[body] > 0).mean() > 0.85
    off = disparity_error(np.where(body, depth, 0), truth)
    assert np.median(off) < 0.25 and (off < 1.0).mean() > 0.93


def test_points_hidden_from_the_right_camera_get_no_depth(performance):
    left, right, truth = performance
    photographer = Renderer(PERFORMANCE)
    eye, looks = TRUE.rays(*(each.ravel().astype(float) for each in np.meshgrid(range(WIDTH), range(HEIGHT))))
    points = eye + looks * truth.reshape(-1, 1)
    other = -CAMERAS[1].turn.T @ CAMERAS[1].shift
    reached, _ = photographer._hit(other, points - other)
    hidden = (reached < 0.95).reshape(HEIGHT, WIDTH) & (truth > 2.0)
    # Its edges are inside the matching window.
    hidden[:, 1:-1] &= hidden[:, :-2] & hidden[:, 2:]
    depth = StereoMatcher(RECTIFIED, 0.6, 8.0).depth(left, right)
    assert hidden.sum() > 500
    assert ((depth > 0) & hidden).sum() < 0.3 * hidden.sum()
    assert (disparity_error(depth, truth) > 1.5).sum() < 0.02 * depth.size


def test_the_left_edge_is_seen_as_far_as_both_cameras_see_it(wall):
    left, right, truth = wall
    depth = StereoMatcher(RECTIFIED, 0.5, 8.0).depth(left, right)
    own = int(FOCAL_BASELINE / 1.5)
    edge = depth[20:-20, own + 4 : own + 30]
    assert (edge > 0).mean() > 0.8
    assert np.median(disparity_error(edge, truth[20:-20, own + 4 : own + 30])) < 0.3


def test_unrelated_images_give_no_depth():
    left, right = (
        np.random.default_rng(seed).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8) for seed in (0, 1)
    )
    # It is 4 % without the uniqueness check and 45 % without the speckle filter.
    assert (StereoMatcher(RECTIFIED).depth(left, right) > 0).mean() < 0.032


@given(st.floats(20, 200), st.floats(0.3, 1.0), st.floats(2.0, 20.0))
def test_the_table_is_the_formula(focal_baseline, near, far):
    table = depth_table(focal_baseline, near, far, 64)
    assert table[0] == 0 and table.dtype == np.uint16 and len(table) == 64 * 16 + 1
    for step in range(1, len(table)):
        metres = focal_baseline / (step / 16)
        depth = table[step]
        assert depth == 0 if not near <= metres <= far else abs(depth - 1e3 * metres) <= 0.5 + 1e-6


def test_no_depth_is_reported_outside_the_range(wall):
    left, right, _ = wall
    depth = StereoMatcher(RECTIFIED, 1.7, 8.0).depth(left, right)
    assert (depth[20:-20, 40:-20] > 0).mean() < 0.05 and depth[depth > 0].min() >= 1700
    near_depth = StereoMatcher(RECTIFIED, 0.7, 1.6).depth(left, right)
    assert (near_depth[20:-20, 40:-20] > 0).mean() > 0.9 and near_depth.max() <= 1600


@pytest.mark.parametrize(
    ("near", "far", "what"), [(0.0, 5.0, "range"), (3.0, 2.0, "range"), (0.06, 5.0, "near=0.0")]
)
def test_a_range_that_cannot_be_seen_is_refused(near, far, what):
    with pytest.raises(InputError, match=what):
        StereoMatcher(RECTIFIED, near, far)


def test_images_of_another_size_are_refused():
    wrong = np.zeros((100, 320), np.uint8)
    with pytest.raises(InputError, match="320 x 100 pixels, but the calibration is for 256 x 160"):
        StereoMatcher(RECTIFIED).depth(wrong, wrong)


@settings(max_examples=20)
@given(st.floats(-3, 3), st.floats(0.0, 1.5), st.floats(0.04, 0.4), st.integers(0, 99))
def test_rectified_cameras_see_every_point_in_one_row(crooked, bent, baseline, seed):
    """The column difference equals the disparity of the depth; over random rigs and points."""
    from enliven_edge.sensors.stereo.stereo_solver import rectify_points

    lenses = create_lenses(baseline=baseline, crooked=crooked, bent=bent)
    calibration = calibration_of(*lenses)
    rectification = Rectification(calibration)
    random = np.random.default_rng(seed)
    depth = random.uniform(0.5, 6.0, 200)
    points = np.stack(
        [random.uniform(-0.5, 0.5, 200) * depth, random.uniform(-0.3, 0.3, 200) * depth, depth], -1
    )
    left, right = rectify_points(rectification, calibration, *(lens.pixels(points) for lens in lenses))
    assert np.abs(left[:, 1] - right[:, 1]).max() < 0.02
    camera = rectification.intrinsics
    true = camera.fx * rectification.baseline / (points @ rectification.rotations[0].T)[:, 2]
    np.testing.assert_allclose(left[:, 0] - right[:, 0], true, atol=0.02)
    assert rectification.baseline == pytest.approx(baseline, rel=1e-3)
