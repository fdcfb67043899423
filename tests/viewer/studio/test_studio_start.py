"""The first minutes: the start page, samples, and the tour, taken in the real window."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window
from studio_driver import HeadlessStage, Key, play

from enliven.modeling.edits import rig_of
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.start import TOUR, Toured
from enliven_viewer.studio.workspace import SAMPLES
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_tour_session.py"


def test_the_tour_is_done_step_by_step_from_the_start_page(tmp_path) -> None:
    said = in_a_window(SESSION, str(tmp_path))
    assert said["done"], json.dumps(said)
    assert said["steps"] == [step.title for step in TOUR] and said["toured"]
    assert all(said[f"spread step {number + 1}"] > 5 for number in range(len(TOUR)))
    assert (tmp_path / "Untitled.enliven").is_file()


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace.new(Editor(), tmp_path)


def test_no_step_is_done_before_its_deed(workspace: Workspace) -> None:
    toured = Toured(workspace.editor, workspace.actions, workspace.store)
    for step in TOUR:
        now = step.look(toured)
        assert not step.done(now, step.look(toured)), step.title


def test_a_step_goes_on_a_moment_after_its_deed_and_not_by_another(workspace: Workspace) -> None:
    workspace.actions.do("help.tour")
    tour = workspace.tour
    assert tour is not None and tour.number == 0
    workspace.actions.do("view.play")
    workspace.watch_tour(0.1)
    assert tour.number == 0 and tour.ticked == 0.0, "playing is not drawing"
    workspace.actions.do("sample.chair")
    workspace.watch_tour(0.1)
    assert tour.number == 0 and tour.ticked > 0.0, "a tick first"
    workspace.watch_tour(5.0)
    assert tour.number == 1
    for _ in TOUR[1:]:
        tour.skip()
    workspace.watch_tour(0.1)
    assert workspace.tour is None and workspace.preferences.toured


def test_the_tour_names_the_keys_that_the_artist_has(workspace: Workspace) -> None:
    workspace.actions.do("help.tour")
    assert workspace.tour is not None and "Press S." in workspace.tour.text
    workspace.actions.give("tool.sketch", "ctrl+f8")
    assert "Press Ctrl+F8." in workspace.tour.text
    for _ in TOUR:
        assert "{" not in workspace.tour.text, workspace.tour.text
        workspace.tour.skip()


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_opens_beside_what_is_there_and_is_undone(workspace: Workspace, name: str) -> None:
    for count in (1, 2):
        assert workspace.actions.do(f"sample.{name}")
        assert len(workspace.editor.project.characters) == count
    assert workspace.editor.playing == (name == "cactus")
    if name == "cactus":
        project = workspace.editor.project
        one = next(iter(project.puppets.values()))
        assert not rig_of(one).lacking(project, one) and project.end_of(one) > 5.0
        hands = [rig_of(one).player(project, one)(time).handles[7] for time in (0.0, 3.0)]
        assert np.abs(hands[1] - hands[0]).max() > 0.3, "it dances"
    assert not [toast.text for toast in workspace.editor.toasts.shown if toast.bad]
    workspace.actions.do("edit.undo")
    workspace.actions.do("edit.undo")
    assert not workspace.editor.project.characters


def test_the_start_page_opens_and_closes(workspace: Workspace) -> None:
    workspace.actions.do("help.start")
    assert workspace.starting
    play([Key("s")], HeadlessStage(workspace))
    assert workspace.input.tool.name == "sketch"
    workspace.actions.do("help.start")
    assert not workspace.starting
