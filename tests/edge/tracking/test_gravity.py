"""Tests that the floor determines gravity for any mounting: tilted by 40 degrees, or upside down."""

import dataclasses

import numpy as np
import pytest

from enliven.camera import pixel_rays, unproject_depth, world_from_level_camera
from enliven.frames import DepthFrame
from enliven.person.joints import Joint
from enliven_edge.tracking.settings import SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor


def turned(frame: DepthFrame) -> DepthFrame:
    """Returns the frame of the same sensor mounted upside down, with the image rotated by 180 degrees."""
    camera = frame.intrinsics
    turned_camera = dataclasses.replace(
        camera, cx=camera.width - 1 - camera.cx, cy=camera.height - 1 - camera.cy
    )
    depth = np.ascontiguousarray(frame.depth[::-1, ::-1])
    return dataclasses.replace(frame, depth=depth, intrinsics=turned_camera)


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize(
    ("tilt", "height", "choreography"),
    [(0.0, 1.2, "idle"), (10.0, 1.5, "walk"), (20.0, 1.9, "idle"), (30.0, 2.5, "idle"), (40.0, 2.9, "walk")],
)
def test_gravity_comes_from_the_floor(tilt, height, choreography, upside_down):
    tracker = Tracker(TrackerSettings(scene=SceneSettings(upside_down=upside_down)))
    with SyntheticSensor(
        choreography=choreography, width=320, realtime=False, camera_tilt=tilt, camera_height=height
    ) as sensor:
        for _ in range(12):
            frame = sensor.read()
            truth, mount = sensor.truth(frame.time_ns), frame.world_from_camera
            frame = dataclasses.replace(frame, world_from_camera=None)
            bodies = tracker.track(turned(frame) if upside_down else frame)
    mounting = tracker.world_from_camera
    up = mount[1, :3] * (np.array([-1.0, -1.0, 1.0]) if upside_down else 1.0)
    assert np.rad2deg(np.arccos(np.clip(mounting[1, :3] @ up, -1, 1))) < 3.0
    assert mounting[1, 3] == pytest.approx(height, abs=0.08)
    (body,) = bodies
    assert body.joints[Joint.HEAD, 1] > body.joints[Joint.HIP_CENTER, 1] + 0.4
    assert body.joints[Joint.HEAD, 1] == pytest.approx(truth.joints[Joint.HEAD, 1], abs=0.15)
    away = body.joints[:, [0, 2]] - truth.joints[:, [0, 2]]
    assert np.linalg.norm(away[Joint.HIP_CENTER]) < 0.2


def frames_of(tilt: float, count: int, *, floor: bool):
    """Returns frames of a tilted sensor with its true pose; optionally without a visible floor."""
    with SyntheticSensor(choreography="idle", width=320, realtime=False, camera_tilt=tilt) as sensor:
        for _ in range(count):
            frame = sensor.read()
            mount, depth = frame.world_from_camera, frame.depth.copy()
            if not floor:
                points = unproject_depth(depth, pixel_rays(frame.intrinsics)) @ mount[:3, :3].T + mount[:3, 3]
                depth[points[..., 1] < 0.15] = 0
            yield dataclasses.replace(frame, depth=depth, world_from_camera=None), mount


@pytest.mark.parametrize("tilt", [3.0, 25.0])
def test_without_visible_floor_gravity_comes_from_the_accelerometer(tilt):
    """The height is that of the settings. The settings' tilt would be completely wrong."""
    tracker = Tracker()
    for frame, mount in frames_of(tilt, 1, floor=False):
        tracker.down = -mount[1, :3]
        tracker.track(frame)
        np.testing.assert_allclose(tracker.world_from_camera[1, :3], mount[1, :3], atol=1e-9)
    assert not tracker.state.floor_known


@pytest.mark.parametrize("off", [0.0, 3.0, 20.0])
def test_a_floor_is_believed_where_the_accelerometer_agrees(off):
    """They may differ by the accelerometer's bias of some degrees. A plane that is 20 degrees off is a ramp
    or a table.
    """
    tracker = Tracker()
    for frame, mount in frames_of(10.0, 1, floor=True):
        turn = world_from_level_camera(0.0, np.deg2rad(off))[:3, :3] @ np.diag([1.0, -1.0, -1.0])
        tracker.down = turn.T @ -mount[1, :3]
        tracker.track(frame)
    assert tracker.state.floor_known == (off < 8.0)
    if off < 8.0:
        np.testing.assert_allclose(tracker.world_from_camera[1, :3], mount[1, :3], atol=0.01)
