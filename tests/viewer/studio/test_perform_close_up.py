"""Tests that the view moves to the limb that would be attached, also shows it from the side, and returns."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.document.character import Character
from enliven.matching.match_list import MatchList, MatchRow
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.close_up import CloseUp, find_pending_limb_box
from enliven_viewer.studio.settings import StudioSettings

LONG = 1.0
"""Minimum seconds before the view may move to another limb."""


@pytest.fixture
def tower(make_character, make_box) -> Character:
    """Returns a box that is three metres high, with eight nodes."""
    return make_character(*make_box((-0.3, 0.0, -0.3), (0.3, 3.0, 0.3)), nodes=8, seed=1)


def scene_with(
    one: Character, nodes: np.ndarray, state: str = "preview", board: MatchList | None = None
) -> Scene:
    cues = CueFrame(one.id, nodes.astype(np.int32), np.ones(len(nodes), np.float32), state)
    boards = {} if board is None else {one.id: board}
    return Scene((SceneCharacter(one, one.rest_pose(), cues),), boards=boards)


def end(one: Character, *, top: bool) -> np.ndarray:
    """Returns the nodes in the upper or in the lower half."""
    height = one.pivots[:, 1]
    return np.flatnonzero((height > 1.5) == top)


def chosen(points: np.ndarray) -> MatchList:
    row = MatchRow("limb", 0, 1.0, (points,))
    return MatchList("box", "choosing", 1, 0, 0, (row,), 1)


def seen_share(editor: Editor, points: np.ndarray) -> float:
    """Returns the fraction of the image's height that points cover once the view has settled."""
    editor.camera.advance(10.0)
    return float(np.ptp(editor.lens.project(points.astype(np.float64))[0][:, 1])) / editor.size[1]


def test_the_view_goes_to_the_nodes_that_would_be_held_and_back(tower) -> None:
    editor = Editor(StudioSettings(width=1280, height=720))
    editor.camera.frame((tower.vertices.min(0), tower.vertices.max(0)), 16 / 9, at_once=True)
    close, before, top = CloseUp(editor), editor.camera.goal, end(tower, top=True)
    points = tower.pivots[top]
    far = seen_share(editor, points)
    close.advance(LONG, scene_with(tower, top), "box")
    assert close.box is None and editor.camera.goal == before, "it is a switch"
    close.toggle()
    close.advance(LONG, scene_with(tower, top), "box")
    assert seen_share(editor, points) > 1.2 * far and close.box is not None
    side = close.lens(360.0, 300.0)
    assert side is not None and abs(side.forward @ editor.lens.forward) < 0.3, "from the side"
    places = side.project(points.astype(np.float64))[0]
    assert (places > 0).all() and (places < [360.0, 300.0]).all()
    close.advance(LONG, scene_with(tower, top, "possessed"), "box")
    assert close.box is None and editor.camera.goal == pytest.approx(before)


def test_a_match_that_is_shown_is_looked_at_and_another_one_after_a_while(tower) -> None:
    editor, close = Editor(), None
    close = CloseUp(editor)
    close.toggle()
    first, other = np.array([[0.3, 0.2, 0], [0.3, 0.8, 0]]), np.array([[-0.3, 2.2, 0], [-0.3, 2.9, 0]])
    goals = []
    for seconds, line in ((LONG, first), (0.1, other), (LONG, other), (0.1, other + 0.01)):
        close.advance(seconds, scene_with(tower, np.empty(0), board=chosen(line)), None)
        goals.append(editor.camera.goal)
    assert goals[0][1] == pytest.approx(0.5) and goals[2][1] == pytest.approx(2.55)
    assert goals[1] == goals[0], "it does not leap"
    assert goals[3] == goals[2], "a hand that trembles moves nothing"


def test_view_turned_by_the_user_is_kept(tower) -> None:
    editor = Editor()
    close = CloseUp(editor)
    close.toggle()
    close.advance(LONG, scene_with(tower, end(tower, top=True)), None)
    editor.camera.orbit(0.4, 0.1)
    turned = editor.camera.goal
    close.advance(LONG, scene_with(tower, end(tower, top=False)), None)
    close.advance(LONG, None, None)
    assert editor.camera.goal == turned


def test_the_whole_of_a_character_is_no_limb_and_another_one_is_not_meant(tower) -> None:
    every = np.arange(len(tower.pivots))
    assert find_pending_limb_box(scene_with(tower, every)) is None
    top = scene_with(tower, end(tower, top=True))
    assert find_pending_limb_box(top) is not None and find_pending_limb_box(top, "other") is None
