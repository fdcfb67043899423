"""Tests of a puppet's motion: its key poses at any performer position, mixing, loops, and other
performers.
"""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from puppet_worlds import JOINTS, PARENTS, REST, SIDES, STEP, puppet_project, walker
from tolerances import are_alike, assert_alike

from enliven.document.clip import Clip
from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.example_settings import ExampleSettings
from enliven.document.locomotion import Switch
from enliven.document.project import Project
from enliven.document.puppet import character_from_puppet
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_examples import examples_from_key_poses, find_missing_examples
from enliven.examples.puppet_motion import (
    convert_to_world_frame,
    evaluate_state,
    loop_position,
    pose_of_state,
    solve_layer_motion,
)
from enliven.examples.travel import find_travel
from enliven.modeling.edits import change_layers
from enliven.modeling.puppet.edits import play_take
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.poses import set_symmetry
from enliven.rotation import from_rotation_vector, multiply, rotate

seeds = st.integers(0, 10**6)
few = settings(max_examples=8, deadline=None)


def with_settings(project: Project, **changes: object) -> Project:
    puppet = project.puppets["stool"]
    return project.with_characters(puppet.with_changes(examples=replace(puppet.examples, **changes)))


def state(project, time):
    return evaluate_state(project, project.puppets["stool"], time)


def motion(project, layer=0):
    return solve_layer_motion(project, project.puppets["stool"], layer)


@given(seeds)
@few
def test_key_poses_are_met_exactly_without_the_acceleration_term(seed):
    project = leashed(with_settings(puppet_project(seed, level_feet=False), acceleration=0.0), 1000.0)
    for pose in project.puppets["stool"].poses:
        np.testing.assert_allclose(state(project, pose.time).places, pose.places, atol=1e-9)


@given(seeds, st.floats(-3, 3), st.floats(-9, 9), st.floats(-9, 9))
@few
def test_motion_is_independent_of_performer_position_and_heading(seed, yaw, x, z):
    clip = walker()
    turn = from_rotation_vector(np.array([0.0, yaw, 0.0]))
    moved = replace(
        clip, turns=multiply(turn, clip.turns), root=rotate(turn, clip.root) + np.array([x, 0.0, z])
    )
    here, there = motion(puppet_project(seed, clip=clip)), motion(puppet_project(seed, clip=moved))
    np.testing.assert_allclose(here.places, there.places, atol=1e-7)
    np.testing.assert_allclose(here.yaw, there.yaw, atol=1e-9)
    np.testing.assert_allclose(here.root, there.root, atol=1e-6)


def leashed(project, leash):
    """Returns the project with a stool whose drift from the performer's path is limited.

    Args:
        leash: maximum drift as a multiple of the stool's size.
    """
    puppet = project.puppets["stool"]
    how = replace(puppet.locomotion, leash=leash)
    return project.with_characters(replace(puppet, locomotion=how))


@given(seeds)
@few
def test_puppet_of_stationary_performer_stays(seed):
    clip = walker()
    clip = replace(clip, root=np.repeat(clip.root[:1], len(clip.root), 0))
    project = puppet_project(seed, clip=clip)
    size = float(np.linalg.norm(np.ptp(project.puppets["stool"].rest, axis=0)))
    for leash in (0.1, 0.5):
        solved = motion(leashed(project, leash))
        assert np.linalg.norm(solved.root[:, [0, 2]], axis=1).max() < (leash + 0.35) * size
        np.testing.assert_allclose(solved.root[0, [0, 2]], 0.0, atol=1e-12)


@given(seeds, st.floats(0.05, 0.95))
@few
def test_the_anchor_does_not_slide_also_between_frames(seed, part):
    project = leashed(puppet_project(seed), 1000.0)
    puppet, solved = project.puppets["stool"], motion(project)
    assume(find_travel(project, puppet).feet)
    assert len(set(solved.anchors)) > 1
    standing = [f for f in range(1, solved.frames) if solved.anchors[f] >= 0 and solved.anchors[f - 1] >= 0]
    assert len(standing) > 30
    for f in standing[::7]:
        anchor = int(solved.anchors[f])
        spots = []
        for time in ((f - 1) * STEP, (f - 1 + part) * STEP, f * STEP):
            state_now = state(project, time)
            spots.append(convert_to_world_frame(puppet, state_now, state_now.places[anchor])[[0, 2]])
        np.testing.assert_allclose(spots, np.tile(spots[0], (3, 1)), atol=1e-9)


def test_lowest_foot_keeps_rest_height_and_motion_starts_at_rest_position():
    project = puppet_project(play=True)
    puppet = project.puppets["stool"]
    begin = state(project, 0.0)
    assert begin.yaw == 0.0
    np.testing.assert_allclose(begin.root[[0, 2]], 0.0)
    for time in (0.0, 0.4, 1.3):
        now = state(project, time)
        feet = convert_to_world_frame(puppet, now, now.places[:2])
        assert abs(feet[:, 1].min()) < 1e-9


def test_two_feet_are_equally_high_where_one_takes_over():
    changes = {}
    for level in (True, False):
        solved = motion(puppet_project(level_feet=level))
        frames = [f for f in range(1, solved.frames) if solved.anchors[f] != solved.anchors[f - 1]]
        frames = [f for f in frames if solved.anchors[f] >= 0 and solved.anchors[f - 1] >= 0]
        gaps = [np.ptp(solved.places[f, [solved.anchors[f], solved.anchors[f - 1]], 1]) for f in frames]
        changes[level] = max(gaps)
    assert changes[True] < 1e-6
    assert changes[False] > 1e-3


def test_points_that_no_constraint_names_are_not_solved_again_and_the_same():
    project = puppet_project()
    puppet, took = project.puppets["stool"], project.takes["walk"]
    mapping = ExampleMap(examples_from_key_poses(project, puppet))
    poses = extract_performer_clip(took, mapping.examples.joints).poses
    first = mapping.solve(poses, STEP)
    asked = (
        Coupling("left foot", "right foot", 12),
        Position("left foot", 12, (0, 0, 0), "y"),
        Velocity("top", 3, (0, 0, 0)),
    )
    again = mapping.solve(poses, STEP, asked, known=first)
    np.testing.assert_allclose(again, mapping.solve(poses, STEP, asked), atol=1e-12)
    assert_alike(again[:, 2:4], first[:, 2:4])
    assert np.abs(again - first).max() > 1e-3


@given(seeds, st.floats(0, 4))
@few
def test_a_layer_of_no_weight_changes_nothing(seed, time):
    alone = puppet_project(seed)
    more = play_take(alone, "stool", "walk", weight=0.0, offset=0.3, speed=2.0)
    a, b = state(alone, time), state(more, time)
    assert are_alike(a.places, b.places) and a.yaw == b.yaw and are_alike(a.root, b.root)
    nothing = puppet_project(seed, weight=0.0)
    assert_alike(state(nothing, time).places, nothing.puppets["stool"].rest)


@given(seeds, st.floats(0, 3), st.floats(0, 1))
@few
def test_a_layer_moves_its_points_as_far_as_its_weight(seed, time, weight):
    full = puppet_project(seed, points=("top", "left hand"))
    part = change_layers(full, "stool", [0], weight=weight)
    rest, whole, some = full.puppets["stool"].rest, state(full, time).places, state(part, time).places
    assert_alike(whole[[0, 1, 3]], rest[[0, 1, 3]])
    np.testing.assert_allclose(some, rest + weight * (whole - rest), atol=1e-12)
    assert np.abs(whole[[2, 4]] - rest[[2, 4]]).max() > 0.01


def test_the_upper_layer_lies_on_the_lower_and_only_the_first_that_has_feet_travels():
    project = puppet_project()
    both = play_take(project, "stool", "walk", points=("top",), offset=-0.5)
    now, under = state(both, 1.0), state(project, 1.0)
    assert_alike(now.places[:4], under.places[:4])
    alone = change_layers(both, "stool", [0], muted=True)
    np.testing.assert_allclose(now.places[4], state(alone, 1.0).places[4])
    assert_alike(now.root, under.root)
    assert not np.array_equal(state(alone, 1.0).root, under.root)


def test_puppet_without_travel_stays():
    project = puppet_project(travel=False)
    solved = motion(project)
    assert not solved.travels and solved.switches == ()
    assert not solved.yaw.any() and not solved.root.any()
    np.testing.assert_allclose(
        solved.places, motion(change_layers(project, "stool", [0], level_feet=False)).places
    )


@given(seeds, st.integers(-3, 5))
@few
def test_loop_is_continuous_in_pose_and_position(seed, rounds):
    project = with_settings(puppet_project(seed, loop=True, level_feet=False), acceleration=0.0)
    puppet, clip = project.puppets["stool"], project.takes["walk"]
    seam = rounds * clip.duration
    before, after = state(project, seam - 1e-7), state(project, seam + 1e-7)
    # The walk ends as it began but for where it is: key poses are met at both ends alike.
    np.testing.assert_allclose(before.places, after.places, atol=1e-5)
    a, b = (convert_to_world_frame(puppet, now, now.places) for now in (before, after))
    np.testing.assert_allclose(a, b, atol=1e-5)
    a_round = clip.duration * 0.4
    turn = state(project, seam + a_round).yaw - state(project, a_round).yaw
    assert turn == pytest.approx(rounds * 0.4 * clip.duration, abs=1e-6)


def test_rounds_are_one_motion_after_another():
    """Compares the closed form with playing round by round, in which the performer's path continues."""
    solved = motion(puppet_project())
    turn = float(solved.yaw[-1])
    c, s = np.cos(turn), np.sin(turn)

    def turned(at):
        return np.array([c * at[0] + s * at[2], at[1], c * at[2] - s * at[0]])

    yaw, root = solved.root_at(7.3, 1)
    for rounds in range(2, 7):
        root = turned(root) + solved.path[-1]
        yaw += turn
        later = solved.root_at(7.3, rounds)
        np.testing.assert_allclose(later[1], root, atol=1e-9)
        assert later[0] == pytest.approx(yaw)
    straight = motion(puppet_project(clip=walker(turning=0.0)))
    np.testing.assert_allclose(
        straight.root_at(3.0, 1001)[1], straight.root_at(3.0, 1)[1] + 1000 * straight.path[-1], atol=1e-6
    )


@given(st.floats(0, 3))
@few
def test_backwards_is_from_the_end(time):
    project = puppet_project()
    back = change_layers(project, "stool", [0], speed=-1.0)
    end = project.takes["walk"].duration
    a, b = state(back, time), state(project, end - time)
    np.testing.assert_allclose(a.places, b.places, atol=1e-9)
    np.testing.assert_allclose(a.root, b.root, atol=1e-9)


def test_time_is_clamped_or_wrapped_in_loops():
    project = puppet_project(offset=1.0, speed=2.0)
    layer, solved = project.puppets["stool"].layers[0], motion(project)
    assert loop_position(layer, solved, 0.5) == (0.0, 0)
    assert loop_position(layer, solved, 1.5)[0] == pytest.approx(1.0 / STEP)
    assert loop_position(layer, solved, 99.0) == (solved.frames - 1, 0)
    assert loop_position(replace(layer, loop=True), solved, 1.0 + 3.5)[1] == 2
    assert project.end_of(project.puppets["stool"]) == pytest.approx(1.0 + 3.0 / 2.0)
    muted = change_layers(project, "stool", [0], muted=True)
    assert muted.end_of(muted.puppets["stool"]) == 0.0


def test_a_motion_is_solved_once_and_forgotten_with_its_take():
    project = puppet_project(seed=123)
    solved = motion(project)
    assert (
        motion(change_layers(project, "stool", [0], offset=3.0, speed=-0.5, loop=True, muted=False)) is solved
    )
    assert motion(change_layers(project, "stool", [0], weight=0.5)) is not solved
    assert motion(change_point(project, "stool", "top", joint="Spine")) is not solved
    with pytest.raises(ValueError):
        solved.places[0] = 0.0
    take = weakref.ref(project.takes["walk"])
    del project, solved
    gc.collect()
    assert take() is None


def test_the_pose_on_the_wire_is_the_state():
    project = puppet_project()
    puppet = project.puppets["stool"].with_changes(
        place=np.array([1.0, 0.0, 2.0]), turn=from_rotation_vector(np.array([0.0, 0.7, 0.0]))
    )
    project = project.with_characters(puppet)
    now = state(project, 1.1)
    pose, character = pose_of_state(puppet, now, 77), character_from_puppet(puppet)
    assert pose.time_ns == 77 and pose.positions.shape == character.pivots.shape
    np.testing.assert_allclose(pose.positions[1:], convert_to_world_frame(puppet, now, now.places), atol=1e-6)
    some = np.array([[0.1, 0.2, 0.3], [-1.0, 0.5, 0.0]])
    np.testing.assert_allclose(
        some @ pose.linear[0].T + pose.positions[0], convert_to_world_frame(puppet, now, some), atol=1e-5
    )


def child(names=JOINTS, front=0.0, size=0.6):
    """Returns the walker's motion by a smaller person, with other joint names and another rest pose."""
    clip = walker(names=names, size=size)
    away = from_rotation_vector(np.array([0.0, front, 0.0]))
    back = from_rotation_vector(np.array([0.0, -front, 0.0]))
    skeleton = Skeleton(names, np.array(PARENTS, np.int32), rotate(away, REST * size))
    return Clip("child", skeleton, multiply(clip.turns, back), clip.root, STEP)


ODD = ("Pelvis", "foot.L", "foot.R", "back", "hand.L", "hand.R", "skull")


@given(seeds, st.floats(-3, 3), st.sampled_from([JOINTS, ODD]))
@few
def test_child_drives_key_poses_of_an_adult(seed, front, names):
    project = puppet_project(seed)
    other = play_take(project.with_takes(child(names, front)), "stool", "child")
    mine, theirs = motion(project), motion(other, 1)
    np.testing.assert_allclose(theirs.places, mine.places, atol=1e-6)
    # Strides are the mesh's own.
    np.testing.assert_allclose(theirs.root, mine.root, atol=1e-5)
    notes = " ".join(theirs.notes)
    assert ("'hand.L' is used instead of 'LeftHand'" in notes) == (names is ODD)


def test_key_poses_may_be_of_two_performers():
    project = puppet_project(3)
    puppet = project.puppets["stool"]
    project = project.with_takes(child(ODD, 1.0))
    poses = tuple(replace(p, take="child") if n % 2 else p for n, p in enumerate(puppet.poses))
    mixed = project.with_characters(puppet.with_changes(poses=poses))
    np.testing.assert_allclose(motion(mixed).places, motion(project).places, atol=1e-6)


def test_a_joint_that_nobody_has_is_named_with_those_that_there_are():
    project = puppet_project()
    names = tuple(f"j{n}" for n in range(3))
    positions = np.array([[0, 1, 0], [0, 1.3, 0], [0, 1.6, 0]])
    skeleton = Skeleton(names, np.array([-1, 0, 1]), positions)
    pole = Clip("pole", skeleton, np.tile([1.0, 0, 0, 0], (9, 3, 1)), np.zeros((9, 3)), STEP)
    with pytest.raises(InputError) as refused:
        play_take(project.with_takes(pole), "stool", "pole")
    assert "'pole'" in str(refused.value) and "'LeftFoot'" in str(refused.value)
    assert "Known joints: j0, j1, j2" in str(refused.value)


def test_missing_parts_are_reported_until_puppet_can_move():
    project = Project().with_takes(walker())
    project = puppet_project(poses=0, play=False)
    assert find_missing_examples(project, project.puppets["stool"]) == ("Pose two examples.",)
    empty = puppet_project(poses=1, play=False)
    loose = add_point(empty, "stool", 100, "tail")
    assert find_missing_examples(loose, loose.puppets["stool"]) == (
        "Pair 'tail' with a joint.",
        "Pose one more example.",
    )
    wrong = change_point(puppet_project(), "stool", "top", joint="Tail")
    assert "has no 'Tail'" in find_missing_examples(wrong, wrong.puppets["stool"])[0]
    with pytest.raises(InputError, match="Pair 'tail' with a joint"):
        motion(play_take(loose, "stool", "walk"))
    odd = set_symmetry(add_point(puppet_project(), "stool", 100, "tail", "Spine"), "stool", SIDES)
    assert find_missing_examples(odd, odd.puppets["stool"])[0].startswith(
        "Control point 'tail' has no mirror image"
    )
    ready = puppet_project()
    assert find_missing_examples(ready, ready.puppets["stool"]) == ()


def test_left_key_poses_are_mirrored_to_the_right():
    """In a walk, feet are farther apart front to back than sideways. Left and right are therefore taken from
    the rest pose.
    """
    project = with_settings(puppet_project(poses=2, level_feet=False), acceleration=0.0)
    project = leashed(project, 1000.0)
    both = set_symmetry(project, "stool", SIDES)
    swapped, rest = [1, 0, 3, 2, 4], project.puppets["stool"].rest
    clip = project.takes["walk"]
    mirror = np.array([-1.0, 1.0, 1.0])
    other = replace(
        clip,
        id="mirrored",
        turns=clip.turns[:, [0, 2, 1, 3, 5, 4, 6]] * np.array([1.0, 1.0, -1.0, -1.0]),
        root=clip.root * mirror,
    )
    played = play_take(both.with_takes(other), "stool", "mirrored", level_feet=False)
    for pose in project.puppets["stool"].poses:
        frame = round(pose.time / STEP)
        seen = rest + (motion(played, 1).places[frame] - rest)[swapped] * mirror
        np.testing.assert_allclose(seen, pose.places, atol=1e-6)


def test_switches_that_were_edited_are_used_and_wrong_ones_refused():
    project = puppet_project(switches=(Switch(0, "contact"), Switch(30, "flight"), Switch(40, "contact")))
    anchors = motion(project).anchors
    assert (anchors[30:40] < 0).all() and (anchors[:30] >= 0).all()
    with pytest.raises(InputError, match="switches have invalid frames"):
        change_layers(project, "stool", [0], switches=(Switch(3, "contact"),))


def test_there_is_no_layer_of_that_number():
    project = puppet_project()
    with pytest.raises(InputError, match="layer 4 does not exist"):
        motion(project, 4)


def test_changed_settings_recompute_the_motion():
    project = puppet_project()
    puppet = project.puppets["stool"]
    other = project.with_characters(puppet.with_changes(examples=ExampleSettings(acceleration=3.0)))
    assert np.abs(motion(project).places - motion(other).places).max() > 1e-3
