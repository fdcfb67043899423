"""Tests of assigning pixels to people: compiled kernels against slow versions, and outstretched arms."""

from dataclasses import replace

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.scene.background_kernels import BACKGROUND, UNLIKELY, UNSEEN
from enliven_edge.tracking.segment.pixel_labels import image_boxes, label_pixels, project_ball_extent
from enliven_edge.tracking.segment.segmentation import (
    MIN_GROUP_AREA_M2,
    REACH,
    find_candidate_pixels,
    label_groups,
    segment_people,
)

CAMERA = WorkingCamera(Intrinsics(80, 60, 66, 66, 39.5, 29.5), 80)
MOUNT = world_from_level_camera(1.2)


def view_of(z):
    return FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)


def person(x, z=-2.5, **pose):
    return Posture(np.array([x, 0.95, z]), standing_pose(0.0, **pose), lengths_for_height(1.75))


def surface_distance(points, posture):
    """Returns (h, w) distances to the nearest capsule in metres. Slow reference."""
    ends, radii = posture.capsules()
    best = np.full(points.shape[:2], np.inf)
    for (a, b), (ra, rb) in zip(ends, radii, strict=True):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        away = np.linalg.norm(points - a - t[..., None] * (b - a), axis=-1)
        best = np.minimum(best, away - ra - t * (rb - ra))
    return best


@given(st.integers(0, 1000), st.floats(0.3, 1.5))
@settings(max_examples=15, deadline=None)
def test_pixels_go_to_the_nearest_body_within_reach(seed, apart):
    random = np.random.default_rng(seed)
    view = view_of(np.clip(2.4 + 0.2 * random.standard_normal((60, 80)), 1.0, 4.0))
    postures = [person(-apart / 2), person(apart / 2, arm_raise=1.4)]
    ends, radii = (np.stack(x) for x in zip(*(p.capsules() for p in postures), strict=True))
    owner, distance = np.full((60, 80), -1), np.full((60, 80), np.inf)
    kind = np.full((60, 80), UNSEEN, np.uint8)
    boxes = image_boxes(view, ends, radii, REACH)
    label_pixels(view.points, kind, boxes, ends, radii, np.zeros(2), REACH, 0.08, owner, distance)
    exact = np.stack([surface_distance(view.points, p) for p in postures]).clip(0.0)
    clear = np.abs(exact[0] - exact[1]) > 1e-5  # on both surfaces: either may own it
    clear &= np.abs(exact.min(0) - REACH) > 1e-6  # at the end of its reach: rounding decides
    expected = np.where(exact.min(0) < REACH, exact.argmin(0), -1)
    np.testing.assert_array_equal(owner[clear], expected[clear])
    assert set(np.unique(owner[~clear])) <= {-1, 0, 1}


@given(st.integers(0, 100_000), st.floats(0.0, 0.1))
@settings(max_examples=25, deadline=None)
def test_claims_match_the_slow_reference(seed, handicap):
    """For pixels of every kind at random depths, and an occluded person; to single precision."""
    random, shape = np.random.default_rng(seed), (60, 80)
    view = view_of(random.uniform(1.5, 3.5, (60, 1)) + 0.3 * random.standard_normal(shape))
    postures = [person(x, -2.0 - x**2, arm_raise=random.uniform(0, 2)) for x in random.uniform(-1, 1, 3)]
    ends, radii = (np.stack(x) for x in zip(*(p.capsules() for p in postures), strict=True))
    kind, weaker = random.integers(0, 4, shape).astype(np.uint8), np.array([0.0, handicap, 0.0])
    owner, distance = np.full(shape, -1), np.full(shape, np.inf)
    boxes = image_boxes(view, ends, radii, REACH)
    label_pixels(view.points, kind, boxes, ends, radii, weaker, REACH, 0.08, owner, distance)
    away = np.stack([surface_distance(view.points, p) for p in postures]).clip(0.0) + weaker[:, None, None]
    limit = np.where(kind == BACKGROUND, 0.0, np.where(kind == UNLIKELY, 0.08, REACH))
    least, second = np.sort(away, axis=0)[:2]
    clear = (second - least > 1e-5) & (np.abs(away - limit).min(0) > 1e-5)
    np.testing.assert_array_equal(owner[clear], np.where(least < limit, away.argmin(0), -1)[clear])
    theirs = clear & (owner >= 0)
    np.testing.assert_allclose(distance[theirs], least[theirs], atol=2e-6)


def boxes_slowly(view, ends, radii, reach):
    """Returns (K, 4) boxes around the balls at the capsules' ends, computed by angles. NaN is handled
    separately.
    """
    mount, (fx, fy, cx, cy), (height, width) = view.world_from_camera, view.camera.camera, view.z.shape
    local = (ends - mount[:3, 3]) @ mount[:3, :3]
    boxes = []
    for person, balls in enumerate(radii + reach):
        sides = []
        for axis, (f, c, size) in enumerate(((fy, cy, height), (fx, cx, width))):
            x, z = local[person, ..., 1 - axis], local[person, ..., 2]
            share = balls / np.hypot(x, z)
            half = np.arcsin(np.minimum(share, 1.0))
            low, high = np.arctan2(x, z) - half, np.arctan2(x, z) + half
            least = np.where((share < 1) & (np.cos(low) > 0), np.tan(low), -np.inf)
            most = np.where((share < 1) & (np.cos(high) > 0), np.tan(high), np.inf)
            numbers = np.isfinite(share)
            least, most = least[numbers].min(), most[numbers].max()
            ends_of = np.floor(f * least + c), np.ceil(f * most + c) + 1
            sides.append([np.clip(end, 0, size) for end in ends_of])
        boxes.append(np.transpose(sides).ravel())
    return np.array(boxes)


def random_capsules(random, people=3, count=6):
    """Returns (ends, radii) of capsules. Some are behind the sensor, some close in front of it."""
    near = MOUNT[:3, 3] + random.normal(0, 0.1, (people, count, 2, 3))
    anywhere = random.normal([0, 1, -1.5], [2, 1, 2], (people, count, 2, 3))
    ends = np.where(random.random((people, count, 1, 1)) < 0.1, near, anywhere)
    few = random.random((people, 1, 1, 1)) < 0.5
    return np.where(few, ends[:, :1], ends), random.uniform(0.02, 0.2, (people, count, 2))


@given(st.integers(0, 100_000), st.floats(0.0, 0.4))
@settings(max_examples=60, deadline=None)
def test_the_boxes_are_those_around_the_capsules(seed, reach):
    random = np.random.default_rng(seed)
    ends, radii = random_capsules(random)
    if random.random() < 0.3:
        ends[0, 1:, random.integers(2), random.integers(3)] = np.nan
    mount = MOUNT.copy()
    mount[:3, :3] = rotation(*random.normal(0, 0.5, 3)) @ mount[:3, :3]
    view = replace(view_of(np.ones((60, 80))), world_from_camera=mount)
    boxes = image_boxes(view, ends, radii, reach)
    np.testing.assert_array_equal(boxes, boxes_slowly(view, ends, radii, reach))
    assert (boxes >= 0).all() and (boxes <= [60, 80, 60, 80]).all() and (boxes[:, :2] <= boxes[:, 2:]).all()


def test_person_without_pixels_has_an_empty_box():
    ends, radii = random_capsules(np.random.default_rng(0))
    view = view_of(np.ones((60, 80)))
    expected = image_boxes(view, ends, radii, REACH)
    expected[1], ends[1] = 0, np.nan
    np.testing.assert_array_equal(image_boxes(view, ends, radii, REACH), expected)
    radii[2], expected[2] = np.nan, 0
    np.testing.assert_array_equal(image_boxes(view, ends, radii, REACH), expected)


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_loose_groups_match_a_flood_fill(seed):
    mask = np.random.default_rng(seed).random((30, 40)) < 0.5
    kind, nobody = np.where(mask, UNSEEN, 0).astype(np.uint8), np.full((30, 40), -1)
    labels, count = label_groups(np.ones((30, 40)), find_candidate_pixels(kind, nobody), 1.0)
    expected, expected_count = ndimage.label(mask)
    assert count == expected_count
    np.testing.assert_array_equal(labels, expected)


def test_a_step_in_depth_parts_two_groups():
    z = np.ones((10, 10))
    z[:, 5:] = 2.0
    kind, nobody = np.full((10, 10), UNSEEN, np.uint8), np.full((10, 10), -1)
    assert label_groups(z, find_candidate_pixels(kind, nobody), 1.0)[1] == 2


def contacts_slowly(view, owner, group, people):
    """Returns (K,) the number of pixel sides at which a group continues the surface of each person."""
    counts = np.zeros(people, int)
    for v, u in np.argwhere(group):
        for q, p in ((v - 1, u), (v + 1, u), (v, u - 1), (v, u + 1)):
            if 0 <= q < 60 and 0 <= p < 80 and owner[q, p] >= 0:
                counts[owner[q, p]] += abs(view.z[q, p] - view.z[v, u]) < 0.035 + 0.012 * view.z[v, u] ** 2
    return counts


@given(st.integers(0, 100_000), st.integers(0, 2))
@example(2146, 2)
@settings(max_examples=25, deadline=None)
def test_loose_group_measures_match_the_slow_reference(seed, people):
    """None is a speckle or a limb, the largest come first, and every person's pixels are counted."""
    random = np.random.default_rng(seed)
    view = view_of(2.4 + 0.4 * ndimage.gaussian_filter(random.standard_normal((60, 80)), 4))
    spots = ndimage.gaussian_filter(random.standard_normal((60, 80)), 3) > 0.03
    kind = np.where(spots, UNSEEN, UNLIKELY).astype(np.uint8)
    segments = segment_people(view, kind, [person(x) for x in (-0.4, 0.5)[:people]])
    owner, areas = segments.owner, [group.area for group in segments.loose]
    np.testing.assert_array_equal(segments.counts, [np.count_nonzero(owner == k) for k in range(people)])
    assert areas == sorted(areas, reverse=True)
    assert all(area >= MIN_GROUP_AREA_M2 for area in areas)
    for group in segments.loose:
        where = segments.group(group)
        assert (owner[where] == -1).all()
        points, (rows, columns) = view.points[where], np.nonzero(where)
        np.testing.assert_allclose(group.area, (view.z[where] ** 2).sum() / 66**2)
        np.testing.assert_array_equal([group.low, group.high], [points.min(0), points.max(0)])
        np.testing.assert_allclose(group.centre, points.mean(0))
        assert group.box == (rows.min(), columns.min(), rows.max() + 1, columns.max() + 1)
        contact = contacts_slowly(view, np.where(segments.labels > 0, -1, owner), where, people)
        # Groups connected with it that became limbs were not connected with a person, so they are not with
        # it.
        np.testing.assert_array_equal(group.contact, contact)
        short = np.linalg.norm(group.high - group.low) < 0.95
        assert not (contact.any() and group.area < 0.12 and short)


def drawn(boxes):
    """Returns a view of flat boxes (left, right, bottom, top, z in world metres) without a background."""
    z = np.zeros((60, 80))
    for left, right, bottom, top, depth in boxes:
        u, v = CAMERA.ray[..., 0] * depth, 1.2 - CAMERA.ray[..., 1] * depth
        z[(u > left) & (u < right) & (v > bottom) & (v < top)] = depth
    return view_of(z)


def test_an_arm_that_was_not_expected_there_belongs_to_its_owner():
    view = drawn([(-0.2, 0.2, 0.1, 1.7, 2.4), (0.2, 0.85, 1.3, 1.42, 2.4)])
    kind = np.where(view.z > 0, UNSEEN, 0).astype(np.uint8)
    segments = segment_people(view, kind, [person(0.0)])
    assert (segments.owner[view.z > 0] == 0).all()
    assert segments.loose == []


def test_touching_person_is_not_the_others_limb():
    view = drawn([(-0.2, 0.2, 0.1, 1.7, 2.4), (0.6, 1.0, 0.1, 1.7, 2.4), (0.2, 0.7, 1.0, 1.1, 2.4)])
    kind = np.where(view.z > 0, UNSEEN, 0).astype(np.uint8)
    segments = segment_people(view, kind, [person(0.0)])
    assert len(segments.loose) == 1
    assert segments.loose[0].contact[0] > 0
    right = (view.z > 0) & (view.points[..., 0] > 0.7)
    assert (segments.owner[right] == -1).all()
    assert segments.counts[0] == np.count_nonzero(segments.owner == 0)


@given(st.integers(0, 10_000), st.floats(-2.0, 2.0), st.floats(-1.0, 4.0), st.floats(0.05, 0.5))
@settings(max_examples=100, deadline=None)
def test_a_ball_is_seen_between_its_tangents(seed, x, z, radius):
    """No point in front of the sensor projects outside, and some project close to both ends."""
    dice = np.random.default_rng(seed)
    turn = dice.uniform(0, 2 * np.pi, 4000)
    across, along = x + radius * np.cos(turn), z + radius * np.sin(turn)
    slopes = (across / along)[along > 1e-3]
    least, most = project_ball_extent(x, z, radius)
    assert (slopes >= least - 1e-6).all() and (slopes <= most + 1e-6).all()
    if z > 1.0 and abs(x) < z:
        assert slopes.min() < least + 0.01 and slopes.max() > most - 0.01
