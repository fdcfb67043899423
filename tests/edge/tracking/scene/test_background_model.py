"""Tests of the background model: fast initial learning, updates, forgetting unmeasured pixels, excluding
people.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.scene.background_fill import background_fill, fill_from_nearest
from enliven_edge.tracking.scene.background_kernels import (
    BACKGROUND,
    FOREGROUND,
    UNLIKELY,
    UNSEEN,
    dilate,
)
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.settings import BackgroundSettings

FRAME = 1 / 30
NOBODY = np.zeros((8, 8), bool)


def in_front(room: BackgroundModel, z: np.ndarray, *, guess: bool) -> np.ndarray:
    """Returns (h, w) pixels in front of the background. Unobserved ones have a similar depth, or any
    depth.
    """
    background = fill_from_nearest(room.z) if guess else room.z
    return (z > 0) & ((background == 0) | (z < background - (0.05 + 0.012 * z * z)))


def learn(room, z, seconds, start=0.0, person=NOBODY, hold=None, rate=30):
    """Returns the background model after a constant image, and the new time."""
    for i in range(round(seconds * rate)):
        room.learn(z, person, round((start + i / rate) * 1e9), hold)
    return start + seconds


def picture(metres):
    return np.full((8, 8), float(metres))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_only_known_pixels_are_compared(seed, held):
    """Pixels held for a person that were never seen are not compared: the sensor did not move."""
    random = np.random.default_rng(seed)
    room, still = BackgroundModel((8, 8)), np.round(random.uniform(1.0, 4.0, (8, 8)), 3)
    hold = random.random((8, 8)) < held
    for n in range(5):
        agreement = room.learn(still, NOBODY, round(n * FRAME * 1e9), hold)
        assert agreement.nearer == agreement.farther == 0.0
    assert agreement.compared == np.count_nonzero(~hold)
    changed = np.where(random.random((8, 8)) < 0.5, still - 0.5, still + 0.5)
    agreement = room.learn(changed, NOBODY, round(5 * FRAME * 1e9), hold)
    expected = 1.0 if agreement.compared else 0.0
    assert agreement.nearer + agreement.farther == pytest.approx(expected)


@pytest.mark.parametrize("rate", [5, 30])
def test_furniture_that_was_moved_in_is_absorbed_within_the_stated_time(rate):
    room = BackgroundModel((8, 8), BackgroundSettings(absorb_after=6.0))
    now = learn(room, picture(3.0), 2.0, rate=rate)
    now = learn(room, picture(2.0), 5.0, now, rate=rate)
    assert in_front(room, picture(2.0), guess=True).all()
    learn(room, picture(2.0), 1.5, now, rate=rate)
    assert not in_front(room, picture(2.0), guess=True).any()


def test_removed_object_leaves_the_background_soon():
    room = BackgroundModel((8, 8))
    now = learn(room, picture(2.0), 1.0)
    learn(room, picture(3.0), 0.8, now)
    assert in_front(room, picture(2.0), guess=True).all()


def test_a_flickering_edge_is_no_foreground():
    room, random = BackgroundModel((8, 8)), np.random.default_rng(0)
    for i in range(600):
        room.learn(np.where(random.random((8, 8)) < 0.5, 2.0, 3.0), NOBODY, round(i * FRAME * 1e9))
    assert in_front(room, picture(2.0), guess=True).mean() < 0.05


def test_still_person_is_never_absorbed_into_background():
    room = BackgroundModel((8, 8))
    now = learn(room, picture(3.0), 1.0)
    learn(room, picture(2.0), 120.0, now, person=np.ones((8, 8), bool))
    assert in_front(room, picture(2.0), guess=True).all()


def test_lost_person_is_not_absorbed_until_seen_elsewhere():
    room, ids, mine = BackgroundModel((8, 8)), np.array([7]), np.zeros((8, 8), np.int64)
    now = learn(room, picture(3.0), 1.0)
    room.guard(mine, ids, picture(2.0))
    now = learn(room, picture(2.0), 60.0, now)
    assert in_front(room, picture(2.0), guess=True).all()
    room.guard(np.full((8, 8), -1), ids, picture(2.0))  # the person is tracked, but not at these pixels
    learn(room, picture(2.0), 20.0, now)
    assert not in_front(room, picture(2.0), guess=True).any()


def test_wall_behind_a_person_who_left_is_background():
    room, somebody = BackgroundModel((20, 20)), np.zeros((20, 20), bool)
    somebody[5:15, 8:12] = True
    room.learn(np.full((20, 20), 3.0), somebody)
    assert not in_front(room, np.full((20, 20), 3.0), guess=True).any()
    assert in_front(room, np.full((20, 20), 3.0), guess=False).any()
    assert in_front(room, np.full((20, 20), 2.0), guess=True).all()


def test_possible_person_is_not_learnt_at_once():
    room, hold = BackgroundModel((8, 8)), np.zeros((8, 8), bool)
    hold[:, :4] = True
    room.learn(picture(2.0), NOBODY, 0, hold)
    assert (room.z[:, :4] == 0).all()
    assert (room.z[:, 4:] == 2.0).all()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 3.5), st.floats(0.6, 1.2))
def test_constant_depth_on_a_person_before_unknown_background_is_furniture(seed, metres, speed):
    """The left half of a person's pixels only has noise; the right half moves."""
    room, random, mine = (
        BackgroundModel((8, 8)),
        np.random.default_rng(seed),
        np.ones((8, 8), bool),
    )
    for i in range(24):
        z = metres + random.normal(scale=0.003 * metres, size=(8, 8))
        z[:, 4:] += speed * abs(i % 20 - 10) * FRAME
        room.learn(z, mine, round(i * FRAME * 1e9))
    still = room.still_pixels(z)
    assert still[:, :4].mean() > 0.9 and not still[:, 4:].any()
    assert not room.still_pixels(z - 0.5).any(), "somebody passes in front of them"
    room.absorb(still)
    assert not room.still_pixels(z).any()
    depths = room.z[room.z > 0.0]
    np.testing.assert_allclose(depths, metres, atol=0.01 * metres)


def test_dropped_blob_becomes_background_at_its_depth():
    room, mine, given = BackgroundModel((8, 8)), np.ones((8, 8), bool), np.zeros((8, 8), bool)
    given[:, :3] = True
    room.learn(picture(2.0), mine)
    room.absorb(given)
    np.testing.assert_allclose(room.z, np.where(given, 2.0, 0.0))


HALL = (6, 60)
"""Image size for a hall beyond the sensor's range. Only objects in the hall are measured."""


def with_blob(left, metres=2.0):
    """Returns the hall with an object four pixels wide."""
    z = np.zeros(HALL)
    z[:, left : left + 4] = metres
    return z


def dark_hall(seconds=0.2):
    """Returns the model of an empty hall in which all pixels are learnt, and the time."""
    room = BackgroundModel(HALL)
    return room, learn(room, np.zeros(HALL), seconds, person=np.zeros(HALL, bool))


def test_moving_object_before_unmeasured_hall_is_never_learnt():
    """The object moves back and forth. The traces of successive passes do not accumulate."""
    room, now = dark_hall()
    for i, left in enumerate([*range(0, 56, 2), *range(54, 0, -2)] * 4):
        room.learn(with_blob(left), np.zeros(HALL, bool), round((now + i * FRAME) * 1e9))
        assert not room.z.any()


@pytest.mark.parametrize("rate", [10, 30])
def test_still_object_before_unmeasured_hall_is_learnt_quickly(rate):
    room, now = dark_hall()
    now = learn(room, with_blob(20), 0.2, now, np.zeros(HALL, bool), rate=rate)
    assert not room.z.any()
    learn(room, with_blob(20), 0.3, now, np.zeros(HALL, bool), rate=rate)
    np.testing.assert_array_equal(room.z, with_blob(20))


def test_approaching_object_before_unmeasured_hall_is_learnt_once_still():
    """The object approaches on the same pixels."""
    room, now = dark_hall()
    for i in range(30):
        room.learn(with_blob(20, 3.5 - 0.05 * i), np.zeros(HALL, bool), round((now + i * FRAME) * 1e9))
    assert not room.z.any()
    learn(room, with_blob(20, 2.0), 1.0, now + 1.0, np.zeros(HALL, bool))
    np.testing.assert_array_equal(room.z, with_blob(20))


def with_dark(columns, metres=3.0):
    """Returns a wall whose first columns are not measured."""
    z = picture(metres)
    z[:, :columns] = 0.0
    return z


@pytest.mark.parametrize("rate", [5, 30])
def test_background_without_depth_is_forgotten_after_a_while(rate):
    room = BackgroundModel((8, 8))
    now = learn(room, picture(3.0), 1.0, rate=rate)
    now = learn(room, with_dark(3), 1.8, now, rate=rate)
    np.testing.assert_array_equal(room.z, picture(3.0))
    learn(room, with_dark(3), 0.6, now, rate=rate)
    np.testing.assert_array_equal(room.z, with_dark(3))


def test_intermittently_measured_background_is_kept():
    room = BackgroundModel((8, 8))
    now = learn(room, picture(3.0), 1.0)
    for _ in range(5):
        now = learn(room, with_dark(3), 1.5, now)
        now = learn(room, picture(3.0), 0.1, now)
    assert room.z.all()


@pytest.mark.parametrize("columns", [5, 8])
def test_covered_lens_keeps_the_background(columns):
    room = BackgroundModel((8, 8))
    now = learn(room, picture(3.0), 1.0)
    now = learn(room, with_dark(columns), 10.0, now)
    np.testing.assert_array_equal(room.z, picture(3.0))
    now = learn(room, with_dark(2), 0.5, now)  # the first frames have holes
    np.testing.assert_array_equal(room.z, picture(3.0))
    learn(room, picture(3.0), 0.5, now)
    assert not in_front(room, picture(3.0), guess=False).any()


def test_forgotten_background_is_relearnt_only_there():
    room, where = BackgroundModel((8, 8)), np.zeros((8, 8), bool)
    where[2:5, 1:4] = True
    now = learn(room, picture(2.0), 1.0)
    now = learn(room, picture(1.0), 0.5, now)  # it is partly absorbed
    room.forget(where)
    np.testing.assert_array_equal(room.z, np.where(where, 0.0, 2.0))
    assert in_front(room, picture(2.5), guess=False)[where].all()
    learn(room, picture(2.5), 0.5, now)
    np.testing.assert_array_equal(room.z, np.where(where, 2.5, 2.0))


def view_of(z):
    camera = WorkingCamera(Intrinsics(8, 8, 100, 100, 3.5, 3.5), 8)
    mount = np.diag([1.0, -1.0, -1.0, 1.0])
    mount[1, 3] = 1.0
    return FrameView(0, z, world_points(z, camera.ray, mount), camera, mount)


def test_learnt_fringe_does_not_predict_unseen_background():
    """In a hall beyond the sensor's range, a person's own feet would otherwise make the whole person
    background.
    """
    for count, expected in ((1, UNSEEN), (20, UNLIKELY)):
        room, fringe = BackgroundModel((8, 8)), np.zeros((8, 8))
        fringe.ravel()[-count:] = 2.0
        learn(room, fringe, 0.05)
        z = np.zeros((8, 8))
        z[2:4, 3] = 2.02
        kind = room.classify(view_of(z), near=0.3, far=8.0, floor_band=-5.0)
        assert (kind[2:4, 3] == expected).all()


def test_pixels_are_classified():
    room = BackgroundModel((8, 8))
    somebody = np.zeros((8, 8), bool)
    somebody[:, 5:] = True
    room.learn(picture(3.0), somebody, 0)
    z = picture(3.0)
    z[0], z[:, 7] = 2.0, 2.0
    z[2, 7], z[5, 2] = 3.0, 0.0
    kind = room.classify(view_of(z), 0.4, 4.5, 0.05)
    assert kind[0, 0] == FOREGROUND
    assert kind[4, 0] == BACKGROUND
    assert kind[4, 7] == UNSEEN
    assert kind[2, 7] == UNLIKELY
    assert kind[5, 2] == BACKGROUND


@given(st.integers(0, 1000), st.floats(0.0, 1.0))
@settings(max_examples=25, deadline=None)
def test_filling_takes_about_the_nearest_known_value(seed, share):
    random = np.random.default_rng(seed)
    z = np.where(random.random((20, 30)) < share, random.uniform(1, 4, (20, 30)), 0.0)
    completed = fill_from_nearest(z)
    np.testing.assert_array_equal(completed[z > 0], z[z > 0])
    if (z > 0).any():
        assert np.isin(completed, z[z > 0]).all()
        exact = ndimage.distance_transform_edt(z == 0)
        near = [
            np.isclose(completed[v, u], z[v2, u2])
            for v, u in ((0, 0), (19, 29), (10, 15))
            for v2, u2 in [nearest(z, v, u, completed[v, u])]
            if np.hypot(v - v2, u - u2) <= 1.1 * exact[v, u] + 1e-9
        ]
        assert len(near) == 3
    else:
        assert not completed.any()


def nearest(z, v, u, value):
    """Returns the pixel with that value that is nearest to (v, u)."""
    rows, columns = np.nonzero(z == value)
    best = np.argmin(np.hypot(rows - v, columns - u))
    return rows[best], columns[best]


def chamfer(z):
    """Returns (n, h, w) chamfer distances from each known pixel, with a diagonal step of 1.414. Slow
    reference.
    """
    v, u = np.indices(z.shape)
    down, right = (np.abs(x - y[:, None, None]) for x, y in zip((v, u), np.nonzero(z), strict=True))
    return np.abs(down - right) + 1.414 * np.minimum(down, right)


@given(st.integers(0, 1000), st.floats(0.001, 0.3))
@settings(max_examples=40, deadline=None)
def test_filling_takes_a_known_value_than_which_none_is_nearer(seed, share):
    random = np.random.default_rng(seed)
    is_known = random.random((13, 17)) < share
    is_known[random.integers(13), random.integers(17)] = True
    z = np.zeros(is_known.shape)
    z[is_known] = 1 + np.arange(is_known.sum())
    far, chosen = chamfer(z), fill_from_nearest(z).astype(int) - 1
    np.testing.assert_allclose(np.take_along_axis(far, chosen[None], 0)[0], far.min(0), atol=1e-9)


HALL_CAMERA = WorkingCamera(Intrinsics(96, 72, 80, 80, 47.5, 35.5), 96)
"""Camera for tests of filling in the whole background."""
FLOOR_BAND = 0.05


def rise_of(mount):
    """Returns (h, w) height gain of every pixel's ray, metres per metre of depth."""
    return HALL_CAMERA.ray @ mount[1, :2] + mount[1, 2]


def floor_of(mount):
    """Returns (h, w) depth of the floor in metres, 0 for rays that do not go down."""
    rise = rise_of(mount)
    return np.where(rise < -1e-3, -mount[1, 3] / np.where(rise < -1e-3, rise, -1.0), 0.0)


def guess(z, mount):
    return background_fill(z, HALL_CAMERA.ray, mount, FLOOR_BAND)


@given(st.integers(0, 1000), st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_known_background_is_not_filled_in(seed, share):
    random = np.random.default_rng(seed)
    z = np.where(random.random((72, 96)) < share, random.uniform(0.5, 6.0, (72, 96)), 0.0)
    guessed = guess(z, world_from_level_camera(random.uniform(0.3, 2.5), random.uniform(-0.4, 0.6)))
    np.testing.assert_array_equal(guessed[z > 0], z[z > 0])
    assert (guessed >= 0).all()


def test_unknown_room_is_not_filled_in():
    assert not guess(np.zeros((72, 96)), world_from_level_camera(1.2)).any()


@given(st.integers(0, 67), st.integers(0, 91), st.floats(0.5, 4.0))
@settings(max_examples=40, deadline=None)
def test_few_pixels_do_not_predict_the_background(top, left, metres):
    """The tip of a foot that was left out of a person's pixels; also in a corner of the image."""
    z = np.zeros((72, 96))
    z[top : top + 5, left : left + 5] = metres
    np.testing.assert_array_equal(guess(z, world_from_level_camera(1.2)), z)


def test_a_patch_that_is_large_enough_is_the_wall():
    z = np.zeros((72, 96))
    z[20:34, 40:54] = 3.0
    np.testing.assert_array_equal(guess(z, world_from_level_camera(1.2)), 3.0)


@given(st.floats(0.5, 2.4), st.floats(-0.2, 0.5), st.floats(1.5, 5.0), st.booleans())
@settings(max_examples=30, deadline=None)
def test_background_known_on_one_side_is_filled_in_on_the_other(height, tilt, wall, mirrored):
    mount = world_from_level_camera(height, tilt)
    floor = floor_of(mount)
    room = np.where((floor > 0) & (floor < wall), floor, wall)
    half = slice(48, None) if mirrored else slice(48)
    z = np.zeros((72, 96))
    z[:, half] = room[:, half]
    stands = rise_of(mount) * wall + height > FLOOR_BAND + 1e-6
    guessed = guess(z, mount)
    np.testing.assert_allclose(guessed[room < wall], floor[room < wall])
    assert (guessed[(room == wall) & stands] == wall).all()


@given(st.integers(0, 1000), st.floats(0.5, 2.4), st.floats(-0.2, 0.5))
@settings(max_examples=30, deadline=None)
def test_by_the_floor_only_the_floor_is_known(seed, height, tilt):
    """Each pixel has its own depth of the floor; nothing is known above the horizon."""
    mount = world_from_level_camera(height, tilt)
    floor, z = floor_of(mount), np.zeros((72, 96))
    z[50:, 10:50] = floor[50:, 10:50]
    z += (z > 0) * np.random.default_rng(seed).uniform(-0.01, 0.01, z.shape)
    unknown, guessed = z == 0, guess(z, mount)
    np.testing.assert_allclose(guessed[unknown], floor[unknown])


def guessed_slowly(z, ray, mount, floor_band):
    """Computes the filled background on whole images, as a slow reference."""
    rise, height = ray @ mount[1, :2] + mount[1, 2], mount[1, 3]
    patches = ndimage.uniform_filter((z > 0).astype(np.float64), 31) > 0.12
    completed = fill_from_nearest(np.where(patches, np.where(rise * z + height < floor_band, -z, z), 0.0))
    floor = np.where(rise < -1e-3, -height / np.minimum(rise, -1e-3), 0.0)
    return np.where(z > 0, z, np.where(completed < 0, np.maximum(floor, 0.0), completed))


@given(st.integers(0, 10_000), st.integers(1, 70), st.integers(1, 70), st.floats(0.2, 4.0))
@settings(max_examples=40, deadline=None)
def test_background_filling_matches_the_slow_reference(seed, h, w, coarse):
    """Also in images smaller than a patch, which are mirrored repeatedly."""
    random = np.random.default_rng(seed)
    is_known = ndimage.gaussian_filter(random.standard_normal((h, w)), coarse) > random.uniform(-0.1, 0.1)
    z, ray = random.uniform(1, 4, (h, w)) * is_known, random.standard_normal((h, w, 2))
    mount = world_from_level_camera(random.uniform(0.5, 2.5), random.uniform(-0.5, 0.5))
    np.testing.assert_allclose(background_fill(z, ray, mount, 0.08), guessed_slowly(z, ray, mount, 0.08))


@given(st.integers(0, 1000), st.integers(0, 3))
@settings(max_examples=20, deadline=None)
def test_widened_is_a_dilation(seed, pixels):
    mask = np.random.default_rng(seed).random((20, 24)) < 0.05
    square = np.ones((2 * pixels + 1, 2 * pixels + 1))
    np.testing.assert_array_equal(dilate(mask, pixels), ndimage.binary_dilation(mask, square))
