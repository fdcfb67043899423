"""Tests that a project's character that is also on the stage is shown once, with both states combined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from strokes import limb
from swaying import possessed_chair

from enliven.document import Pose, Project, character_of
from enliven.matching.match_list import MatchList, MatchRow
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.motion.layers.retarget import bind_chain
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.live_overlay import LiveOverlay, OverlayConditions
from enliven_viewer.studio.workspace.files import read_library

ARM = shape_from_stroke(limb(np.array([[0.0, 0.4], [0.0, 1.4]]), np.array([0.08, 0.05])), id="arm")
ASIDE = np.array([2.0, 0.0, -2.5], np.float32)


@pytest.fixture
def editor() -> Editor:
    wave = read_library()[0]
    project = Project().with_takes(wave).with_characters(ARM)
    return Editor(project=bind_chain(project, "arm", (0, 1), wave.id, (0, 1)))


def on_stage(held: bool = True) -> SceneCharacter:
    """Returns the arm in an edge's state: at rest, moved to the side, or attached at its second bone."""
    character = character_of(ARM)
    rest = character.rest_pose()
    cues = CueFrame("arm", np.array([1], np.int32), np.ones(1, np.float32)) if held else None
    return SceneCharacter(character, Pose("arm", 5, rest.linear, rest.positions + ASIDE), cues)


def test_a_rigged_one_plays_in_its_place_on_the_stage(editor: Editor) -> None:
    twins, scene = LiveOverlay(editor), Scene((on_stage(),))
    editor.time = 0.7
    (shown,) = twins.merge(scene, OverlayConditions()).actors
    assert twins.hidden == {"arm"}
    plays = evaluate_pose(editor.project, "arm", 0.7)
    above = np.maximum(ARM.skeleton.parents, 0)
    np.testing.assert_allclose(shown.pose.positions, plays.joints[above] + ASIDE, atol=1e-5)
    replaced = twins.merge(scene, OverlayConditions(replaces_motion=True)).actors[0]
    rest = on_stage().pose
    np.testing.assert_allclose(replaced.pose.linear[1], rest.linear[1], atol=1e-5)
    assert np.abs(shown.pose.linear[1] - rest.linear[1]).max() > 0.05, "the wave would be left out for it"


def test_project_character_is_shown_while_editing(editor: Editor) -> None:
    twins = LiveOverlay(editor)
    board = MatchList("arm", "choosing", 1, 5, 0, (), 0)
    scene = twins.merge(Scene((on_stage(),), boards={"arm": board}), OverlayConditions(is_performing=False))
    assert scene.actors == () and scene.boards == {} and twins.hidden == frozenset()


def test_matches_lie_on_the_bones_as_they_are_shown(editor: Editor) -> None:
    editor.time = 0.7
    line = ARM.skeleton.positions[[0, 1]] + ASIDE
    board = MatchList("arm", "choosing", 1, 5, 0, (MatchRow("1-1", 0, 1.0, (line, line[:0])),), 1)
    shown = LiveOverlay(editor).merge(Scene((on_stage(),), boards={"arm": board}), OverlayConditions())
    (there, nothing) = shown.boards["arm"].rows[0].lines
    np.testing.assert_allclose(
        there, evaluate_pose(editor.project, "arm", 0.7).joints[[0, 1]] + ASIDE, atol=1e-5
    )
    assert len(nothing) == 0


def test_edited_character_is_shown_until_the_stage_has_it(editor: Editor) -> None:
    other = replace(
        on_stage(), pose=Pose("arm", 5, np.zeros((1, 3, 3), np.float32), np.zeros((1, 3), np.float32))
    )
    twins = LiveOverlay(editor)
    assert twins.merge(Scene((other,)), OverlayConditions(plays_live=False)).actors == () and not twins.hidden


def test_possessed_mesh_is_live_while_attached_and_plays_otherwise() -> None:
    project, name = possessed_chair(4)
    editor = Editor(project=project)
    character = editor.stage_character(name).drawn
    assert character is not None
    actor = SceneCharacter(character, character.rest_pose())
    twins = LiveOverlay(editor)

    def live(playing: bool, **telling) -> bool:
        editor.playing = playing
        shown = twins.merge(Scene((actor,)), OverlayConditions(**telling)).actors
        assert (twins.hidden == {name}) == bool(shown)
        return bool(shown)

    assert live(False) and live(True, held_ids={name})
    assert not live(True), "it plays while others are recorded"
    assert not live(True, plays_live=False, held_ids={name}), "what was recorded is looked at"


def test_attached_mesh_plays_with_the_live_motion_on_top() -> None:
    project, name = possessed_chair(20)
    editor = Editor(project=project)
    editor.time = 0.4
    character = editor.stage_character(name).drawn
    assert character is not None
    rest = character.rest_pose()
    bent = replace(rest, positions=rest.positions + ASIDE)
    top = character.pivots[:, 1].argmax()
    bent.positions[top] += [0.1, 0.0, 0.0]
    twins, plays = LiveOverlay(editor), editor.stage_character(name).pose
    held = OverlayConditions(held_ids={name})
    (shown,) = twins.merge(Scene((SceneCharacter(character, bent),)), held).actors
    apart = np.linalg.norm(shown.pose.positions - plays.positions, axis=1)
    assert apart[top] == pytest.approx(0.1, abs=5e-3) and np.delete(apart, top).max() < 5e-3
    instead = replace(held, replaces_motion=True)
    (shown,) = twins.merge(Scene((SceneCharacter(character, bent),)), instead).actors
    np.testing.assert_array_equal(shown.pose.positions, bent.positions)
