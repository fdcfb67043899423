"""Tests of a puppet's locomotion: the anchor does not slide, jumps leave the floor, noise does not."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.cactus_puppet import cactus_project
from tolerances import assert_alike

from enliven.document.locomotion import LocomotionSettings, Switch
from enliven.examples.puppet_motion import PuppetState
from enliven.examples.spacetime.locomotion import place_motion
from enliven.examples.travel import PuppetTravel
from enliven.person.joints import Joint
from enliven_edge.stage.puppet.locomotion import EITHER_FOOT, FootDetector, Footing, Locomotion
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings

sys.path.insert(0, str(Path(__file__).parent))

from people_for_puppets import FRAME, person

STEP = 1 / 60
REST = np.array([[0.0, 1.0, 0.0], [0.2, 0.02, 0.0], [-0.2, 0.02, 0.0]])
FEET = (1, 2)
STEPS = PuppetTravel(FEET, 1.0 + 0.0j)
PROJECT = cactus_project(0.05)
PUPPET = PROJECT.puppet("cactus")
SOLES = [1 + k for k, point in enumerate(PUPPET.points) if point.foot]


def walked(frames: int = 120, stride: float = 0.3) -> np.ndarray:
    """Returns (F, 3, 3) a head and two feet that step forward in turn. The moving foot is lifted."""
    phase = 2 * np.pi * np.arange(frames) / 60
    places = np.tile(REST, (frames, 1, 1))
    for foot, shift in ((1, 0.0), (2, np.pi)):
        places[:, foot, 2] += stride * np.sin(phase + shift)
        places[:, foot, 1] += 0.15 * np.maximum(np.cos(phase + shift), 0.0)
    return places


def gone(places: np.ndarray, yaw=None, footings=None, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Returns (F, 3) root positions and (F,) anchor feet."""
    way = Locomotion(REST, FEET, STEP, LocomotionSettings(leash=1000.0), travel=STEPS)
    way.begin(np.zeros(3), 0j)
    roots, anchors = [], []
    for f, at in enumerate(places):
        footing = Footing() if footings is None else footings[f]
        roots.append(way.step(at, 0.0 if yaw is None else yaw[f], footing, size, 0j)[1])
        anchors.append(way.anchor)
    return np.array(roots), np.array(anchors)


def test_anchor_foot_does_not_slide_while_puppet_advances() -> None:
    places = walked()
    roots, anchors = gone(places)
    world = places + roots[:, None]
    for f in range(1, len(places)):
        before, now = world[f - 1, anchors[f]], world[f, anchors[f]]
        np.testing.assert_allclose(now[[0, 2]], before[[0, 2]], atol=1e-9)
    assert roots[-1, 2] > 0.8
    np.testing.assert_allclose(world[:, list(FEET), 1].min(1), 0.02, atol=1e-9)


def test_live_locomotion_equals_the_whole_take_on_the_ground() -> None:
    places, yaw = walked(), np.linspace(0.0, 1.5, 120)
    roots, anchors = gone(places, yaw)
    whole = place_motion(places, yaw, STEP, (Switch(0, "contact"),), FEET)
    assert_alike(anchors, whole.anchors)
    np.testing.assert_allclose(roots[:, [0, 2]], whole.root[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(roots[:, 1], whole.root[:, 1] + 0.02, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.05, 0.5), st.floats(0.0, 0.3), st.integers(5, 40))
def test_flight_keeps_take_off_velocity_and_performer_height(stride: float, lift: float, frames: int) -> None:
    places = walked(60 + frames, stride)
    footings = [Footing()] * 60 + [Footing(False, lift)] * frames
    roots, anchors = gone(places, footings=footings, size=2.0)
    assert (anchors[60:] == -1).all()
    flown = np.diff(roots[60:, [0, 2]], axis=0)
    np.testing.assert_allclose(flown - flown[0], 0.0, atol=1e-9)
    np.testing.assert_allclose((places[60:, 1:, 1].min(1) + roots[60:, 1]), 0.02 + 2.0 * lift, atol=1e-9)
    earlier = roots[59] - roots[53]
    np.testing.assert_allclose(flown[0], earlier[[0, 2]] / 6, atol=1e-9)


@settings(max_examples=6, deadline=None)
@given(st.floats(-np.pi, np.pi), st.sampled_from([FEET, ()]), st.floats(0.0, 1.2))
def test_puppet_stays_near_its_performers_path(turn: float, feet: tuple[int, ...], speed: float) -> None:
    """Its own steps would move it 4 m away; its performer sways on the spot or walks anywhere."""
    places = walked(720)
    t = np.arange(len(places)) * STEP
    path = np.exp(1j * turn) * (speed * t + 0.02 * np.sin(6 * t))
    how = LocomotionSettings()
    go = Locomotion(REST, FEET, STEP, how, [EITHER_FOOT, EITHER_FOOT], PuppetTravel(feet, 1.0 + 0.0j))
    go.begin(np.zeros(3), complex(path[0]))
    each = zip(places, path, strict=True)
    roots = np.array([go.step(at, turn, Footing(), 1.0, complex(to))[1] for at, to in each])
    size = float(np.linalg.norm(np.ptp(REST, axis=0)))
    off = np.abs(roots[:, 0] + 1j * roots[:, 2] - (path - path[0]))
    assert off.max() < 2 * how.leash * size + (1e-9 if feet else 0.2 * speed + 0.2)
    if not feet:
        assert off.max() < how.leash * size + 0.02 * speed + 0.02


def test_a_foot_that_stands_stays_where_it_is_while_the_puppet_is_drawn_back() -> None:
    places = walked(120)
    go = Locomotion(REST, FEET, STEP, LocomotionSettings(), travel=STEPS)
    go.begin(np.zeros(3), 0j)
    world, anchors, roots = [], [], []
    own = gone(places)[0][:, 2] @ np.arange(120) / (np.arange(120) @ np.arange(120))
    for frame, at in enumerate(places):
        at, root = go.step(at, 0.0, Footing(), 1.0, 0.95j * own * frame)
        world.append(at + root)
        anchors.append(go.anchor)
        roots.append(root)
    world, anchors = np.array(world), np.array(anchors)
    same = np.flatnonzero(anchors[1:] == anchors[:-1])
    moved = world[same + 1, anchors[same]] - world[same, anchors[same]]
    assert np.quantile(np.abs(moved[:, [0, 2]]).max(1), 0.95) < 1e-9
    assert roots[-1][2] < gone(places)[0][-1, 2] - 0.02


def test_fixed_root_stays_and_footless_puppet_follows() -> None:
    still = Locomotion(REST, (), STEP, LocomotionSettings())
    still.begin(np.array([1.0, 0.0, 2.0]), 0j)
    assert not still.can_step
    at, root = still.step(REST + 1.0, 2.0, Footing(False, 1.0), 1.0, 3.0 + 0.0j)
    np.testing.assert_array_equal(root, [1.0, 0.0, 2.0])
    np.testing.assert_array_equal(at, REST + 1.0)
    swims = Locomotion(REST, (), STEP, LocomotionSettings(leash=0.0), travel=PuppetTravel((), 1.0 + 0.0j))
    swims.begin(np.array([1.0, 0.0, 2.0]), 5j)
    for _ in range(60):
        at, root = swims.step(REST, 0.0, Footing(), 1.0, 3.0 + 5j)
    np.testing.assert_allclose(root, [4.0, 0.0, 2.0], atol=1e-6)
    assert_alike(swims.compute_feet_centre(PuppetState(at, 0.0, root)), root)


def test_only_visibly_lifted_feet_count_as_airborne() -> None:
    feet = FootDetector()
    assert feet.update(person(), 0.0).touches
    assert feet.update(person(up=0.02), STEP).touches
    up = feet.update(person(up=0.25), STEP)
    assert not up.touches
    assert 0.08 < up.lift < 0.25 / 1.75
    body = person(up=0.25, knees=(0.0, 0.9))
    assert not feet.update(body, STEP).touches
    body.confidence[[Joint.FOOT_LEFT, Joint.ANKLE_LEFT]] = 0.0
    assert feet.update(body, STEP).touches
    sure = replace(person(up=0.25), contacts=np.array([0.9, 0.0]))
    assert feet.update(sure, STEP).touches
    assert feet.update(person(knees=(1.2, 0.0)), STEP).touches


def test_small_floor_error_does_not_lift_the_puppet() -> None:
    feet = FootDetector()
    assert all(feet.update(person(up=0.12), STEP).touches for _ in range(30))
    lost = person()
    lost.joints[:] = np.nan
    lost.confidence[:] = 0.0
    assert feet.update(lost, STEP).touches


def jumped(jump: float = 1.0) -> np.ndarray:
    """Returns (F,) heights in metres of the cactus's lower sole while its performer jumps by 0.3 m."""
    actor = PuppetActor(PROJECT, PUPPET, PuppetSettings(fade=0.0, meet=False, jump=jump))
    heights = []
    for f in range(110):
        seconds = f / 30
        up = max(0.3 - 4.9 * (seconds - 2.0) ** 2, 0.0)
        rng = np.random.default_rng(f)
        noise = rng.normal(0.0, 0.002, (20, 3))
        body = replace(person(), joints=person(up=up).joints + noise)
        pose = actor.perform([body], (f + 1) * FRAME)
        if f == 1:
            actor.possess(body)
        heights.append(pose.positions[SOLES, 1].min())
    return np.array(heights)


def test_puppet_jumps_with_performer_scaled_to_its_size() -> None:
    heights = jumped()
    size = float(np.ptp(PUPPET.mesh.vertices[:, 1]))
    assert heights[5:50].max() < 0.01
    assert 0.6 * 0.3 * size / 1.75 < heights.max() < 1.1 * 0.3 * size / 1.75
    assert 58 < heights.argmax() < 70
    assert heights[80:].max() < 0.01
    assert np.abs(np.diff(heights)).max() < 0.1
    assert jumped(jump=0.0).max() < 0.01


@pytest.mark.slow
def test_the_cactus_waddles_and_its_standing_foot_does_not_slide() -> None:
    actor = PuppetActor(PROJECT, PUPPET, PuppetSettings(fade=0.0, meet=False))
    poses = []
    for f in range(240):
        lift = 0.9 * np.sin(2 * np.pi * f / 60)
        body = person(knees=(max(lift, 0.0), max(-lift, 0.0)), yaw=0.01 * f)
        poses.append(actor.perform([body], (f + 1) * FRAME).positions)
        if f == 1:
            actor.possess(body)
    at = np.array(poses)[30:, SOLES]
    speeds = np.linalg.norm(np.diff(at[..., [0, 2]], axis=0), axis=2) * 30
    assert np.percentile(speeds.min(1), 95) < 0.01  # the performer stands still in these frames
    assert np.median(speeds.max(1)) > 0.05
    assert at[:, :, 1].max() > 0.05
    assert np.isfinite(at).all()


@pytest.mark.parametrize("contact", [(0.0, 0.0), (1.0, 1.0)])
def test_tracker_contacts_alone_never_lift_the_puppet(contact: tuple[float, float]) -> None:
    feet = FootDetector()
    body = replace(person(), contacts=np.array(contact))
    assert all(feet.update(body, STEP).touches for _ in range(10))
