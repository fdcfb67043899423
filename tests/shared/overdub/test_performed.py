"""Tests that a live performance becomes takes and layers that play as displayed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from performed_arm import ARM, BEGIN, BONES, FRAMES, STEP, create_performance, create_waving_rotations

from enliven.document.project import Project, are_identical
from enliven.frames import BodyFrame
from enliven.motion.layers.evaluate import evaluate_pose, pose_from
from enliven.overdub.performance_takes import add_performance
from enliven.overdub.rigged_overdub import LiveLayer
from enliven.person.body import Body
from enliven.wire import HoldMessage

BENDS = st.dictionaries(st.integers(1, BONES - 1), st.floats(0.2, 1.0), min_size=1, max_size=BONES - 1)


@given(BENDS, st.floats(0.0, 4.0))
@settings(max_examples=25)
def test_shape_plays_recording_from_its_start_time(bends, start: float) -> None:
    own = create_waving_rotations(bends)
    merged, names = add_performance(
        Project().with_characters(ARM), create_performance(own), BEGIN - round(start * 1e9)
    )
    shape = merged.shape("arm")
    assert names == ("arm",) and {layer.take for layer in shape.layers} == {"take 1 on arm"}
    played = {bone for bone, spans in enumerate(shape.spans) if any(span.refs for span in spans)}
    assert played == set(bends), "bones that did not move have no layer"
    limbs = [bone for bone in bends if bone - 1 not in bends]
    assert len(shape.layers) == len(limbs), "the bones of a limb have one together"
    alone = create_performance(own).poses["arm", 3]
    for frame in (0, 4, FRAMES - 1):
        shown = pose_from(shape, evaluate_pose(merged, "arm", start + frame * STEP * 1e-9), 0.0)
        np.testing.assert_allclose(shown.linear, alone[frame].linear, atol=2e-3)
        aside = shown.positions - alone[frame].positions
        np.testing.assert_allclose(aside, np.tile(aside[0], (BONES, 1)), atol=2e-3, err_msg="it stays there")


def test_a_second_recording_is_added_to_the_first_or_takes_its_place_and_the_take_stays() -> None:
    first, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.5})), BEGIN
    )
    second, _ = add_performance(first, create_performance(create_waving_rotations({2: 0.8}), "take 2"), BEGIN)
    turn_before = evaluate_pose(first, "arm", 0.2).turns[1]
    np.testing.assert_allclose(evaluate_pose(second, "arm", 0.2).turns[1], turn_before, atol=1e-6)
    assert (
        np.abs(evaluate_pose(second, "arm", 0.2).turns[2] - evaluate_pose(first, "arm", 0.2).turns[2]).max()
        > 0.05
    )
    replaced, _ = add_performance(
        first, create_performance(create_waving_rotations({1: 0.2}), "take 2"), BEGIN, replaces=True
    )
    alone, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.2})), BEGIN
    )
    np.testing.assert_allclose(
        evaluate_pose(replaced, "arm", 0.2).turns, evaluate_pose(alone, "arm", 0.2).turns, atol=1e-6
    )
    assert are_identical(replaced.takes["take 1 on arm"], first.takes["take 1 on arm"]), (
        "nothing recorded is lost"
    )


@given(BENDS, BENDS, st.booleans())
@settings(max_examples=15)
def test_live_display_matches_later_playback(first, second, replaces: bool) -> None:
    before, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations(first)), BEGIN
    )
    live = create_performance(create_waving_rotations(second), "take 2", root=0.0)
    after, _ = add_performance(before, live, BEGIN, replaces=replaces)
    shown = LiveLayer(before, "arm", frozenset(second) if replaces else frozenset())
    for frame in (1, FRAMES // 2, FRAMES - 1):
        seconds, seen = frame * STEP * 1e-9, live.poses["arm", 3][frame]
        plays = evaluate_pose(after, "arm", seconds)
        pose, joints = shown.pose(seen, seconds)
        np.testing.assert_allclose(pose.linear, pose_from(ARM, plays, 0.0).linear, atol=4e-3)
        np.testing.assert_allclose(joints - joints[0], plays.joints - plays.joints[0], atol=4e-3)
        np.testing.assert_allclose(joints[0], seen.positions[0], atol=1e-5, err_msg="where the stage has it")
        alone, _ = shown.pose(seen, seconds, heard=False)
        if not replaces:
            played = pose_from(ARM, evaluate_pose(before, "arm", seconds), 0.0)
            np.testing.assert_allclose(alone.linear, played.linear, atol=1e-6)


def test_moving_root_carries_shape_from_its_position() -> None:
    merged, _ = add_performance(
        Project().with_characters(ARM),
        create_performance(create_waving_rotations({0: 0.4, 1: 0.4}), root=0.1),
        BEGIN,
    )
    went = [evaluate_pose(merged, "arm", frame * STEP * 1e-9).joints[0] for frame in (0, 5)]
    np.testing.assert_allclose(went[0], ARM.skeleton.positions[0], atol=1e-6)
    np.testing.assert_allclose(went[1] - went[0], [0.5, 0.0, 0.0], atol=1e-3)


def test_visible_performers_become_takes_and_still_parts_add_nothing() -> None:
    still = create_performance(create_waving_rotations({}))
    rng = np.random.default_rng(0)
    joints = rng.normal(size=(20, 3))
    for frame in range(40):
        body = Body(4, joints + 0.01 * frame, np.ones(20))
        still.frames.append(BodyFrame([body], BEGIN + frame * STEP, "edge"))
    still.events.append(HoldMessage("arm", BEGIN, "alone", body=4, holders=[4]))
    merged, names = add_performance(Project().with_characters(ARM), still, BEGIN)
    assert names == ("take 1",) and merged.shape("arm").layers == ()
    assert merged.takes["take 1"].duration > 1.0
    early = replace(still, since_ns=BEGIN + 60 * STEP)
    assert add_performance(Project(), early, BEGIN)[1] == ()
