"""Tests of the timeline rows of overdubbed takes, and of the marked span."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_acting_stage import acting_stage, two_takes

from enliven.document import are_identical
from enliven.modeling.edits import list_alternative_takes
from enliven_viewer.studio.app.time_axis import END_MARGIN, LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.editor.takes import delete_take_row
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.timeline.layout import (
    EDGE_GRAB_DISTANCE,
    TAKES_BUTTON_WIDTH,
    TimelineLayout,
)
from enliven_viewer.studio.features.timeline.take_commands import TakeCommands
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.workspace.workspace import Workspace


@pytest.fixture
def stage(tmp_path: Path) -> Workspace:
    workspace = acting_stage(tmp_path)
    workspace.editor.edit("two takes", two_takes)
    workspace.editor.select_only("limb")
    return workspace


def mine(layout: TimelineLayout) -> list[str]:
    """Returns the recordings in the limb's rows, from the top."""
    return [lane.layer.recorded for lane in layout.bars() if lane.character.id == "limb"]


def test_a_lane_shows_the_take_that_is_heard_and_opens_to_all(stage: Workspace) -> None:
    timeline = stage.state(TimelineInput)
    assert mine(timeline.layout) == ["take 1"]
    (lane,) = (bar for bar in timeline.layout.bars() if bar.character.id == "limb")
    assert timeline.layout.takes(lane) == (1, 2)
    y = lane.top + 4
    timeline.press(LABEL_WIDTH - END_MARGIN - TAKES_BUTTON_WIDTH / 2, y)
    timeline.release(0.0)
    assert mine(timeline.layout) == ["take 1", "take 2"] and timeline.opened == {"take 1"}
    other = [bar for bar in timeline.layout.bars() if bar.character.id == "limb"][1]
    timeline.press(4.0, other.top + 4)
    timeline.release(0.0)
    assert list_alternative_takes(stage.editor.project, "take 1") == {"take 1": False, "take 2": True}
    timeline.opened = frozenset()
    assert mine(timeline.layout) == ["take 2"]


def test_takes_are_heard_by_turns_dropped_and_kept(stage: Workspace) -> None:
    editor, takes = stage.editor, TakeCommands(stage.editor)
    assert (
        takes.audible_take == "take 1" and stage.actions.do("takes.next") and takes.audible_take == "take 2"
    )
    editor.select(layer=1)
    assert stage.actions.do("takes.before") and takes.audible_take == "take 1" and editor.selection.layer == 0
    assert stage.actions.do("takes.drop") and mine(stage.state(TimelineInput).layout) == ["take 2"]
    assert takes.describe_missing() and not stage.actions.do("takes.drop")
    editor.undo()
    assert stage.actions.do("takes.keep")
    assert list_alternative_takes(editor.project, "take 1") == {"take 1": True}
    assert "walk" in editor.project.takes and stage.actions.do("takes.tidy")
    assert set(editor.project.takes) == {"sway", "wave"}


SPANS = st.tuples(st.floats(0.0, 2.0), st.floats(0.3, 2.0)).map(lambda one: (one[0], sum(one)))


@given(SPANS, st.sampled_from(["from", "to", "marked"]), st.floats(-400.0, 400.0))
@settings(max_examples=60)
def test_the_marked_span_is_dragged_by_its_ends_and_as_a_whole(stage_once, span, kind, pixels) -> None:
    timeline: TimelineInput = stage_once.state(TimelineInput)
    timeline.snapping, stage_once.editor.marked_range = False, span
    layout = timeline.layout
    low, high = (layout.x(end) for end in span)
    x = {"from": low, "to": high, "marked": (low + high) / 2}[kind]
    timeline.press(x, RULER_HEIGHT - 2.0)
    assert timeline.held.kind == kind
    timeline.drag(x + pixels)
    timeline.release(x + pixels)
    moved = layout.time(x + pixels) - layout.time(x)
    first, last = stage_once.editor.marked_range
    assert first >= 0.0 and last - first >= 0.1 - 1e-9
    if kind == "marked":
        assert last - first == pytest.approx(span[1] - span[0])
        assert first == pytest.approx(max(span[0] + moved, 0.0))
    else:
        kept = last == pytest.approx(span[1]) if kind == "from" else first == pytest.approx(span[0])
        assert kept, "the other end stays"


@pytest.fixture(scope="module")
def stage_once(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return acting_stage(tmp_path_factory.mktemp("span"))


def test_a_dragged_end_sticks_to_the_playhead_and_without_a_span_the_ruler_scrubs(stage: Workspace) -> None:
    editor, timeline = stage.editor, stage.state(TimelineInput)
    editor.scrub(1.0)
    editor.marked_range = (0.2, 1.6)
    layout = timeline.layout
    timeline.press(layout.x(1.6), 4.0)
    timeline.drag(layout.x(1.0) + 3.0)
    timeline.release(layout.x(1.0) + 3.0)
    assert (
        editor.marked_range == (0.2, pytest.approx(1.0))
        and stage.state(PerformSession).recording.span == editor.marked_range
    )
    bare = replace(layout, marked=None)
    assert bare.handle_at(layout.x(1.6), 4.0).kind == "ruler"
    assert layout.handle_at(layout.x(1.6) + EDGE_GRAB_DISTANCE + 1, 4.0).kind == "ruler"


def test_a_take_is_deleted_by_its_row_of_the_list(stage: Workspace) -> None:
    editor = stage.editor
    shape = editor.project.shape("limb")
    second_take = replace(editor.project.takes["wave"], id="wave 2")
    others = [
        replace(layer, take="wave 2") if layer.recorded == "take 2" else layer for layer in shape.layers
    ]
    before = editor.project.with_takes(second_take).with_characters(shape.with_changes(layers=tuple(others)))
    editor.edit("other take", lambda _: before)
    delete_take_row(editor, "wave 2")
    assert (
        list_alternative_takes(editor.project, "take 1") == {"take 1": True}
        and "wave 2" not in editor.project.takes
    )
    editor.undo()
    assert are_identical(editor.project, before)
    delete_take_row(editor, "walk")
    assert "walk" not in editor.project.takes, "nothing plays it"
    delete_take_row(editor, "sway")
    assert "sway" in editor.project.takes and editor.toasts.shown[-1].is_error, "a character plays it"
