"""Tests of clips on the timeline for all rigs: handles can be clicked where they are drawn, and a drag is one
edit.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "modeling"))
from test_character_laws import WORLDS

from enliven.document.project import Project, are_identical
from enliven.modeling.edits import (
    add_marker,
    blend_clips,
    change_layers,
    find_layer_clips,
    paste_character,
    split_clip,
    trim_clip,
)
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.features.timeline.clip_commands import ClipCommands
from enliven_viewer.studio.features.timeline.clip_pictures import POSE_COUNT, TILE_SIZE, ClipPictures
from enliven_viewer.studio.features.timeline.layout import HEAD_HEIGHT, LANE_HEIGHT, TimelineLayout
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.workspace.workspace import Workspace

RIGS = ("bones", "graph", "points")
rigs = pytest.mark.parametrize("rig", RIGS)
FAR = 60.0
"""A distance in pixels that is beyond the range of snapping."""


def all_rigs() -> tuple[Project, dict[str, str]]:
    project, names = Project(), {}
    for rig in RIGS:
        source, name = WORLDS[rig]
        project, names[rig] = paste_character(project, source, name)
        numbers = range(len(project.characters[names[rig]].playing))
        project = change_layers(project, names[rig], numbers, offset=0.5, speed=1.0, loop=False)
    return project, names


PROJECT, NAMES = all_rigs()


def desk(tmp_path: Path, project: Project = PROJECT) -> Workspace:
    from enliven_viewer.studio.editor.editor import Editor

    workspace = Workspace(Editor(project=project), tmp_path)
    workspace.time_axis.width = 1800.0
    workspace.state(TimelineInput).snapping = False
    return workspace


def bar_of(workspace: Workspace, name: str):
    return next(bar for bar in workspace.state(TimelineInput).layout.bars() if bar.character.id == name)


def drag(workspace: Workspace, x: float, y: float, by: float, **held: bool) -> None:
    timeline = workspace.state(TimelineInput)
    timeline.press(x, y, **held)
    for share in (0.4, 1.0):
        timeline.drag(x + share * by)
    timeline.release(x + by)


@rigs
def test_a_clip_is_moved_trimmed_slipped_and_stretched_each_as_one_edit(rig: str, tmp_path: Path) -> None:
    name = NAMES[rig]
    workspace = desk(tmp_path)
    editor = workspace.editor
    before = editor.project
    bar = bar_of(workspace, name)
    (clip,), y, layout = bar.clips, bar.top + LANE_HEIGHT / 2, workspace.state(TimelineInput).layout
    second = layout.x(1.0) - layout.x(0.0)
    quarter = 0.25 * (clip.end - clip.begin)

    def clip_after(x: float, by: float, word: str, **held: bool):
        drag(workspace, x, y, by, **held)
        assert editor.history.names == (word,), "one edit"
        (clip,) = find_layer_clips(editor.project, name, bar.layers[0])
        editor.undo()
        assert are_identical(editor.project, before)
        return clip

    middle = (bar.left + bar.right) / 2
    moved = clip_after(middle, 0.5 * second, "move clip")
    assert (moved.begin, moved.end) == pytest.approx((clip.begin + 0.5, clip.end + 0.5))
    shorter = clip_after(bar.right, -quarter * second, "trim clip")
    assert (shorter.begin, shorter.end, shorter.speed) == pytest.approx(
        (clip.begin, clip.end - quarter, clip.speed)
    )
    later = clip_after(bar.left, quarter * second, "trim clip")
    assert (later.begin, later.first) == pytest.approx((clip.begin + quarter, clip.first + quarter))
    slipped = clip_after(middle, -0.1 * second, "slip clip", alt=True)
    assert (slipped.begin, slipped.end, slipped.first) == pytest.approx((clip.begin, clip.end, 0.1))
    fast = clip_after(bar.right, -2 * quarter * second, "change speed", ctrl=True)
    assert (fast.begin, fast.end, fast.speed) == pytest.approx((clip.begin, clip.end - 2 * quarter, 2.0))
    assert workspace.editor.selection.character == name


@rigs
def test_touching_clips_are_trimmed_and_their_blend_is_dragged(rig: str, tmp_path: Path) -> None:
    name, numbers = NAMES[rig], tuple(range(len(PROJECT.characters[NAMES[rig]].playing)))[:1]
    (clip,) = find_layer_clips(PROJECT, name, 0)
    lasts = clip.end - clip.begin
    project = split_clip(PROJECT, name, numbers, clip.begin + 0.5 * lasts)
    workspace = desk(tmp_path, blend_clips(project, name, numbers, 0, 0.4 * lasts))
    bar = next(each for each in workspace.state(TimelineInput).layout.bars() if len(each.clips) == 2)
    layout, y = workspace.state(TimelineInput).layout, bar.top + LANE_HEIGHT / 2
    before, after = (clip for clip in bar.clips)
    middle = (layout.x(after.begin) + layout.x(before.end)) / 2
    assert layout.handle_at(middle, y).kind == "blend"
    drag(workspace, middle, y, 0.1 * lasts * (layout.x(1.0) - layout.x(0.0)))
    wide = find_layer_clips(workspace.editor.project, name, numbers[0])
    assert wide[0].end - wide[1].begin == pytest.approx(0.6 * lasts)
    assert layout.handle_at(layout.x(before.end), y).kind == "edge"
    assert layout.handle_at(layout.x(after.begin), y).kind == "begin"


def test_locked_lane_stays_and_folded_lane_has_one_row(tmp_path: Path) -> None:
    workspace = desk(tmp_path)
    timeline = workspace.state(TimelineInput)
    heads = [lane for lane in timeline.layout.lanes() if lane.kind == "head"]
    assert [lane.character.id for lane in heads] == list(PROJECT.characters)
    bar = bar_of(workspace, NAMES["graph"])
    timeline.press(30.0, bar.top + LANE_HEIGHT / 2)
    timeline.release(30.0)
    drag(workspace, (bar.left + bar.right) / 2, bar.top + LANE_HEIGHT / 2, 100.0)
    assert are_identical(workspace.editor.project, PROJECT)
    assert [toast.text for toast in workspace.editor.toasts.shown] == ["This lane is locked"]
    timeline.press(5.0, heads[0].top + HEAD_HEIGHT / 2)
    timeline.release(5.0)
    folded = [lane for lane in timeline.layout.bars() if lane.character.id == heads[0].character.id]
    assert not folded and timeline.folded == {heads[0].character.id}
    solo = LABEL_WIDTH - 20.0
    for muted in (True, False):
        timeline.press(solo, heads[0].top + HEAD_HEIGHT / 2)
        timeline.release(solo)
        others = [
            character
            for key, character in workspace.editor.project.characters.items()
            if key != heads[0].character.id
        ]
        assert {layer.muted for character in others for layer in character.playing} == {muted}


def test_a_drag_sticks_to_what_is_near_and_to_whole_frames_else(tmp_path: Path) -> None:
    project, _ = add_marker(PROJECT, 0.9, "step")
    workspace = desk(tmp_path, project)
    timeline = workspace.state(TimelineInput)
    timeline.snapping = True
    layout, bar = timeline.layout, bar_of(workspace, NAMES["graph"])
    (clip,), y = bar.clips, bar.top + LANE_HEIGHT / 2
    drag(workspace, bar.left + FAR, y, layout.x(0.9) - bar.left + 4.0)
    assert find_layer_clips(workspace.editor.project, NAMES["graph"], 0)[0].begin == pytest.approx(0.9)
    workspace.editor.undo()
    drag(workspace, bar.left + FAR, y, layout.x(0.703) - bar.left)
    begin = find_layer_clips(workspace.editor.project, NAMES["graph"], 0)[0].begin
    assert begin == pytest.approx(21 / 30) and clip.begin == 0.5


def test_markers_are_dragged_jumped_to_and_named(tmp_path: Path) -> None:
    workspace = desk(tmp_path)
    editor, timeline, clips = workspace.editor, workspace.state(TimelineInput), ClipCommands(workspace.editor)
    for time in (0.5, 1.25):
        editor.scrub(time)
        clips.add_marker_at_playhead()
    assert {key: marker.seconds for key, marker in editor.project.markers.items()} == {
        "marker": 0.5,
        "marker 2": 1.25,
    }
    editor.scrub(0.6)
    times = []
    for way in (1, 1, -1, -1, -1):
        clips.go_to_marker(way)
        times.append(editor.time)
    assert times == [1.25, editor.length, 1.25, 0.5, 0.0]
    x = timeline.layout.x(0.5)
    drag(workspace, x, RULER_HEIGHT / 2, timeline.layout.x(0.8) - x)
    assert editor.project.markers["marker"].seconds == pytest.approx(0.8)
    assert editor.history.names[-1] == "move marker"
    assert timeline.double_click(timeline.layout.x(0.8), RULER_HEIGHT / 2) and timeline.marker == "marker"


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-6, 6), st.floats(LABEL_WIDTH, 1700)), min_size=1, max_size=6),
    st.floats(-900, 900),
)
def test_zooming_keeps_the_time_under_the_pointer_and_never_leaves_the_project(notches, pixels) -> None:
    workspace = desk(Path("."), PROJECT)
    timeline = workspace.state(TimelineInput)
    for turned, x in notches:
        before = timeline.layout.time(x)
        timeline.axis.zoom(turned, x)
        layout = timeline.layout
        assert layout.start >= 0.0 and 0.2 < layout.visible_s <= 1.26 * layout.length
        assert layout.start + layout.visible_s <= 1.26 * layout.length
        if 0.0 < layout.start < 1.25 * layout.length - layout.visible_s - 1e-9:
            assert layout.time(x) == pytest.approx(before)
        assert layout.time(layout.x(1.0)) == pytest.approx(1.0)
    timeline.axis.pan(pixels)
    assert timeline.axis.start >= 0.0
    timeline.axis.show_all()
    assert (timeline.axis.start, timeline.axis.span) == (0.0, 0.0)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 0.9), st.floats(0.0, 0.4), st.floats(500, 2500))
def test_every_end_of_every_clip_is_found_where_it_is_drawn(share, blend, width) -> None:
    project, name = WORLDS["graph"]
    (clip,) = find_layer_clips(project, name, 0)
    project = split_clip(project, name, [0], clip.begin + share * (clip.end - clip.begin))
    project = blend_clips(project, name, [0], 0, blend)
    layout = TimelineLayout(4.0, width, project=project)
    (bar,) = layout.bars()
    for number, played in enumerate(bar.clips):
        left, right = layout.x(played.begin), layout.x(played.end)
        handle = layout.handle_at(right, bar.top + LANE_HEIGHT / 2)
        assert handle.kind in ("edge", "begin")
        if right - left > 80 and number == 0:
            assert layout.handle_at(left + 30, bar.top + LANE_HEIGHT / 2).kind in ("bar", "blend", "begin")


@rigs
def test_keys_split_blend_reverse_and_remove_what_is_under_the_playhead(rig: str, tmp_path: Path) -> None:
    name = NAMES[rig]
    workspace = desk(tmp_path)
    editor, press = workspace.editor, workspace.actions.press
    editor.select_only(name)
    editor.select(layer=0)
    bar = bar_of(workspace, name)
    number = bar.layers[0]
    editor.scrub((bar.clips[0].begin + bar.clips[0].end) / 2)
    assert press("shift+s") and len(find_layer_clips(editor.project, name, number)) == 2
    editor.scrub(editor.time - 0.1)
    assert press("shift+b")
    first, second = find_layer_clips(editor.project, name, number)
    assert first.end > second.begin
    assert press("shift+r") and find_layer_clips(editor.project, name, number)[0].speed < 0
    editor.scrub(second.end - 0.05)
    assert press("shift+delete") and len(find_layer_clips(editor.project, name, number)) == 1
    assert editor.history.names == ("split clip", "blend clips", "reverse clip", "remove clip")
    for _ in range(4):
        editor.undo()
    assert are_identical(editor.project, PROJECT)
    editor.scrub(0.0)
    press("shift+s")
    assert editor.toasts.shown[-1].text == "No clip is under the playhead"


def test_clip_pictures_are_drawn_in_the_background() -> None:
    pictures = ClipPictures()
    takes = [PROJECT.take_of(PROJECT.characters[name].playing[0]) for name in NAMES.values()]
    for take in takes:
        pictures.sheet(PROJECT, take)
    pictures.finish()
    for take in takes:
        sheet = pictures.sheet(PROJECT, take)
        assert sheet is not None and sheet.shape == (POSE_COUNT // 8 * TILE_SIZE, 8 * TILE_SIZE, 4)
        tiles = (
            sheet[..., 3]
            .reshape(POSE_COUNT // 8, TILE_SIZE, 8, TILE_SIZE)
            .transpose(0, 2, 1, 3)
            .reshape(POSE_COUNT, TILE_SIZE, TILE_SIZE)
        )
        inked = (tiles > 128).mean((1, 2))
        assert (inked > 0.005).all() and (inked < 0.6).all(), "every pose is a figure, not a blot"
        assert np.abs(tiles[0].astype(int) - tiles[POSE_COUNT // 2]).max() > 100, "it moves"


def test_a_trimmed_clip_leaves_its_pixels_free(tmp_path: Path) -> None:
    name = NAMES["graph"]
    (clip,) = find_layer_clips(PROJECT, name, 0)
    project = trim_clip(PROJECT, name, [0], 0, end=clip.begin + 0.3)
    bar = next(
        each for each in TimelineLayout(4.0, 1500.0, project=project).bars() if each.character.id == name
    )
    layout = TimelineLayout(4.0, 1500.0, project=project)
    assert layout.handle_at(layout.x(clip.begin + 0.6), bar.top + 5).kind == "ruler"
