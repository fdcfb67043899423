"""Tests of real meshes that are possessed from next to them by real turning people: each limb follows its own
limb.
"""

import functools
import os
from pathlib import Path

import numpy as np
import pytest
from turning_people import FRAME_RATE_HZ, deviations_deg, headings_on_stage, hip_heading

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.possession import ActorSettings
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
PEOPLE = ("humanoids/quaternius_worker_woman.glb", "meshes/*/humanoid.off", "meshes/*/human_man.obj")
TURNS = {
    "bvh/other/pymo_AV_8Walk_Meredith.bvh": 270,
    "bvh/cmu_mirrors/01_01.bvh": 185,
    "bvh/cmu_mirrors/Boxing_Toes.bvh": 120,
    "cmu_expmap/train_directing_traffic_4.txt": 55,
}
"""Recorded motions, and the minimum angle between two headings of their hips, degrees."""
MAX_SECONDS = 14.0
"""Maximum duration of a motion in seconds, long enough for half a turn."""
BEASTS = ("libigl/horse_quad.obj", "common3d/cow.obj", "libigl/camel_b.obj")
MESHES = DATA / "meshes"
FRAME = 33_333_333

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not MESHES.exists(), reason=f"no real meshes in {DATA} (set ENLIVEN_DATA)"),
]


def person(reach=0.0) -> Body:
    """Returns a standing person with hanging arms. The right arm is raised forward by ``reach`` radians."""
    rotations = standing_pose(arm_forward=0.1, elbow=0.1)
    rotations[model.UPPER_ARM_R] = rotation(x=-reach) @ rotations[model.UPPER_ARM_R]
    joints = Posture(np.array([0.0, 1.0, -2.5]), rotations, model.lengths_for_height(1.75)).joints()
    return Body(1, joints, np.ones(20), stature=1.75)


@pytest.mark.parametrize("name", BEASTS)
def test_on_four_feet_arms_are_forelegs(name):
    actor = create_actor(str(MESHES / name), 128, ActorSettings(how="mapped"))
    like, graph = actor.likeness, actor.graph
    ahead = np.array([np.sin(like.yaw), 0.0, np.cos(like.yaw)])
    left = np.array([np.cos(like.yaw), 0.0, -np.sin(like.yaw)])
    hands, feet = (like.joints[[j, j + 4]] for j in (Joint.HAND_LEFT, Joint.FOOT_LEFT))
    low, tall = graph.positions[:, 1].min(), np.ptp(graph.positions[:, 1])
    assert max(hands[:, 1].max(), feet[:, 1].max()) < low + 0.2 * tall
    assert (hands @ ahead).min() > (feet @ ahead).max() + 0.3 * tall
    assert all((pair[0] - pair[1]) @ left > 0 for pair in (hands, feet))
    assert (like.joints[Joint.HEAD] - like.joints[Joint.HIP_CENTER]) @ ahead > 0.3 * tall


@pytest.mark.parametrize("name", BEASTS)
def test_a_raised_arm_raises_a_foreleg_and_no_other(name):
    actor = create_actor(str(MESHES / name), 128, ActorSettings(how="mapped", fade=0.0))
    (key,) = (stage := Stage([actor])).actors
    stage.perform([person()], 0)
    stage.possess(key)
    still = stage.perform([person()], FRAME)[0]
    for i in range(26):
        pose = stage.perform([person(0.8 * i / 25)], (i + 2) * FRAME)[0]
    moved = np.linalg.norm(pose.positions - still.positions, axis=1)
    joints = actor.likeness.joints
    apart = np.linalg.norm(actor.graph.positions[:, None] - joints, axis=2)
    at = {
        j: moved[apart[:, j].argmin()]
        for j in (Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT)
    }
    assert at[Joint.HAND_RIGHT] > 0.2
    assert max(value for joint, value in at.items() if joint != Joint.HAND_RIGHT) < 0.3 * at[Joint.HAND_RIGHT]


@functools.cache
def recorded(pattern: str) -> list[Body]:
    """Returns the bodies of a recorded motion at 30 frames per second, as one performer in front of the
    sensor.
    """
    paths = find_files([str(DATA / pattern)])
    read = (frame for frame in find_reader(paths).read(paths) if isinstance(frame, BodyFrame))
    frames = [frame for frame in read if frame.bodies]
    times = np.array([frame.time_ns for frame in frames]) * 1e-9
    count = int(min(times[-1] - times[0], MAX_SECONDS) * FRAME_RATE_HZ)
    chosen = [frames[int(np.abs(times - times[0] - n / FRAME_RATE_HZ).argmin())] for n in range(count)]
    height = chosen[0].bodies[0].height
    return [Body(1, frame.bodies[0].joints, np.ones(20), stature=height) for frame in chosen]


@pytest.mark.parametrize("how", ["mapped", "inside"])
@pytest.mark.parametrize("motion", TURNS)
@pytest.mark.parametrize("mesh", PEOPLE)
def test_human_meshes_keep_their_performers_heading(mesh, motion, how):
    """The performer is attached half-way through the motion, after having turned since first being
    detected.
    """
    film = recorded(motion)
    actor = create_actor(str(next(DATA.glob(mesh))), 128, ActorSettings(how=how))
    gaps, _ = headings_on_stage(actor, film, len(film) // 2)
    assert deviations_deg(gaps).max() < 10.0


def test_recorded_motions_turn_at_least_as_stated():
    for motion, degrees in TURNS.items():
        yaw = np.unwrap([hip_heading(body.joints) for body in recorded(motion)])
        assert np.degrees(np.ptp(yaw)) > degrees
