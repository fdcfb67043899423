"""Tests that without a visible floor, the sensor height follows from body proportions, and people stand on
the floor.
"""

from __future__ import annotations

import numpy as np
import pytest

from enliven.camera import world_from_level_camera
from enliven_edge.tracking.settings import SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.body.performer import Proportions

HEIGHT, TILT = 1.1, np.deg2rad(-10)
"""Sensor height above the floor in metres and tilt in radians. It looks up, so the floor is not in view."""
FRAMES = 12
TOLERANCE = 0.12
"""Maximum error of a height estimated from proportions, metres."""


@pytest.fixture
def film(stagecraft):
    """Returns a function that renders frames of a person of a height, visible from the thighs up."""

    def render(height: float):
        s = stagecraft
        mount = world_from_level_camera(HEIGHT, TILT)
        player = s.Player(s.still(0.0, -1.9), "wave", Proportions(height))
        playground = s.Playground(player, mount=lambda _: mount, told=False)
        return [playground.frame(i / 30) for i in range(FRAMES)]

    return render


@pytest.mark.parametrize("height", [1.58, 1.75, 1.88])
def test_height_without_floor_is_by_proportions(film, height):
    """This holds in every frame. No body height is published, since none was measured."""
    tracker = Tracker()
    for frame in film(height):
        (body,) = tracker.track(frame)
        assert not tracker.state.floor_known
        assert body.stature is None
        assert abs(body.height - height) < TOLERANCE
        assert abs(tracker.posture.lowest) < TOLERANCE


def test_person_keeps_the_place_in_the_image_when_the_guess_changes(film):
    """The sensor and the body move up together."""
    tracker, seen = Tracker(), []
    for frame in film(1.75):
        (body,) = tracker.track(frame)
        camera_from_world = np.linalg.inv(tracker.world_from_camera)
        seen.append(body.joints[:4] @ camera_from_world[:3, :3].T + camera_from_world[:3, 3])
    assert np.abs(np.diff(seen, axis=0)).max() < 0.02


def test_stated_height_of_the_sensor_is_kept(film):
    tracker = Tracker(TrackerSettings(scene=SceneSettings(height=1.3)))
    for frame in film(1.75):
        tracker.track(frame)
    assert tracker.world_from_camera[1, 3] == pytest.approx(1.3)


def test_stature_is_measured_where_the_floor_is_seen(stagecraft):
    s = stagecraft
    playground = s.Playground(s.Player(s.still(0.0, -2.8), "idle"), told=False)
    tracker = Tracker()
    for i in range(FRAMES):
        (body,) = tracker.track(playground.frame(i / 30))
    assert tracker.state.floor_known
    assert body.stature == pytest.approx(Proportions().height, abs=TOLERANCE)
