"""Tests of the start page, samples, and the tour, in the real window and without a window."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window
from strokes import limb
from studio_driver import HeadlessStage, Key, play

from enliven.formats.project.file import read_project
from enliven.modeling.edits import get_rig_edits
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.overdub.possessed_overdub import has_motion
from enliven.samples.shipped import load_sample
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.tour.card_placement import place_arrow, place_card
from enliven_viewer.studio.features.tour.chair_legs import find_leg_to_cut, find_legs
from enliven_viewer.studio.features.tour.feature import TourGuide
from enliven_viewer.studio.features.tour.tour_steps import ENDING, TOUR_STEPS
from enliven_viewer.studio.workspace.files import SAMPLES
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_tour_session.py"
MEANT = (
    *("do Armchair", "recorded person", "possess", "record", "record", "room Animate", "tool cut"),
    *("the leg", "tool carry", "the piece", "menu File", "menu File/Save", "file name", "dialog Save"),
)
"""Widgets and positions in the image to which the tour must point, in order."""
FORBIDDEN = (
    *("chain", "root", "node", "vertex", "vertices", "skeleton", "mesh", "bone", "joint", "rig", "layer"),
    *("take", "edge", "sensor", "track", "project", "performer", "possessed", "deform", "graph", "keyframe"),
)
"""Words that a nine-year-old child does not know in this sense."""
MOST_WORDS = 15


def encloses(outline: list[float], rectangle: list[float]) -> bool:
    """Returns True if an outline surrounds a rectangle of pixels closely."""
    around = outline[0] <= rectangle[0] and outline[1] <= rectangle[1]
    around = around and outline[2] >= rectangle[2] and outline[3] >= rectangle[3]
    return around and max(np.abs(np.subtract(outline, rectangle))) < 12


def kept_chair(path: Path):
    """Returns the only chair in a saved file, and the project."""
    project = read_project(path)
    (chair,) = project.graphs.values()
    return chair, project


@pytest.mark.slow
def test_the_tour_is_taken_by_hand_from_the_start_page_to_the_kept_file(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), "hand")
    assert report["done"], json.dumps(report)
    assert tuple(name for name, _, _ in report["outlines"]) == MEANT
    for name, outline, widget in report["outlines"]:
        assert widget is None or encloses(outline, widget), name
    assert report["resumed"][0] == report["resumed"][1] == 4, "left in the middle, and resumed there"
    assert (
        report["plays before"] and report["holds still"] and report["plays after"] and report["plays merged"]
    )
    assert report["pieces"][0] < 1000 < report["pieces"][1], "one leg was cut off"
    assert report["dance on"] == [True, True]
    chair, project = kept_chair(tmp_path / "Hopping chair.enliven")
    assert has_motion(project, chair) and not report["dirty"] and not report["toasts"]
    assert report["closed"] == [True, True, 0] and report["left the stage"]


@pytest.mark.slow
def test_show_me_does_every_step(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), "show")
    assert report["done"], json.dumps(report)
    assert report["titles"] == [step.title for step in TOUR_STEPS]
    chair, project = kept_chair(tmp_path / "My dancing chair.enliven")
    assert has_motion(project, chair) and not report["dirty"] and not report["toasts"]
    lowest = chair.mesh.vertices[find_legs(chair.mesh)[0], 1].min()
    assert len(find_legs(chair.mesh)) == 3 and lowest < 0.05, "it stands on three legs"


@pytest.mark.parametrize("text", [part.text for step in TOUR_STEPS for part in step.parts] + [ENDING[1]])
def test_each_sentence_is_short_and_of_known_words(text: str) -> None:
    for sentence in re.split(r"(?<=[.!?]) ", text):
        assert len(sentence.split()) <= MOST_WORDS, sentence
    words = re.findall(r"[a-z]+", text.lower())
    assert not {*words} & {*FORBIDDEN}, text


def test_titles_are_a_few_known_words() -> None:
    for title in [*(step.title for step in TOUR_STEPS), ENDING[0]]:
        words = re.findall(r"[a-z]+", title.lower())
        assert len(words) <= 5 and not {*words} & ({*FORBIDDEN} - {"take"}), title


def test_each_button_that_the_tour_names_has_that_name(workspace: Workspace) -> None:
    button_names = {action.entry for action in workspace.actions} | {
        action.menu for action in workspace.actions
    }
    button_names |= {"A recorded person", "Possess", "Record", "Stop", "Perform", "Animate"}
    for step in TOUR_STEPS:
        for part in step.parts:
            assert {*re.findall("“(.+?)”", part.text)} <= button_names, part.text


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace.new(Editor(), tmp_path)


def test_a_step_goes_on_a_moment_after_its_deed_and_not_by_another(workspace: Workspace) -> None:
    workspace.actions.do("help.tour")
    tour = workspace.state(TourGuide).tour
    assert tour is not None and tour.number == 0
    workspace.actions.do("view.play")
    workspace.actions.do("sample.cactus")
    workspace.state(TourGuide).check_progress(0.1)
    assert tour.number == 0 and tour.done_display_s == 0.0, "a cactus is no chair"
    workspace.actions.do("sample.chair")
    workspace.state(TourGuide).check_progress(0.1)
    assert tour.number == 0 and tour.done_display_s > 0.0 and not tour.text, "a tick first"
    workspace.state(TourGuide).check_progress(5.0)
    workspace.state(TourGuide).check_progress(0.1)
    assert tour.number == 1 and tour.target.widgets[0] == "recorded person"
    workspace.state(PerformSession).active_workspace = "Model"
    workspace.state(TourGuide).check_progress(0.1)
    assert tour.target.widgets == ("room Perform",), "the way back to where the step goes on"


def test_back_shows_a_done_step_and_next_goes_on(workspace: Workspace) -> None:
    workspace.actions.do("help.tour")
    workspace.actions.do("sample.chair")
    for _ in range(3):
        workspace.state(TourGuide).check_progress(2.0)
    tour = workspace.state(TourGuide).tour
    assert tour is not None and tour.number == 1
    tour.back()
    for _ in range(3):
        workspace.state(TourGuide).check_progress(2.0)
    assert tour.number == 0 and tour.reviewing, "it stays until Next"
    tour.skip()
    workspace.state(TourGuide).check_progress(0.1)
    assert tour.number == 1 and not tour.reviewing
    tour.skip()
    workspace.state(TourGuide).check_progress(0.1)
    assert TOUR_STEPS[tour.number].title == "Take the scissors", "no step is shown that cannot be done"


def test_the_tour_is_left_and_resumed_where_that_can_be_done(workspace: Workspace, tmp_path: Path) -> None:
    workspace.actions.do("help.tour")
    workspace.actions.do("sample.chair")
    workspace.state(TourGuide).tour.skip()
    workspace.state(TourGuide).tour.skip()
    workspace.state(TourGuide).check_progress(0.1)
    number = workspace.state(TourGuide).tour.number
    workspace.state(TourGuide).end()
    assert workspace.state(TourGuide).tour is None and workspace.preferences.toured
    workspace.actions.do("help.tour")
    assert workspace.state(TourGuide).tour.number == number, "in the same window"
    later = Workspace.new(Editor(), tmp_path)
    assert later.preferences.tour_step == number
    later.actions.do("help.tour")
    assert later.state(TourGuide).tour.number == 0, "without a chair it begins with one"
    later.actions.do("help.tour")
    assert later.state(TourGuide).tour.number == 0, "begun again while it is taken"


def test_the_tour_goes_back_if_what_a_step_needs_is_lost(workspace: Workspace) -> None:
    workspace.actions.do("help.tour")
    workspace.actions.do("sample.chair")
    workspace.state(TourGuide).tour.skip()
    workspace.state(TourGuide).tour.skip()
    workspace.state(TourGuide).check_progress(0.1)
    assert workspace.state(TourGuide).tour.number > 1
    workspace.actions.do("edit.undo")
    workspace.state(TourGuide).check_progress(0.5)
    assert workspace.state(TourGuide).tour.number > 1, "not at once"
    for _ in range(6):
        workspace.state(TourGuide).check_progress(0.5)
    assert workspace.state(TourGuide).tour.number == 0


@pytest.fixture
def limb_there(workspace: Workspace) -> np.ndarray:
    """Returns (V, 2) pixels of the only shape, which plays."""
    outline = limb(np.array([[0.0, 1.4], [0.0, 1.0], [0.0, 0.5]]), np.array([0.07, 0.06, 0.05]))
    shape = shape_from_stroke(outline, id="limb")
    workspace.editor.edit("add", lambda project: project.with_characters(shape))
    HeadlessStage(workspace)
    return workspace.editor.lens.project(workspace.editor.stage_character("limb").vertices)[0]


@pytest.mark.parametrize("tool", ["cut", "carry"])
@pytest.mark.parametrize("was_playing", [True, False])
def test_playback_pauses_during_a_stroke_and_resumes(
    workspace: Workspace, limb_there: np.ndarray, tool: str, was_playing: bool
) -> None:
    editor, hands = workspace.editor, workspace.input
    editor.time, editor.playing = 1.3, was_playing
    hands.activate_tool(tool)
    x, y = limb_there.mean(0).tolist()
    wide = 20.0 + float(np.ptp(limb_there[:, 0]))
    hands.press((x - wide * (tool == "cut"), y))
    assert not editor.playing
    for share in np.linspace(0.1, 1.0, 9):
        editor.advance(0.05)
        hands.move((float(x - wide + 2 * share * wide), y))
    hands.release((x + wide, y))
    assert editor.playing == was_playing and editor.time == pytest.approx(1.3)
    assert len(editor.project.characters) == 1 + (tool == "cut")
    hands.press((x, y))
    hands.cancel_tool()
    assert editor.playing == was_playing, "also where the stroke is dropped"


def test_the_legs_of_the_armchair_are_found() -> None:
    mesh = load_sample("chair")
    legs = find_legs(mesh)
    assert len(legs) == 4
    middles = np.array([mesh.vertices[leg].mean(0) for leg in legs])
    assert (np.abs(middles[:, 0]) > 0.15).all() and (middles[:, 1] < 0.2).all()


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1000.0, 600.0), (620.0, 421.0)])
def test_tour_stroke_cuts_exactly_one_leg(workspace: Workspace, size: tuple[float, float]) -> None:
    """From each side, a stroke along the arrow removes a part of exactly one leg."""
    workspace.actions.do("sample.chair")
    editor = workspace.editor
    (chair,) = editor.project.graphs.values()
    editor.select_only(chair.id)
    editor.size, rest, strokes = size, chair.mesh.vertices, 0
    box = (rest.min(0), rest.max(0))
    for turn in np.linspace(0.0, 2 * np.pi, 7, endpoint=False):
        editor.camera.frame(box, size[0] / size[1], reset=True)
        editor.camera.orbit(turn, 0.0)
        editor.camera.frame(box, size[0] / size[1], margin=1.5, at_once=True)
        path = find_leg_to_cut(editor, chair).path
        if not path:
            continue
        strokes += 1
        assert draw_cut(workspace, path)
        kept = {tuple(each) for each in editor.project.graphs[chair.id].mesh.vertices.tolist()}
        gone = np.array([tuple(each) not in kept for each in rest.tolist()])
        shares = sorted(float(gone[leg].mean()) for leg in find_legs(chair.mesh))
        assert shares[-1] > 0.25 and shares[-2] == 0.0, shares
        assert gone.sum() < 0.025 * len(rest), "nothing but the leg"
        workspace.actions.do("edit.undo")
        editor.select_only(chair.id)
    assert strokes > 4, "from most sides"


def draw_cut(workspace: Workspace, path: tuple[tuple[float, float], ...]) -> bool:
    """Draws a stroke with the scissors. Returns True if it cut something."""
    workspace.input.activate_tool("cut")
    count, (start, end) = len(workspace.editor.project.graphs), np.array(path)
    workspace.input.press(tuple(start))
    for share in np.linspace(0.0, 1.0, 12):
        workspace.input.move(tuple(start + share * (end - start)))
    workspace.input.release(tuple(end))
    return len(workspace.editor.project.graphs) == count + 1


@pytest.mark.parametrize("window", [(1360.0, 820.0), (640.0, 360.0)])
def test_the_card_covers_nothing_that_is_meant(window: tuple[float, float]) -> None:
    size = (300.0, 130.0)
    places = [(x, y) for x in np.linspace(0, window[0] - 90, 7) for y in np.linspace(0, window[1] - 30, 7)]
    for x, y in places:
        meant = (x, y, x + 90.0, y + 30.0)
        left, top = place_card(size, (0.0, 23.0, *window), meant)
        apart = left >= meant[2] or left + 300.0 <= x or top >= meant[3] or top + 130.0 <= y
        inside = left >= 0 and top >= 23.0 and left + 300.0 <= window[0] and top + 130.0 <= window[1]
        assert apart and inside, (x, y, left, top)
        again = place_card(size, (0.0, 23.0, *window), meant, before=(left, top))
        assert again == (left, top), "it stays where it is"


def test_the_arrow_crosses_no_neighbour_of_its_target() -> None:
    card, target, neighbour = (0.0, 0.0, 100.0, 60.0), (300.0, 20.0, 400.0, 50.0), (180.0, 20.0, 290.0, 50.0)
    assert place_arrow(card, target, [target]) == ((244.0, 35.0), (300.0, 35.0)), "from the card"
    assert place_arrow(card, target, [target, neighbour]) == ((350.0, 106.0), (350.0, 50.0)), "from below"
    below = (300.0, 60.0, 400.0, 90.0)
    above = (300.0, -40.0, 400.0, 10.0)
    assert place_arrow(card, target, [neighbour, below, above]) == ((456.0, 35.0), (400.0, 35.0))
    assert place_arrow(card, (105.0, 0.0, 150.0, 60.0), []) is None, "the card is next to it"


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_opens_next_to_the_others_and_is_undone(workspace: Workspace, name: str) -> None:
    for count in (1, 2):
        assert workspace.actions.do(f"sample.{name}")
        assert len(workspace.editor.project.characters) == count
    assert workspace.editor.playing == (name == "cactus")
    if name == "cactus":
        project = workspace.editor.project
        puppet = next(iter(project.puppets.values()))
        assert not get_rig_edits(puppet).find_missing_data(project, puppet) and project.end_of(puppet) > 5.0
        hands = [get_rig_edits(puppet).create_player(project, puppet)(time).handles[7] for time in (0.0, 3.0)]
        assert np.abs(hands[1] - hands[0]).max() > 0.3, "it dances"
    assert not [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
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
