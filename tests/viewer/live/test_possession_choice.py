"""Tests of the options for the next possession, and of the colours of attached parts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from enliven.person.parts import parse_parts
from enliven.wire import LearnRoom
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.possession_choice import PART_CHOICES, PossessionChoice
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.marks import CUE_TINT, make_cue_rows
from enliven_viewer.render.scene import SceneCharacter
from enliven_viewer.studio.app.workspace_tabs import WORKSPACES
from enliven_viewer.studio.features.perform.actions import PERFORM_ACTIONS
from enliven_viewer.theme import PERFORMER_COLOURS


def test_every_key_names_parts_that_there_are() -> None:
    assert len(PART_CHOICES) == 9 and all(parse_parts(name) for name in PART_CHOICES)
    possession = PossessionChoice()
    for number, name in enumerate(PART_CHOICES):
        possession.choose_parts(number)
        assert possession.parts == name


def test_the_choice_goes_round_those_in_view() -> None:
    possession, seen = PossessionChoice(), []
    for present in ([7, 3], [7, 3], [7, 3], [3], [], [5]):
        possession.next_performer(present)
        seen.append(possession.body)
    assert seen == [3, 7, None, 3, None, 5]
    assert possession.describe_choice(int) == "Press P to step in with the whole body of performer 5"


def test_smoothing_is_requested_for_the_chosen_performer_and_ends_at_off() -> None:
    possession = PossessionChoice()
    assert possession.change_smoothing(1, [3, 7]) == {3: 2.0, 7: 2.0}
    possession.next_performer([3, 7])
    assert [possession.change_smoothing(-1, [3, 7])[3] for _ in range(4)] == [1.0, 0.5, 0.0, 0.0]
    assert "smoothing 0" in possession.describe_choice(int)
    possession.locked = True
    assert possession.describe_choice(int).endswith("locked")


def test_every_key_of_possession_means_one_thing_in_its_workspace() -> None:
    keys = [
        (action.key, room)
        for action in PERFORM_ACTIONS
        if action.key
        for room in action.workspaces or WORKSPACES
    ]
    assert len(set(keys)) == len(keys)
    assert {key for key, room in keys if room == "Play"} >= {*"pjerbknmvlgs123456789", "comma", "period"}


def test_an_action_of_the_menu_makes_the_edge_learn_the_room() -> None:
    asked: list[object] = []
    feed = SimpleNamespace(ask=lambda order, *_: asked.append(order))
    (action,) = [each for each in PERFORM_ACTIONS if each.label == "Learn the room again"]
    action.do(SimpleNamespace(live=LiveStage(feed, Document())))
    assert asked == [LearnRoom()] and action.key == ""


def test_nodes_are_tinted_by_their_performers_and_previews_are_fainter(box) -> None:
    nodes, strengths = np.arange(5, dtype=np.int32), np.ones(5, np.float32)
    owners = np.array([4, 9, 4, 9, 9], np.int32)
    actor = SceneCharacter(box, box.rest_pose(), CueFrame("box", nodes, strengths, "possessed", owners, 3))
    rows = make_cue_rows(actor, 1.0, [9, 4])
    tints = linear_from_srgb(np.array(PERFORMER_COLOURS, float))
    np.testing.assert_allclose(rows[:, 4:7], tints[[1, 0, 1, 0, 0]], rtol=1e-6)
    away = make_cue_rows(actor, 1.0, [9])
    np.testing.assert_allclose(away[:, 4:7], rows[:, 4:7], err_msg="who is out of view comes last")
    assert (rows[:3, 7] == rows[0, 7]).all() and (rows[3:, 7] < 0.5 * rows[0, 7]).all()


def test_cues_that_name_no_owner_look_as_ever(box) -> None:
    nodes, strengths = np.arange(3, dtype=np.int32), np.ones(3, np.float32)
    held = make_cue_rows(SceneCharacter(box, box.rest_pose(), CueFrame("box", nodes, strengths)), 1.0)
    shown = make_cue_rows(
        SceneCharacter(box, box.rest_pose(), CueFrame("box", nodes, strengths, "preview")), 1.0
    )
    assert np.allclose(held[:, 4:7], CUE_TINT) and (shown[:, 7] < held[:, 7]).all()
