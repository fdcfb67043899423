"""Tests that real motions drive control points through a few key poses."""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.document.constraints import Coupling
from enliven.document.example_settings import ExampleSettings
from enliven.examples.live import LiveExamples
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import extract_performer_clip
from enliven.examples.poses import Examples
from enliven.examples.spacetime.locomotion import find_switches, place_motion
from enliven.examples.suggest import SuggestSettings, suggest_poses
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.capture_clip import clip_of_capture

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data")) / "cmu_expmap"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no CMU motions in {DATA} (set ENLIVEN_DATA)"),
]
JOINTS = ("LeftFoot", "RightFoot", "LeftHand", "RightHand", "Head", "Spine1")
SHARE = np.array([1.5, 0.7, 1.2])


def clip_of(name):
    return clip_of_capture(read_expmap(DATA / f"{name}.txt"), name)


def shown(poses, count):
    """Returns a wide, short creature that copies the performer, with key poses at the suggested times."""
    frames = list(suggest_poses(poses, SuggestSettings(most=count)).frames)
    return Examples(JOINTS, JOINTS, poses[frames], poses[frames] * SHARE), frames


def changes(places, step):
    """Returns the root mean square acceleration of positions, m/s^2."""
    return float(np.sqrt((np.diff(places, 2, axis=0) ** 2).sum(2).mean())) / step**2


@pytest.mark.parametrize(
    "name", ["train_directing_traffic_4", "test_walking_1", "train_running_1", "train_jumping_1"]
)
def test_a_motion_is_followed_smoothly(name):
    clip = clip_of(name)
    took = extract_performer_clip(clip, JOINTS)
    examples, frames = shown(took.poses, 8)
    exact = ExampleMap(examples, ExampleSettings(acceleration=0.0)).solve(took.poses, took.step)
    np.testing.assert_allclose(exact[frames], examples.targets, atol=1e-9)
    places = ExampleMap(examples).solve(took.poses, took.step)
    wanted = took.poses * SHARE
    assert changes(places[5:], took.step) < 1.2 * changes(wanted[5:], took.step)
    # Poses outside the eight key poses are within the range of bounded weights.
    spread = np.sqrt(((wanted - wanted.mean(0)) ** 2).sum(2).mean())
    assert np.sqrt(((places - wanted)[5:] ** 2).sum(2).mean()) < 0.6 * spread


def test_walkers_stay_on_the_floor_and_jumpers_leave_it():
    for name, flies in (("test_walking_1", False), ("train_jumping_1", True), ("train_running_1", True)):
        clip = clip_of(name)
        took = extract_performer_clip(clip, JOINTS)
        examples, _ = shown(took.poses, 8)
        places = ExampleMap(examples).solve(took.poses, took.step)
        switches = find_switches(took.world[:, :2], took.step, 0.9)
        assert any(switch.kind == "flight" for switch in switches) == flies, (name, switches)
        placed = place_motion(places, took.yaw, took.step, switches, [0, 1])
        if "running" in name:
            assert 3 <= sum(switch.kind == "flight" for switch in switches) <= 5
        assert placed.world[:, :2, 1].min() > -1e-9
        for f in np.flatnonzero((placed.anchors[1:] >= 0) & (placed.anchors[:-1] >= 0)) + 1:
            moved = placed.world[f, placed.anchors[f], ::2] - placed.world[f - 1, placed.anchors[f], ::2]
            assert np.abs(moved).max() < 1e-9
        # Its legs are as long as the performers' step length.
        far, theirs = (np.linalg.norm((way[-1] - way[5])[::2]) for way in (placed.root, took.root))
        assert 0.7 * theirs < far < 1.5 * theirs


def test_feet_are_level_where_the_anchor_changes():
    took = extract_performer_clip(clip_of("test_walking_1"), JOINTS)
    examples, _ = shown(took.poses, 8)
    mapping = ExampleMap(examples)
    placed = place_motion(
        mapping.solve(took.poses, took.step),
        took.yaw,
        took.step,
        find_switches(took.world[:, :2], took.step, 0.9),
        [0, 1],
    )
    couplings = placed.create_level_constraints(examples.points)
    assert couplings and all(isinstance(coupling, Coupling) for coupling in couplings)
    places = mapping.solve(took.poses, took.step, couplings)
    for coupling in couplings:
        a, b = examples.find_point(coupling.point), examples.find_point(coupling.other)
        assert abs(places[coupling.frame, a, 1] - places[coupling.frame, b, 1]) < 1e-9


def test_live_is_near_the_whole():
    took = extract_performer_clip(clip_of("test_walking_1"), JOINTS)
    poses, step = took.poses[5:600:4], took.step * 4
    examples, _ = shown(poses, 8)
    mapping = ExampleMap(examples)
    live = LiveExamples(mapping, step, lag=4)
    out = [place for pose in poses if (place := live.push(pose)) is not None]
    places = np.concatenate([np.array(out), live.finish()])
    assert np.sqrt(((places - mapping.solve(poses, step)) ** 2).sum(2)).max() < 0.03 * examples.target_size
