"""Tests of outlines that may be people, and of separating people who stand side by side."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.segment.person_shape import measure_plane_deviation, measure_shape
from enliven_edge.tracking.segment.pieces import split_people
from enliven_edge.tracking.segment.shape_kernels import outline_of_pixels

CAMERA = WorkingCamera(Intrinsics(160, 120, 130, 130, 79.5, 59.5), 160)
MOUNT = world_from_level_camera(1.2)
PIXEL = 1 / 130**2


def drawn(*boxes, wall=4.0):
    """Returns a view of flat boxes (left, right, bottom, top, z), world metres, in front of a wall."""
    z = np.full((120, 160), wall)
    for left, right, bottom, top, depth in boxes:
        x, y = CAMERA.ray[..., 0] * depth, 1.2 - CAMERA.ray[..., 1] * depth
        inside = (x > left) & (x < right) & (y > bottom) & (y < top)
        bulge = 0.12 * np.sin(np.pi * np.clip((x - left) / (right - left), 0, 1))
        z[inside] = np.minimum(z, depth - bulge)[inside]
    return FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)


def shape(view, mask):
    return measure_shape(view, mask, float((view.z[mask] ** 2).sum() * PIXEL))


PERSON = ((-0.22, 0.22, 0.8, 1.45, 2.5), (-0.09, 0.09, 1.45, 1.72, 2.5), (-0.16, 0.16, 0.1, 0.8, 2.5))


def test_a_head_above_shoulders_is_human():
    view = drawn(*PERSON)
    measured = shape(view, view.z < 3.0)
    assert measured.is_upright
    assert measured.has_person_shape
    assert measured.shows_crown
    assert abs(measured.crown - 1.72) < 0.06


def test_a_flat_panel_and_a_post_are_not_upright_people():
    z = np.full((120, 160), 4.0)
    z[20:110, 50:90] = 2.5
    panel = FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)
    assert not shape(panel, panel.z < 3.0).has_person_shape
    post = drawn((-0.15, 0.15, 0.1, 1.8, 2.5))
    assert not shape(post, post.z < 3.0).is_upright


def test_a_piece_of_a_wall_is_not_free():
    view = drawn(*PERSON)
    mask = np.zeros((120, 160), bool)
    mask[10:100, 20:50] = True  # a part of the wall
    assert not shape(view, mask).may_be_person


def test_occluded_shape_is_not_whole():
    view = drawn(*PERSON, (0.02, 0.6, 0.1, 1.9, 1.8))
    mask = (view.z < 3.0) & (view.z > 2.0)
    assert shape(view, mask).occluded_fraction > 0.2
    assert not shape(view, mask).shows_crown


def test_shape_surrounded_by_unknown_depth_is_free():
    view = drawn(*PERSON, wall=0.0)
    z = drawn(*PERSON).z
    z[z > 3.0] = 0.0
    mask = z > 0
    assert outline(z, mask)[0] == 1.0
    assert view.z.max() == 0.0


def beside_a_wall(measured):
    """Returns a square region of a wall at the same depth. The points to the right and above are farther
    away.

    Args:
        measured: fraction of the surrounding rows (or columns) that have depth.
    """
    z, mask = np.full((120, 160), 4.0), np.zeros((120, 160), bool)
    z[:, :80] = 2.5
    mask[40:60, 60:80] = True
    z[:40, 60:] = 4.0
    z[~mask & (np.add.outer(np.arange(120), np.arange(160)) % 20 >= 20 * measured)] = 0.0
    return z, mask


def test_measured_surroundings_are_free_where_farther_away():
    free, behind, border, cut = outline(*beside_a_wall(1.0))
    assert free == pytest.approx(2 / 3)
    assert (behind, border, cut) == (0.0, 0.0, False)


@pytest.mark.parametrize(("measured", "free"), [(0.1, 1.0), (0.25, 1.0), (0.35, 2 / 3), (0.8, 2 / 3)])
def test_shape_with_few_measured_surroundings_is_free(measured, free):
    """The surroundings count if at least three tenths of them are measured."""
    z, mask = beside_a_wall(measured)
    assert outline(z, mask)[0] == pytest.approx(free)


def test_the_images_border_counts_as_measured():
    """For a part of a wall in the image's corner, the border is sufficient evidence."""
    z, mask = np.zeros((120, 160)), np.zeros((120, 160), bool)
    z[:20, :20], mask[:20, :20] = 2.5, True
    free, _, border, _ = outline(z, mask)
    assert (free, border) == (0.0, 1.0)


def outline(z, mask):
    return outline_of_pixels(z, mask, pixels_of(mask))


def obvious_outline(z, mask):
    """Computes the result of :func:`outline` by a loop over all pixels."""
    width = z.shape[1]
    step, counts = 0.05 + 0.012 * z**2, np.zeros(4, int)
    for v, u in ((0, -1), (0, 1), (-1, 0)):
        for i, j in np.argwhere(mask):
            if not (i + v >= 0 and 0 <= j + u < width):
                counts[3] += 1
            elif not mask[i + v, j + u] and i + 3 * v >= 0 and 0 <= j + 3 * u < width:
                beyond = z[i + 3 * v, j + 3 * u]
                if beyond and not mask[i + 3 * v, j + 3 * u]:
                    counts[
                        0 if beyond > z[i, j] + step[i, j] else 1 if beyond < z[i, j] - step[i, j] else 2
                    ] += 1
    farther, nearer, _, border = counts / max(1, counts.sum())
    return farther, nearer, border, mask[-2:].sum() > 0.05 * width


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_outline_is_that_of_the_obvious_walk(seed):
    """For patches of any form at any place of the image, among similar depths."""
    random = np.random.default_rng(seed)
    z, mask = random.choice([2.0, 2.08, 2.6], (24, 31)), np.zeros((24, 31), bool)
    for _ in range(3):
        top, left = random.integers(0, 20, 2)
        mask[top : top + random.integers(1, 12), left : left + random.integers(1, 12)] = True
    mask &= random.uniform(size=mask.shape) < 0.9
    z[random.uniform(size=z.shape) < 0.1] = 0.0
    z[mask & (z == 0.0)] = 2.0
    np.testing.assert_allclose(outline(z, mask), obvious_outline(z, mask), atol=1e-12)


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_best_plane_and_the_longest_way_are_lapacks(seed):
    random = np.random.default_rng(seed)
    points = random.standard_normal((3, 3)) * random.uniform(0.01, 1.0, 3) @ random.standard_normal((3, 60))
    thickness, along = measure_plane_deviation(points)
    centred = points - points.mean(1, keepdims=True)
    covariance = centred @ centred.T / 60
    assert thickness == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance)[0]), abs=1e-6)
    way = np.linalg.eigh(covariance[::2, ::2])[1][:, 1]
    np.testing.assert_allclose(np.abs(along), np.abs(way @ centred[::2]), atol=1e-7)


def test_points_in_one_place_have_no_thickness():
    thickness, along = measure_plane_deviation(np.ones((3, 5)))
    assert thickness == 0.0
    assert not along.any()


def test_blob_at_image_border_counts_as_cut():
    z = np.full((120, 160), 3.0)
    z[40:, 60:100] = 1.0
    free, behind, border, cut = outline(z, z < 2.0)
    assert cut
    assert (free, behind, border) == (1.0, 0.0, 0.0)


def test_people_side_by_side_are_parted_and_raised_hands_are_not():
    left = [(a - 0.35, b - 0.35, *rest) for a, b, *rest in PERSON]
    right = [(a + 0.35, b + 0.35, *rest) for a, b, *rest in PERSON]
    view = drawn(*left, *right, (-0.2, 0.2, 0.9, 1.0, 2.5))
    mask = view.z < 3.0
    parts = split_people(view.points, mask)
    assert len(parts) == 2
    np.testing.assert_array_equal(parts[0] | parts[1], mask)
    assert not (parts[0] & parts[1]).any()
    sides = sorted(float(view.points[part][:, 0].mean()) for part in parts)
    assert sides[0] < -0.25 < 0.25 < sides[1]
    arms = ((-0.65, -0.2, 1.3, 1.4, 2.5), (0.2, 0.65, 1.3, 1.4, 2.5))
    hands = ((-0.68, -0.58, 1.3, 1.95, 2.5), (0.58, 0.68, 1.3, 1.95, 2.5))
    raised = drawn(*PERSON, *arms, *hands)
    assert len(split_people(raised.points, raised.z < 3.0)) == 1


def test_person_partly_occluded_by_others_counts_as_free():
    """An occluder in front of a person is no evidence that the outline is connected to a wall."""
    view = drawn(*PERSON, (0.02, 0.6, 0.1, 1.3, 1.8))
    mask = (view.z < 3.0) & (view.z > 2.0)
    measured = shape(view, mask)
    assert measured.occluded_fraction > 0.2
    assert measured.may_be_person


def test_a_thin_body_with_a_head_is_no_panel():
    z = np.full((120, 160), 0.0)
    for u, v in (
        (slice(72, 88), slice(32, 44)),
        (slice(52, 108), slice(48, 56)),
        (slice(70, 90), slice(44, 108)),
    ):
        z[v, u] = 2.5
    flat = FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)
    measured = shape(flat, flat.z > 0)
    assert measured.thickness < 0.022 and measured.width > 0.35
    assert measured.is_upright


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_measures_of_a_shape_are_those_of_the_obvious_way(seed):
    """Head, shoulders, fill and thickness of a bent body, with arrays of all its points."""
    random = np.random.default_rng(seed)
    shifts = random.uniform(-0.2, 0.2, (3, 2))
    boxes = [
        (a + x, b + x, low, high, z + 0.4 * y)
        for (a, b, low, high, z), (x, y) in zip(PERSON, shifts, strict=True)
    ]
    view = drawn(*boxes)
    mask = (view.z < 3.2) & (random.uniform(size=view.z.shape) < 0.9)
    measured, points = shape(view, mask), view.points[mask]
    points = points[:: max(1, len(points) // 1500)]
    centred = points - points.mean(0)
    values = np.linalg.eigh(centred.T @ centred / len(points))[0]
    along = centred[:, [0, 2]] @ np.linalg.eigh(np.cov(centred[:, [0, 2]].T, bias=True))[1][:, 1]
    height, crown = points[:, 1], np.percentile(points[:, 1], 99)

    def width(top, bottom):
        part = along[(height <= crown - top) & (height > crown - bottom)]
        return len(np.unique(np.floor(part / 0.04))) * 0.04

    shoulders = max(width(0.25, 0.35), width(0.35, 0.45), width(0.45, 0.55), 0.04)
    cells = len(np.unique(np.floor(np.stack([along, height]) / 0.06), axis=1).T)
    box = np.ptp(np.percentile(along, [1, 99])) * np.ptp(np.percentile(height, [1, 99]))
    across = np.ptp(np.percentile(points, [3, 97], axis=0), axis=0)
    assert measured.crown == pytest.approx(crown, abs=1e-9)
    assert measured.thickness == pytest.approx(np.sqrt(values[0]), abs=1e-6)
    assert measured.width == pytest.approx(max(across[0], across[2]), abs=1e-9)
    # A point on the border of a step may fall to either side of it.
    assert measured.head_width == pytest.approx(width(-1.0, 0.14), abs=0.041)
    assert measured.head_ratio == pytest.approx(width(-1.0, 0.14) / shoulders, abs=0.041 / shoulders * 2)
    assert measured.box_fill == pytest.approx(cells * 0.06**2 / box, abs=2 * 0.06**2 / box)
