"""Tests that a mesh of human build keeps its performer's heading, however the performer turns."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_bodies import BODIES, t_woman
from turning_people import deviations_deg, headings_on_stage, hip_heading, spinning_people, wrapped

from enliven.meshes import Mesh
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.possession import ActorSettings
from enliven.possession.attachment.limb_retargeting import LimbRetargeting
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.possession.likeness.standing_person import make_standing_figure
from enliven.possession.placement import rotation_about_y
from enliven_edge.stage.character_setup import create_actor, create_mesh_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model.posture import rotation

MAX_DEVIATION_DEG = 10.0
"""Maximum deviation of the mesh's hips from their performer's heading, degrees."""
FRAME_NS = 33_333_333
SEEDS = st.integers(0, 2**32 - 1)
NOISE_M = st.sampled_from([0.0, 0.004])
"""Joint noise in metres: none, or that of a depth camera."""


@pytest.fixture(scope="module")
def woman() -> Mesh:
    return t_woman().mesh


def facing(yaw: float, x: float = 0.0, lift: float = 0.0) -> Body:
    """Returns a standing performer, rotated about +Y by ``yaw``, with the left thigh lifted by ``lift``,
    radians.
    """
    joints = make_standing_figure()
    leg = [Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT]
    hip = joints[Joint.HIP_LEFT].copy()
    joints[leg] = hip + (joints[leg] - hip) @ rotation(x=-lift).T
    return Body(1, joints @ rotation_about_y(yaw).T + [x, 0.0, -2.7], np.ones(20), stature=1.75)


@pytest.mark.slow
@given(SEEDS, NOISE_M, st.floats(-np.pi, np.pi), st.floats(0.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_carried_hips_differ_from_the_performers_by_a_constant(seed, noise_m, front, seconds):
    """True from the first frame on, while the limbs are still approaching the performer's pose."""
    rest = make_standing_figure()
    rest[[Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT], 1] = (
        1.39  # a lifted arm, which must come down
    )
    film = spinning_people(seed, 4.0, noise_m)
    start = hip_heading(film[0].joints)
    like = BodyInMesh.from_joints(rest)
    carrying = LimbRetargeting(like, film[0], 1.0, seconds=seconds, front=start)
    gaps = []
    for n, body in enumerate(film):
        carrying.set_time(n * FRAME_NS)
        gaps.append(wrapped(hip_heading(carrying(body.joints)) - hip_heading(body.joints)))
    assert deviations_deg(np.array(gaps)).max() < MAX_DEVIATION_DEG
    # A mesh with another heading has turned to its performer when it has reached the pose.
    late = LimbRetargeting(like, film[0], 1.0, seconds=seconds, front=front)
    late.set_time(0)
    late.set_time(round(1e9 * late._seconds) + 1)
    there = hip_heading(late(film[-1].joints)) + front
    assert abs(np.degrees(wrapped(there - hip_heading(film[-1].joints)))) < MAX_DEVIATION_DEG


@pytest.mark.slow
@pytest.mark.parametrize("how", ["mapped", "inside"])
@given(SEEDS, NOISE_M, st.integers(0, 120))
@settings(max_examples=6, deadline=None)
def test_hips_of_the_mesh_keep_their_performers_heading(woman, how, seed, noise_m, held_from):
    """On the stage: before, during and after attachment, at any moment."""
    actor = create_mesh_actor(woman, "it", 128, ActorSettings(how=how))
    gaps, _ = headings_on_stage(actor, spinning_people(seed, 6.0, noise_m), held_from)
    assert deviations_deg(gaps).max() < MAX_DEVIATION_DEG


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sitting", "robot", "teddy", "holed scan"])
def test_other_bodies_keep_their_performers_heading(name):
    actor = create_mesh_actor(BODIES[name]().mesh, "it", 128, ActorSettings(how="mapped"))
    gaps, _ = headings_on_stage(actor, spinning_people(7, 6.0, 0.004), 60)
    assert deviations_deg(gaps).max() < MAX_DEVIATION_DEG


@pytest.mark.slow
@pytest.mark.parametrize("how", ["mapped", "inside"])
def test_holding_again_does_not_turn_the_mesh(woman, how):
    """A performer that is attached repeatedly while spinning keeps the same relative heading."""
    film, actor = spinning_people(3, 6.0), create_mesh_actor(woman, "it", 128, ActorSettings(how=how))
    stage, facing = Stage([actor]), []
    for n, body in enumerate(film):
        pose = stage.perform([body], n * FRAME_NS)[0]
        turn = pose.linear.astype(np.float64).mean(0)
        facing.append(np.arctan2(turn[0, 2] - turn[2, 0], turn[0, 0] + turn[2, 2]))
        if n % 20 == 10:
            stage.possess("it")
    gaps = wrapped(np.array(facing) - [hip_heading(body.joints) for body in film])
    # The mean rotation of all nodes: arms and legs swing relative to it.
    assert deviations_deg(gaps).max() < 1.5 * MAX_DEVIATION_DEG


@pytest.mark.slow
def test_mesh_without_legs_turns_with_its_performer():
    """Without hips, no line defines a heading. Without the correction, a lamp lagged by 29 degrees."""
    actor = create_actor("lamp", 128, ActorSettings(how="mapped"))
    assert actor.likeness is not None and np.isnan(actor.likeness.joints[Joint.HIP_LEFT]).all()
    gaps, _ = headings_on_stage(actor, [facing(0.05 * n) for n in range(240)], 0)
    assert deviations_deg(gaps[1:]).max() < 3.0


@pytest.mark.slow
def test_holding_again_holds_the_same_limbs():
    """A chair that has turned with its performer is attached again. Each limb gets the same chair leg as
    before.
    """
    still = [facing(min(0.05 * n, 1.5), x=min(0.02 * n, 0.6)) for n in range(60)]
    lifting = [facing(1.5, x=0.6, lift=min(0.04 * n, 0.8)) for n in range(60)]
    poses = []
    for again in (False, True):
        stage = Stage([create_actor("chair", 128, ActorSettings(how="mapped"))])
        for n, body in enumerate([*still, *lifting]):
            pose = stage.perform([body], n * FRAME_NS)[0]
            if n == 0 or (again and n == len(still) - 1):
                stage.possess("chair")
        poses.append(pose.positions)
    assert np.linalg.norm(poses[1] - poses[0], axis=1).max() < 0.03


@pytest.mark.parametrize("how", ["mapped", "inside"])
@pytest.mark.parametrize("held_from", [0, 40])
def test_a_human_mesh_appears_at_its_performer_at_once(woman, how, held_from):
    """Before anybody is in view, the mesh stands at the sensor. It does not glide from there to the
    performer.
    """
    own = ActorSettings(how=how)
    actor = create_mesh_actor(woman, "it", 128, own)
    film = [facing(0.4)] * 60
    _, places = headings_on_stage(actor, film, held_from)
    apart = np.linalg.norm((places - film[0].joints[Joint.HIP_CENTER])[:, [0, 2]], axis=1)
    assert np.abs(apart - (own.aside if how == "mapped" else 0.0)).max() < 0.12


@pytest.mark.parametrize("held", [True, False])
def test_mesh_turns_to_a_returning_performer_without_a_jump(woman, held):
    """The performer is lost, turns while invisible, and returns. The mesh turns no faster than a fade
    allows.
    """
    own = ActorSettings(how="mapped")
    stage = Stage([create_mesh_actor(woman, "it", 128, own)])
    stage.perform([facing(0.0)], 0)
    if held:
        stage.possess("it")
    shown = [stage.perform([facing(0.0)], n * FRAME_NS)[0] for n in range(1, 60)]
    shown += [stage.perform([], n * FRAME_NS)[0] for n in range(60, 90)]
    shown += [stage.perform([facing(2.5)], n * FRAME_NS)[0] for n in range(90, 200)]
    steps = [np.linalg.norm(b.positions - a.positions, axis=1).max() for a, b in pairwise(shown)]
    assert max(steps) < 2.0 * own.fade_pace * FRAME_NS * 1e-9
    turn = shown[-1].linear.astype(np.float64).mean(0)
    there = np.arctan2(turn[0, 2] - turn[2, 0], turn[0, 0] + turn[2, 2])
    assert abs(np.degrees(wrapped(there - 2.5))) < MAX_DEVIATION_DEG
