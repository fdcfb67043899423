"""Tests that the tracker learns the room again on request: a moved chair, another floor, and its people."""

import numpy as np
import pytest

from enliven.camera import Intrinsics, world_from_level_camera
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven_edge.tracking.scene.mounting import Mounting
from enliven_edge.tracking.settings import SceneSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.scene import ROOM, Box, cast_room
from enliven_synthesis.sensor.synthetic import SyntheticSensor

CAMERA = Intrinsics(320, 240, 290.0, 290.0, 160.0, 120.0)
HALF_SECOND = 15
"""Number of frames in half a second."""
STEP_NS = 33_333_333


def chair_at(x: float) -> tuple[Box, ...]:
    """Returns the boxes of a chair at x: a seat on a block, and a back."""
    return Box((x, 0.0, -2.6), (x + 0.45, 0.45, -2.15)), Box((x, 0.45, -2.6), (x + 0.45, 0.95, -2.55))


class Camera:
    """A camera at rest that counts its frames."""

    def __init__(self, height: float = 1.2) -> None:
        self.pose, self._number = world_from_level_camera(height, 0.2), 0

    def frame(self, *things: Box) -> DepthFrame:
        """Returns the next frame of the room with the given objects."""
        depth, _ = cast_room(CAMERA, self.pose, ROOM + things)
        millimetres = np.where(depth < 8.0, 1000 * depth, 0).astype(np.uint16)
        self._number += 1
        return DepthFrame(millimetres, CAMERA, self._number * STEP_NS, "made")

    def chair_pixels(self, tracker: Tracker, x: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns a chair's pixels in the reduced image, and the depths in metres with and without it."""
        working = tracker._mounting.camera
        with_chair, without = (
            working.reduce(self.frame(*things).depth) for things in (chair_at(x), tuple[Box, ...]())
        )
        pixels = (with_chair > 0) & (without - with_chair > 0.3)
        assert np.count_nonzero(pixels) > 300
        return pixels, with_chair, without


def differs(background: np.ndarray, depth: np.ndarray, pixels: np.ndarray) -> float:
    """Returns the median difference in metres between the background and a depth image."""
    return float(np.median(np.abs(background - depth)[pixels]))


@pytest.mark.slow
def test_moved_chair_is_background_at_its_new_place():
    """Four seconds are enough, in which the tracker rules out that the chair is a person, as after a start.

    Without the request, an added object stays foreground for 15 s.
    """
    camera, tracker = Camera(), Tracker()
    for _ in range(2 * HALF_SECOND):
        tracker.track(camera.frame(*chair_at(-0.8)))
    for _ in range(8 * HALF_SECOND):
        tracker.track(camera.frame(*chair_at(0.4)))
    pixels, with_chair, room = camera.chair_pixels(tracker, 0.4)
    assert differs(tracker.background, room, pixels) < 0.05
    tracker.learn_room()
    for _ in range(8 * HALF_SECOND):
        tracker.track(camera.frame(*chair_at(0.4)))
    assert differs(tracker.background, with_chair, pixels) < 0.05
    left, _, room = camera.chair_pixels(tracker, -0.8)
    assert differs(tracker.background, room, left) < 0.05


@pytest.mark.slow
def test_performer_keeps_the_number_and_is_not_learnt():
    tracker = Tracker()
    with SyntheticSensor(choreography="wave", width=320, realtime=False) as sensor:
        for _ in range(2 * HALF_SECOND):
            before = tracker.track(sensor.read())
        tracker.learn_room()
        for _ in range(2 * HALF_SECOND):
            after = tracker.track(sensor.read())
        (body,), truth = after, sensor.truth(sensor.read().time_ns)
    assert [body.id] == [each.id for each in before]
    assert np.linalg.norm(body.joints - truth.joints, axis=1).mean() < 0.08


@pytest.mark.slow
def test_another_floor_is_found_again_only_on_request():
    """Before the request, the known pose stays, although the camera is 0.4 m higher."""
    low, high, mounting = Camera(0.9), Camera(1.3), Mounting(SceneSettings())
    for _ in range(3):
        mounting.view(low.frame(), no_people=True)
    assert mounting.is_floor_known
    new_places = []
    for number in range(12 * HALF_SECOND):
        if number == 6 * HALF_SECOND:
            assert mounting.world_from_camera[1, 3] == pytest.approx(0.9, abs=0.04)
            mounting.search_floor_again()
        mounting.view(high.frame(), no_people=True)
        new_places += [number] * mounting.has_new_pose
    assert mounting.world_from_camera[1, 3] == pytest.approx(1.3, abs=0.04)
    assert len(new_places) == 1, "the room is learnt once for the new floor"


@pytest.mark.slow
def test_same_floor_keeps_the_pose():
    camera, mounting = Camera(), Mounting(SceneSettings())
    mounting.view(camera.frame(), no_people=True)
    before = mounting.world_from_camera
    mounting.search_floor_again()
    for _ in range(4 * HALF_SECOND):
        mounting.view(camera.frame(), no_people=True)
        assert not mounting.has_new_pose
    np.testing.assert_array_equal(mounting.world_from_camera, before)


def test_sensor_that_tracks_people_itself_has_no_room():
    tracker = Tracker()
    tracker.track(BodyFrame([], 0, "suit", np.eye(4), 0))
    with pytest.raises(InputError, match="learns no room"):
        tracker.learn_room()
