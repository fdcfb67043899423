"""Tests of the example panel without a window: background solving, coverage, pairing, and jumping to key
poses.
"""

from __future__ import annotations

import itertools
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))
from made_studio_puppets import SIDES, TIPS, project_with, star, studio, vertex

from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.locomotion import Switch
from enliven.document.project import Project, are_identical
from enliven.document.puppet import PuppetLayer
from enliven.errors import InputError
from enliven.examples.puppet_motion import evaluate_state, solve_layer_motion
from enliven.modeling.edits import change_layers, rename_character
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point
from enliven.modeling.puppet.poses import add_key_pose, set_symmetry
from enliven_viewer.studio.features.puppets.key_pose_navigator import KeyPoseNavigator
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.puppets.coverage import CoverageCache
from enliven_viewer.studio.puppets.example_edits import (
    add_switch,
    describe_joint,
    duplicate_pose,
    find_layer_number,
    list_constraints,
    mirror_pose,
    move_switch,
    remove_constraint_from,
    remove_switch,
    retime_pose,
    turn_quarter,
    with_constraint,
    with_default_settings,
    with_guessed_joints,
    with_setting,
)
from enliven_viewer.studio.puppets.motion_solver import MotionSolver
from enliven_viewer.studio.puppets.puppet_editor import PuppetEditor, get_puppet_editor
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.workspace.workspace import Workspace

NAMES = ("head", "left", "right", "foot")


def find_puppets(workspace: Workspace) -> PuppetEditor:
    """Returns the puppet editor of a workspace."""
    return get_puppet_editor(workspace.editor)


def posed(times: tuple[float, ...] = (0.0, 0.75, 2.25), take: str = "sway") -> Project:
    """Returns a star that plays a take, with a key pose at each time."""
    project = project_with(*NAMES, take=take)
    rest = project.puppets["star"].rest
    for k, time in enumerate(times):
        places = rest + 0.1 * k * np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 0]])
        project = add_key_pose(project, "star", take, time, places)
    return project


def solved(solving: MotionSolver, project: Project):
    return solving.settle(project, "star")


def test_incomplete_puppets_are_not_solved() -> None:
    solving = MotionSolver(Toasts(5.0))
    for project in (project_with(*NAMES), project_with(*NAMES, take="sway"), posed((0.0,))):
        shown = solving.get_newest_solution(project, "star")
        assert shown[1].layers == () and solving.problem("star") is None and not solving.busy("star")


def test_last_good_motion_stays_and_refusal_is_reported_once() -> None:
    toasts = Toasts(5.0)
    solving, good = MotionSolver(toasts), posed()
    assert solved(solving, good)[1] is good.puppets["star"]
    before = evaluate_state(*solved(solving, good), 0.4).places
    still = (Velocity("left", 1, (0.0, 0.0, 0.0)), Velocity("left", 1, (1.0, 0.0, 0.0)))
    layer = good.puppets["star"].layers[0]
    wrong = PuppetLayer(layer.take, velocities=still)
    bad = good.with_characters(good.puppets["star"].with_changes(layers=(wrong,)))
    for _ in range(3):
        assert solved(solving, bad)[1] is good.puppets["star"], "the last good one"
    problem = solving.problem("star")
    assert problem is not None and "left" in problem.what and "contradicts" in problem.what
    assert [toast.is_error for toast in toasts.shown] == [True]
    np.testing.assert_array_equal(evaluate_state(*solved(solving, bad), 0.4).places, before)
    assert solved(solving, good)[1] is good.puppets["star"] and solving.problem("star") is None
    solving.close()


def test_retimed_layer_is_shown_without_solving() -> None:
    solving, project = MotionSolver(Toasts(5.0), patience=5.0), posed()
    solved(solving, project)
    moved = change_layers(project, "star", [0], offset=0.5, speed=2.0)
    assert solving.get_newest_solution(moved, "star")[1] is moved.puppets["star"]
    solving.close()


def test_the_layer_that_is_meant_is_the_chosen_one_or_the_first_that_plays() -> None:
    project = play_take(play_take(project_with("head", take="sway"), "star", "walk"), "star", "walk")
    puppet = change_layers(project, "star", [0], muted=True).puppets["star"]
    assert [find_layer_number(puppet, chosen) for chosen in (None, 0, 2, 7)] == [1, 0, 2, 1]
    assert find_layer_number(puppet, 2, "sway") == 0 and find_layer_number(puppet, None, "curl") is None


def test_coverage_is_nothing_at_examples_and_less_with_every_one() -> None:
    coverages, take = CoverageCache(), "sway"
    none = coverages.find_coverage(
        project_with(*NAMES, take=take), project_with(*NAMES, take=take).puppets["star"], take
    )
    assert none is not None and none.needed >= 2 and not none.distances.any()
    lefts = []
    for count in (1, 2, 3):
        project = posed((0.0, 0.75, 2.25)[:count])
        coverage = coverages.find_coverage(project, project.puppets["star"], take)
        assert coverage is not None
        frames = [round(pose.time / coverage.step) for pose in project.puppets["star"].poses]
        assert np.abs(
            coverage.distances[frames]
        ).max() < 1e-9 and coverage.remaining_distance == pytest.approx(coverage.distances.max())
        assert not set(coverage.frames[: coverage.needed]) & set(frames)
        assert coverages.find_coverage(project, project.puppets["star"], take) is coverage, "kept"
        lefts.append(coverage.remaining_distance)
    assert lefts == sorted(lefts, reverse=True)


def test_still_take_has_no_coverage() -> None:
    project = posed()
    clip = project.takes["sway"]
    still = replace(clip, id="still", turns=clip.turns[:1].repeat(20, 0), root=clip.root[:1].repeat(20, 0))
    project = project.with_takes(still)
    assert CoverageCache().find_coverage(project, project.puppets["star"], "still") is None


def test_unnamed_points_are_named_after_their_joint() -> None:
    project = project_with("head")

    project = add_point(project, "star", vertex("foot"))
    points = with_guessed_joints(project, "star", "walk").puppets["star"].points
    assert points[0].name == "head" and points[0].joint == "bone 3", "what is paired stays"
    assert points[1].joint and points[1].name == describe_joint(points[1].joint)
    assert not points[1].foot, "one foot alone is none"
    with pytest.raises(InputError, match="no take"):
        with_guessed_joints(project, "star", "")


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ("LeftHandIndex1 end", "left hand"),
        ("Head end", "head"),
        ("hand left", "left hand"),
        ("RightToeBase", "right toe"),
        ("X1", "x"),
    ],
)
def test_joints_have_readable_names(joint: str, said: str) -> None:
    assert describe_joint(joint) == said


def test_settings_and_names_change_alone_and_come_back() -> None:
    project = posed()
    changed = with_setting(project, "star", "examples", "acceleration", 0.9)
    changed = with_setting(changed, "star", "surface", "hold", 0.1)
    puppet = changed.puppets["star"]
    assert (puppet.examples.acceleration, puppet.surface.hold) == (0.9, 0.1)
    assert are_identical(with_default_settings(changed, "star"), project)
    named = rename_character(project, "star", "sun")
    assert list(named.puppets) == ["sun"] and are_identical(rename_character(named, "sun", "star"), project)
    with pytest.raises(InputError, match="already has the name"):
        rename_character(project.with_characters(named.puppets["sun"]), "star", "sun")


def test_a_mesh_is_stood_up_before_it_has_points() -> None:
    project = make_puppet(Project(), star(), "star")
    lying = turn_quarter(project, "star", "x")
    assert np.ptp(lying.puppets["star"].mesh.vertices, 0)[1] == pytest.approx(np.ptp(star().vertices, 0)[2])
    for axis in ("x", "y"):
        turned = project
        for _ in range(4):
            turned = turn_quarter(turned, "star", axis)
            assert turned.puppets["star"].mesh.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-9)
        shape = turned.puppets["star"].mesh.vertices
        np.testing.assert_allclose(
            shape - shape.mean(0), star().vertices - star().vertices.mean(0), atol=1e-9
        )
    with pytest.raises(InputError, match="already has control points"):
        turn_quarter(project_with("head"), "star", "x")


def test_key_poses_are_copied_mirrored_and_moved_to_frames() -> None:
    project = posed()
    copied = duplicate_pose(project, "star", 1, "sway", 0.2).puppets["star"].poses
    assert len(copied) == 4 and np.array_equal(copied[3].places, copied[1].places)
    both = set_symmetry(project_with(*TIPS), "star", SIDES)
    places = both.puppets["star"].rest + 0.1 * np.arange(15).reshape(5, 3)
    both = mirror_pose(add_key_pose(both, "star", "sway", 0.0, places), "star", 0, "sway", 0.2)
    image = both.puppets["star"].poses[1].places
    rest = both.puppets["star"].rest
    np.testing.assert_allclose((image - rest)[[0, 4, 3, 2, 1]], (places - rest) * [-1, 1, 1], atol=1e-9)
    moved = retime_pose(project, "star", 1, 0.913).puppets["star"].poses[1].time
    assert moved == pytest.approx(27 / 30)
    assert retime_pose(project, "star", 0, -5.0).puppets["star"].poses[0].time == 0.0
    with pytest.raises(InputError, match="already"):
        retime_pose(project, "star", 1, 2.25)


switch_lists = st.lists(st.integers(1, 119), min_size=0, max_size=8, unique=True).map(
    lambda frames: tuple(
        Switch(frame, "contact" if k % 2 == 0 else "flight") for k, frame in enumerate([0, *sorted(frames)])
    )
)


def taking_turns(switches: tuple[Switch, ...]) -> bool:
    frames, kinds = [switch.frame for switch in switches], [switch.kind for switch in switches]
    ascending = all(a < b for a, b in itertools.pairwise(frames))
    return frames[0] == 0 and ascending and all(a != b for a, b in itertools.pairwise(kinds))


@given(switch_lists, st.integers(0, 130), st.data())
def test_switches_alternate_after_any_edit(switches, frame, data) -> None:
    added = add_switch(switches, frame, 120)
    assert taking_turns(added) and added[-1].frame < 120
    if 0 < frame < 120 and frame not in {switch.frame for switch in switches}:
        assert frame in {switch.frame for switch in added}
    number = data.draw(st.integers(0, len(switches) - 1))
    assert taking_turns(remove_switch(switches, number))
    moved = move_switch(switches, number, frame, 120)
    assert taking_turns(moved) and [switch.kind for switch in moved] == [switch.kind for switch in switches]
    assert moved[-1].frame < 120


def test_constraint_is_unique_per_frame_and_removable() -> None:
    project = posed()
    first, second = Position("left", 10, (0.0, 0.5, 0.0)), Position("left", 10, (0.1, 0.5, 0.0))
    level = Coupling("left", "right", 5)
    for held in (first, second, level):
        project = with_constraint(project, "star", 0, held)
    assert list_constraints(project, "star", 0) == (level, second)
    places = evaluate_state(project, project.puppets["star"], 10 / 30).places
    np.testing.assert_allclose(places[1], second.place, atol=1e-8)
    assert list_constraints(remove_constraint_from(project, "star", 0, second), "star", 0) == (level,)


def test_a_click_on_a_joint_pairs_it_with_the_chosen_point(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES, take="sway")
    view = workspace.state(PerformerView)
    view.update()
    figure = view.figure()
    assert figure is not None
    pixel = view.lens.project(figure.joints)[0][figure.skeleton.index("bone 1")]
    workspace.editor.select_only("star", 0)
    view.press((float(pixel[0]), float(pixel[1])))
    assert workspace.editor.project.puppets["star"].points[0].joint == "bone 1"
    assert figure.skeleton.index("bone 1") in view.paired()
    workspace.editor.undo()
    assert workspace.editor.project.puppets["star"].points[0].joint == "bone 3"
    workspace.editor.select_only("star", None)
    view.pair("bone 2")
    assert find_puppets(workspace).point == 2, (
        "without a chosen point the one that follows the joint is chosen"
    )


def test_both_views_turn_together_until_they_are_parted(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES, take="sway")
    view, editor = workspace.state(PerformerView), workspace.editor
    for linked in (True, False):
        view.linked = linked
        editor.camera.face(0.3, 0.2)
        editor.advance(10.0)
        view.update()
        before = view.lens.forward
        view.press((1.0, 200.0))
        view.move((61.0, 200.0))
        view.release()
        editor.advance(10.0)
        view.update()
        angle = math.acos(np.clip(before @ view.lens.forward, -1, 1))
        assert angle == pytest.approx(0.48 * math.cos(0.2), abs=0.03)
        assert (np.linalg.norm(view.lens.forward - editor.lens.forward) < 1e-6) == linked


def test_the_performer_looks_where_the_mesh_looks_whatever_its_yaw(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES, take="quarter turn")
    view = workspace.state(PerformerView)
    assert view.moment == ("quarter turn", 0.0)
    first, second = view.figure(("sway", 0.0)), view.figure(("sway", 1.0))
    assert first is not None and second is not None
    np.testing.assert_allclose(first.joints[0] * [1, 0, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(second.joints[0] * [1, 0, 1], 0.0, atol=1e-9)


def test_the_first_take_that_is_shown_is_played_and_others_are_only_shown(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES)
    view = workspace.state(PerformerView)
    assert view.take is None and view.figure() is None and find_puppets(workspace).moment is None
    view.show("sway")
    view.show("walk")
    puppet = workspace.editor.project.puppets["star"]
    assert [layer.take for layer in puppet.layers] == ["sway"] and view.take == "walk"
    view.play()
    assert [layer.take for layer in workspace.editor.project.puppets["star"].layers] == ["sway", "walk"]
    assert workspace.editor.selection.layer == 1


def test_key_poses_are_begun_and_edited_at_their_moment(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES, take="sway")
    workspace.input.activate_tool("choose")
    workspace.editor.edit("later", lambda project: change_layers(project, "star", [0], offset=0.4))
    workspace.state(KeyPoseNavigator).begin("sway", 0.61)
    workspace.state(KeyPoseNavigator).begin("sway", 1.5)
    times = [pose.time for pose in workspace.editor.project.puppets["star"].poses]
    assert times == [pytest.approx(18 / 30), pytest.approx(1.5)] and find_puppets(workspace).number == 1
    assert workspace.input.tool.name == "puppet" and workspace.editor.time == pytest.approx(1.9)
    workspace.state(KeyPoseNavigator).edit(0)
    assert find_puppets(workspace).number == 0 and workspace.editor.time == pytest.approx(1.0)
    assert workspace.state(PerformerView).moment == ("sway", pytest.approx(18 / 30))
    workspace.state(KeyPoseNavigator).begin("sway", 1.5)
    assert find_puppets(workspace).number == 1 and len(workspace.editor.project.puppets["star"].poses) == 2


def test_a_puppet_that_is_out_of_the_picture_is_brought_in_to_be_posed(tmp_path) -> None:
    workspace, _ = studio(tmp_path, *NAMES, take="sway")
    editor = workspace.editor
    editor.frame_all(at_once=True)
    before = editor.lens.view.eye
    workspace.state(KeyPoseNavigator).begin("sway", 0.5)
    editor.advance(10.0)
    np.testing.assert_allclose(editor.lens.view.eye, before, err_msg="all of it is seen")
    editor.camera.pan(5.0, 0.0)
    editor.advance(10.0)
    workspace.state(KeyPoseNavigator).edit(0)
    editor.advance(10.0)
    pixels = editor.lens.project(find_puppets(workspace).stage.find("star").vertices)[0]
    assert ((pixels >= 0) & (pixels <= editor.size)).all()


def test_contacts_are_those_of_the_motion() -> None:
    project = change_layers(posed(), "star", [0], switches=(Switch(0, "contact"), Switch(30, "flight")))
    assert solve_layer_motion(project, project.puppet("star"), 0).switches[0] == Switch(0, "contact")
