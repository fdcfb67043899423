"""Tests that pixels near a body are assigned by distance alone, and are recovered from the background."""

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven.person.joints import Joint
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor

CAMERA = WorkingCamera(Intrinsics(80, 60, 66, 66, 39.5, 29.5), 80)
MOUNT = world_from_level_camera(1.2)
LOWER_LEGS = [Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT]


def view_of(z):
    return FrameView(0, z, world_points(z, CAMERA.ray, MOUNT), CAMERA, MOUNT)


def person(x, z=-2.5, **pose):
    return Posture(np.array([x, 0.95, z]), standing_pose(0.0, **pose), lengths_for_height(1.75))


def surface_distance(points, postures):
    """Returns (h, w) distances to the nearest of all capsules in metres. Slow reference."""
    ends, radii = (np.concatenate(x) for x in zip(*(p.capsules() for p in postures), strict=True))
    a, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    away = points[..., None, :] - a
    t = np.clip((away * along).sum(-1) / (along * along).sum(-1), 0, 1)
    to_axis = np.linalg.norm(away - t[..., None] * along, axis=-1)
    return (to_axis - radii[:, 0] - t * (radii[:, 1] - radii[:, 0])).min(-1)


@given(st.integers(0, 1000), st.floats(0.03, 0.3), st.floats(-0.1, 1.0), st.integers(1, 3))
@example(3, 0.28515625, 0.0, 3)  # a limb at the image's border has a larger maximum distance
@settings(max_examples=20, deadline=None)
def test_points_near_a_body_and_above_the_floor_belong_to_it(seed, reach, above, people):
    random = np.random.default_rng(seed)
    z = np.clip(2.4 + 0.2 * random.standard_normal((60, 80)), 1.0, 4.0)
    z[random.random(z.shape) < 0.2] = 0.0
    view = view_of(z)
    postures = [person(x, arm_raise=float(random.uniform(0.0, 1.5))) for x in random.uniform(-1, 1, people)]
    near_body = pixels_near_bodies(view, postures, above, reach)
    distance = surface_distance(view.points, postures)
    clear = np.abs(distance - reach) > 1e-6  # float32 capsules
    expected = (z > 0) & (view.points[..., 1] > above) & (distance < reach)
    np.testing.assert_array_equal(near_body[clear], expected[clear])
    assert near_body.any()


def test_unmeasured_pixels_belong_to_no_body():
    view = view_of(np.zeros((60, 80)))
    at_the_lens = Posture(MOUNT[:3, 3].copy(), standing_pose(), lengths_for_height(1.75))
    assert (surface_distance(view.points, [at_the_lens]) < 0.05).all()
    assert not pixels_near_bodies(view, [at_the_lens], 0.0, 0.05).any()


def with_hole_across_the_shins(choreography, frames, holed, high):
    """Returns [(frame, truth)] of a person who is present from the start. At first, a hole separates the
    shins.

    Args:
        holed: the number of frames with the hole.
        high: (2,) lower and upper end of the hole above the floor, metres.
    """
    recording = []
    with SyntheticSensor(choreography=choreography, width=320, realtime=False) as sensor:
        for i in range(frames):
            frame = sensor.read()
            truth, depth = sensor.truth(frame.time_ns), frame.depth.copy()
            ankle, camera = truth.joints[Joint.ANKLE_LEFT], frame.intrinsics
            at = (
                np.array([[ankle[0], y, ankle[2], 1.0] for y in high])
                @ np.linalg.inv(frame.world_from_camera).T
            )
            bottom, top = (camera.fy * at[:, 1] / at[:, 2] + camera.cy).astype(int)
            if i < holed:
                depth[top:bottom] = 0
            recording.append((dataclasses.replace(frame, depth=depth, world_from_camera=None), truth))
    return recording


@pytest.mark.slow
@pytest.mark.parametrize(
    ("choreography", "holed", "high"),
    [("idle", 3, (0.3, 0.45)), ("idle", 12, (0.35, 0.5)), ("wave", 6, (0.38, 0.55))],
)
def test_person_present_at_the_start_gets_their_legs_back(choreography, holed, high):
    """The legs below the hole are not connected to a person, so the background model learns them at once."""
    tracker, recording = Tracker(), with_hole_across_the_shins(choreography, 34, holed, high)
    for n, (frame, _) in enumerate(recording):
        bodies = tracker.track(frame)
        assert len(bodies) == 1 or n < 6, "nobody a fifth of a second after the first frame"
    (body,) = bodies
    off = np.linalg.norm(body.joints - recording[-1][1].joints, axis=1)[LOWER_LEGS]
    assert off.max() < 0.1
