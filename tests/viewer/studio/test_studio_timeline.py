"""Tests of the timeline's geometry: hit-testing equals drawing; rows, ticks, and messages."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strokes import limb

from enliven.document.clip import Clip
from enliven.document.layers import Layer, Ref, Span
from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.modeling.edits import change_layers
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.motion.layers.retarget import bind_chain
from enliven_viewer.studio.app.panel_layout import MIN_TIMELINE_HEIGHT, TIMELINE_HEIGHT, lay_out_panels
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT, TimeAxis
from enliven_viewer.studio.editor.editor import Editor, measure_project_length
from enliven_viewer.studio.features.timeline.layout import LANE_HEIGHT, TimelineLayout, describe_limb
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.puppets.coverage import CoverageCache
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.window.window import measure_elapsed
from enliven_viewer.studio.workspace.files import read_library
from enliven_viewer.studio.workspace.workspace import Workspace


def project_of(offsets: list[float], speeds: list[float], take: str = "wave") -> Project:
    """Returns a shape with one bone per layer. Each layer has its own time map."""
    count = len(offsets) + 1
    names = tuple(f"j{k}" for k in range(count))
    joints = np.stack([np.zeros(count), np.arange(count, dtype=float), np.zeros(count)], 1)
    shape = still_shape("s", Skeleton(names, np.arange(-1, count - 1, dtype=np.int32), joints))
    project = Project().with_takes(*read_library()).with_characters(shape)
    for k, (offset, speed) in enumerate(zip(offsets, speeds, strict=True)):
        project = bind_chain(project, "s", (k, k + 1), take, (0, 1, 2), offset=offset, speed=speed)
    return project


times = st.lists(st.floats(0.0, 4.0), min_size=1, max_size=6)
speeds = st.floats(0.25, 4.0) | st.floats(-4.0, -0.25)


@given(times, st.data(), st.floats(400, 2000))
@settings(max_examples=40, deadline=None)
def test_timeline_handles_are_hit_where_they_are_drawn(offsets, data, width) -> None:
    project = project_of(offsets, [data.draw(speeds) for _ in offsets])
    layout = TimelineLayout(measure_project_length(project, 2.0), width, project=project)
    bars = layout.bars()
    assert len(bars) == len(offsets)
    for bar, offset in zip(bars, offsets, strict=True):
        y = bar.top + LANE_HEIGHT / 2
        assert bar.left == pytest.approx(layout.x(offset))
        assert bar.right <= width
        assert layout.handle_at(bar.right - 0.5, y) == layout.handle_at(bar.right + 0.5, y)
        edge = layout.handle_at(bar.right, y)
        assert (edge.kind, edge.character, edge.layers) == ("edge", bar.character.id, bar.layers)
        if bar.right - bar.left > 20:
            assert layout.handle_at((bar.left + bar.right) / 2, y).kind == "bar"
        assert layout.handle_at(5.0, y).kind == "mute" and layout.handle_at(60.0, y).kind == "label"
    assert layout.handle_at(LABEL_WIDTH + 30, RULER_HEIGHT / 2).kind == "ruler"


@given(st.floats(-2, 10), st.floats(2, 60), st.floats(300, 3000))
def test_pixels_and_times_are_inverse(time: float, length: float, width: float) -> None:
    layout = TimelineLayout(length, width, project=Project())
    assert layout.time(layout.x(time)) == pytest.approx(time, abs=1e-9)


@given(st.floats(0.2, 4000), st.floats(420, 3000))
def test_numbers_on_the_ruler_do_not_touch(length: float, width: float) -> None:
    layout = TimelineLayout(length, width, project=Project())
    numbered = [layout.x(time) for time, number in layout.ticks() if number]
    assert numbered[0] == LABEL_WIDTH and numbered[-1] <= LABEL_WIDTH + layout.track_width + 1e-6
    if length / layout.track_width * 60 <= 300:
        assert all(b - a >= 60 - 1e-6 for a, b in pairwise(numbered))


def test_many_layers_of_one_take_share_a_lane_until_one_is_moved() -> None:
    project = project_of([0.0] * 20, [1.0] * 20)
    layout = TimelineLayout(4.0, 1000.0, project=project)
    assert len(layout.bars()) == 1 and layout.bars()[0].label == "wave  (20 bones)"
    moved = change_layers(project, "s", [layout.bars()[0].layers[7]], offset=0.5)
    assert [len(bar.layers) for bar in TimelineLayout(4.0, 1000.0, project=moved).bars()] == [19, 1]


def test_layers_that_no_shape_uses_have_no_lane() -> None:
    project = project_of([0.0], [1.0])
    shape = project.shapes["s"]
    two = shape.with_changes(layers=(*shape.layers, Layer("idle", "wave", (0, 1))))
    named = [bar.label for bar in TimelineLayout(2.0, 900.0, project=project.with_characters(two)).bars()]
    assert named == ["wave"]
    other = (Layer("idle", "wave", (0, 1)),)
    both = shape.with_changes(spans=(shape.spans[0], (Span(1.0, (Ref("idle", 0.0, 1.0),)),)), layers=other)
    named = [bar.label for bar in TimelineLayout(2.0, 900.0, project=project.with_characters(both)).bars()]
    assert named == ["idle"]


def test_messages_stay_their_time_and_bad_ones_longer() -> None:
    toasts = Toasts(2.0)
    toasts.show_message("done")
    toasts.show_error(InputError("it is flat", where="stroke", remedy="Draw a circle."))
    toasts.show_message("done")
    assert [toast.text for toast in toasts.shown] == ["stroke: it is flat", "done"], "once each"
    assert toasts.shown[0].remedy == "Draw a circle." and toasts.shown[0].is_error
    toasts.advance(3.0)
    assert [toast.is_error for toast in toasts.shown] == [True]
    toasts.advance(1.5)
    assert toasts.shown == ()


def test_loops_play_on_until_they_begin_again_together() -> None:
    def looped(*lengths: float) -> Project:
        project = project_of([0.0] * len(lengths), [2.0 / seconds for seconds in lengths])
        return change_layers(project, "s", range(len(lengths)), loop=True)

    assert measure_project_length(looped(1.8, 1.2), 2.0) == pytest.approx(3.6)
    assert measure_project_length(looped(2.0), 2.0) == pytest.approx(2.0)
    assert measure_project_length(looped(0.5, 0.75), 2.0) == pytest.approx(2.25 + 0.75)
    assert measure_project_length(looped(1.0, 1.618034), 2.0) <= 8.0 + 1.7, "it does not wait for ever"
    assert measure_project_length(project_of([1.0], [1.0]), 2.0) == pytest.approx(3.0), (
        "what does not loop ends"
    )


@given(st.data(), st.floats(RULER_HEIGHT + 80.0, 400.0))
@settings(max_examples=20, deadline=None)
def test_the_lanes_of_what_is_chosen_or_was_recorded_come_into_sight_and_stay_where_they_are_put(data, tall):
    project, names = Project().with_takes(*read_library()), [f"s{number}" for number in range(9)]
    for name in names:
        bones = Skeleton(("a", "b"), np.array([-1, 0], np.int32), np.array([[0.0, 0, 0], [0.0, 1, 0]]))
        project = bind_chain(project.with_characters(still_shape(name, bones)), name, (0, 1), "wave", (0, 1))
    editor = Editor(project=project)
    timeline = TimelineInput(editor, TimeAxis(editor), CoverageCache())
    for _ in range(4):
        wanted, recorded = data.draw(st.sampled_from(names)), data.draw(st.booleans())
        if not recorded:
            editor.select_only(None)
            timeline.scroll_to_recording(tall)
            editor.select_only(wanted)
        timeline.scroll_to_recording(tall, wanted if recorded else "")
        mine = [lane for lane in timeline.layout.lanes() if lane.character.id == wanted]
        assert min(lane.top for lane in mine) >= RULER_HEIGHT
        assert max(lane.top + lane.height for lane in mine) <= tall
        assert timeline.scrolled >= 0.0
    timeline.scrolled = 17.0
    timeline.scroll_to_recording(tall)
    assert timeline.scrolled == 17.0, "nothing new was chosen: the artist's place is kept"


def test_playing_stays_between_the_in_and_out_points(workspace_playing) -> None:
    editor = workspace_playing.editor
    editor.marked_range, editor.playing, editor.loop = (0.5, 1.25), True, True
    editor.time = 0.6
    seen = []
    for _ in range(40):
        editor.advance(0.1)
        seen.append(editor.time)
    assert editor.playing and min(seen) >= 0.5 - 1e-9 and max(seen) <= 1.25 + 1e-9
    assert seen[7] == pytest.approx(0.65), "what passed the out point goes on from the in point"
    editor.loop = False
    for _ in range(20):
        editor.advance(0.1)
    assert editor.time == pytest.approx(1.25) and not editor.playing
    editor.time, editor.playing = 1.6, True
    editor.advance(0.1)
    assert editor.time == pytest.approx(1.7), "beyond the out point the rest plays"


def test_in_and_out_points_are_set_by_actions_and_taken_away(workspace_playing) -> None:
    workspace, editor = workspace_playing, workspace_playing.editor
    editor.scrub(0.5)
    assert workspace.actions.do("view.in_point") and editor.marked_range == (0.5, editor.length)
    editor.scrub(1.0)
    assert workspace.actions.do("view.out_point") and editor.marked_range == (0.5, 1.0)
    editor.scrub(0.25)
    workspace.actions.do("view.out_point")
    assert editor.marked_range == (0.0, 0.25), "an out point before the in point begins a new range"
    assert workspace.actions.do("view.whole_loop") and editor.marked_range is None
    assert not workspace.actions.do("view.whole_loop")


def test_the_playhead_follows_the_clock_over_slow_pictures() -> None:
    assert measure_elapsed(10.0, 10.75) == 0.75
    assert measure_elapsed(10.0, 100.0) == 2.0, "a computer that slept does not jump to the end"


def test_lanes_are_named_by_the_limb_first() -> None:
    assert describe_limb("left leg 1 girdle") == "left hip"
    assert describe_limb("right arm") == "right arm"
    assert describe_limb("left arm 2 girdle") == "left shoulder 2"
    take, clip = "wave of a long name", read_library()[0]
    project = limb_with_two_layers(clip, take)[1]
    names = [bar.label for bar in TimelineLayout(2.0, 900.0, project=project).bars()]
    assert names == [f"left arm, {take}", f"right hip, {take}"]
    assert describe_limb("way") == "path" and describe_limb("whole") == "whole body"


def limb_with_two_layers(clip: Clip, take: str) -> tuple[RiggedCharacter, Project]:
    """Returns a shape with two limbs that one take moves, with names from the retargeting."""
    bones = np.array([[0.0, 0.0], [0.05, 0.3], [0.0, 0.6], [0.0, 0.9]])
    shape = shape_from_stroke(limb(bones, np.array([0.08, 0.07, 0.06, 0.05])), id="limb")
    project = Project().with_takes(replace(clip, id=take)).with_characters(shape)
    for role, chain in (("left arm", (0, 1)), ("right leg 1 girdle", (1, 2))):
        project = bind_chain(project, "limb", chain, take, (0, 1), layer_id=f"{take}: {role}")
    return project.shape("limb"), project


def test_the_timeline_has_the_height_that_it_was_given(tmp_path) -> None:
    assert lay_out_panels(1280, 720).timeline.height == TIMELINE_HEIGHT
    assert lay_out_panels(1280, 720, timeline_height=400.0).timeline.height == 400.0
    low = lay_out_panels(1280, 720, timeline_height=5000.0)
    assert low.timeline.height == pytest.approx(0.75 * 720) and low.viewport.height > 100
    assert lay_out_panels(1280, 720, timeline_height=1.0).timeline.height == MIN_TIMELINE_HEIGHT
    preferences = Preferences(tmp_path)
    preferences.timeline_height = 321.0
    preferences.save()
    assert Preferences(tmp_path).timeline_height == 321.0


@pytest.fixture
def workspace_playing(tmp_path) -> Workspace:
    """Returns a workspace with two seconds of motion."""
    workspace = Workspace.new(Editor(), tmp_path)
    workspace.editor.edit("add", lambda _: limb_with_two_layers(read_library()[0], "wave")[1])
    assert workspace.editor.length >= 2.0
    return workspace
