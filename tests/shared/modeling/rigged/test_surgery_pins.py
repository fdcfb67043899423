"""Tests of edits of a shape with pinned feet: pins move with their joints, and a cut rotates nothing."""

import numpy as np
import pytest
from surgery_worlds import angle

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.modeling.edits import copy_character
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import remove_node
from enliven.modeling.rigged.posed import compute_pose
from enliven.motion.contact.pin import pin_feet
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.motion.layers.retarget import bind_chain
from enliven.rotation import IDENTITY, from_rotation_vector

NAMES = ("hips", "hip L", "knee L", "ankle L", "hip R", "knee R", "ankle R")
LEFT = np.array([[0.1, 0.9, 0], [0.1, 0.48, 0.02], [0.1, 0.06, 0]])
WALKER = Skeleton(NAMES, [-1, 0, 1, 2, 0, 4, 5], np.concatenate([[[0, 0.95, 0]], LEFT, LEFT * [-1, 1, 1]]))


@pytest.fixture(scope="module")
def walker():
    """Returns two legs that swing on the spot. The left foot is pinned while it stands."""
    t = np.arange(61) / 30
    turns = np.tile(IDENTITY, (61, 7, 1))
    for hip, phase in ((1, 0.0), (4, np.pi)):
        swing, bend = 0.15 * np.sin(3 * t + phase), 0.3 + 0.2 * np.cos(3 * t + phase)
        turns[:, hip + 1] = from_rotation_vector(np.stack([-swing - bend, 0 * t, 0 * t], 1))
        turns[:, hip + 2] = from_rotation_vector(np.stack([-swing + bend, 0 * t, 0 * t], 1))
    clip = Clip("step", WALKER, turns, np.tile(WALKER.positions[0], (61, 1)), 1 / 30)
    project = Project().with_takes(clip).with_characters(still_shape("walker", WALKER))
    for hip in (1, 4):
        chain = (hip, hip + 1, hip + 2)
        project = bind_chain(project, "walker", chain, "step", chain, basis=IDENTITY)
    return pin_feet(project, "walker", ["ankle L"])


def test_pin_changes_the_pose(walker):
    free = walker.with_characters(walker.shape("walker").with_changes(pins=()))
    apart = [
        angle(evaluate_pose(walker, "walker", t).turns, evaluate_pose(free, "walker", t).turns)
        for t in (0.3, 1.0)
    ]
    assert max(apart) > 1e-3


@pytest.mark.parametrize("bone", ["knee L", "ankle L", "knee R", "ankle R"])
@pytest.mark.parametrize("time", [0.3, 1.0])
def test_a_cut_turns_nothing_although_a_pin_lets_go(walker, bone, time):
    edited, parts = cut_bone(walker, "walker", bone, 0.5, time)
    shape = walker.shape("walker")
    before = dict(zip(shape.skeleton.names, compute_pose(walker, shape, time)[0], strict=True))
    for part in parts:
        turns = compute_pose(edited, edited.shape(part), time)[0]
        for name, turn in zip(edited.shape(part).skeleton.names, turns, strict=True):
            if name in before:
                assert angle(turn, before[name]) < 1e-9, name
    assert len(edited.shape(parts[0]).pins) == (1 if bone.endswith("R") else 0)
    assert len(edited.shape(parts[1]).pins) == 0


def test_pins_go_with_their_joints(walker):
    project, copy = copy_character(walker, "walker")
    assert project.shape(copy).pins == walker.shape("walker").pins
    merged, names = merge(project, "walker", "hips", copy, 0.5)
    pins = merged.shape("walker").pins
    assert [(pin.start, pin.joint) for pin in pins] == [
        ("hip L", "ankle L"),
        (names["hip L"], names["ankle L"]),
    ]
    assert remove_node(walker, "walker", "ankle L").shape("walker").pins == ()
    assert remove_node(walker, "walker", "ankle R").shape("walker").pins == walker.shape("walker").pins
