"""Tests of the timeline rows of puppets: hit-testing equals drawing, and a drag is one edit."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))
from made_studio_puppets import project_with, studio

from enliven.document.constraints import Position
from enliven.document.locomotion import Switch
from enliven.document.project import Project
from enliven.modeling.edits import change_layers
from enliven.modeling.puppet.edits import play_take
from enliven.modeling.puppet.poses import add_key_pose
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT
from enliven_viewer.studio.features.timeline.layout import Lane, TimelineLayout
from enliven_viewer.studio.features.timeline.puppet_lanes import PuppetDetails
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.puppets.puppet_editor import PuppetEditor, get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace

NAMES = ("head", "left", "right", "foot")
SWITCHES = (Switch(0, "contact"), Switch(30, "flight"), Switch(60, "contact"))


def find_puppets(workspace: Workspace) -> PuppetEditor:
    """Returns the puppet editor of a workspace."""
    return get_puppet_editor(workspace.editor)


def posed(times: tuple[float, ...], **changes) -> Project:
    """Returns the star with key poses at times of "sway" in seconds, played by a layer."""
    project = project_with(*NAMES, take="sway")
    rest = project.puppets["star"].rest
    for k, time in enumerate(times):
        project = add_key_pose(project, "star", "sway", time, rest + 0.05 * k)
    return change_layers(project, "star", [0], **changes)


def desk_with(tmp_path: Path, project: Project) -> Workspace:
    workspace, _ = studio(tmp_path, *NAMES)
    workspace.store.new(project)
    workspace.editor.select_only("star")
    return workspace


def row_of(layout: TimelineLayout, kind: str) -> Lane:
    return next(lane for lane in layout.lanes() if lane.kind == kind)


def middle(row: Lane) -> float:
    return row.top + row.height / 2


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-0.5, 2),
    st.floats(0.4, 3) | st.floats(-3, -0.4),
    st.lists(st.integers(8, 22), min_size=1, max_size=5, unique=True),  # half a sway: no pose occurs twice
    st.floats(500, 2000),
    st.floats(0, 60),
)
def test_puppet_lanes_are_hit_where_they_are_drawn(offset, speed, frames, width, scrolled) -> None:
    times = tuple(3 * frame / 30 for frame in frames)
    positions = (Position("left", 45, (0.0, 0.5, 0.0)),)
    project = posed(times, offset=offset, speed=speed, switches=SWITCHES, positions=positions)
    shown = PuppetDetails(project.puppet("star"), lambda take: None, lambda layer: SWITCHES)
    lanes = TimelineLayout(10.0, width, project=project, scrolled=scrolled, details=shown)
    assert [row.kind for row in lanes.lanes()] == ["bar", "poses", "band", "held"]
    tops = [(row.top, row.top + row.height) for row in lanes.lanes()]
    assert all(upper[1] <= lower[0] for upper, lower in itertools.pairwise(tops))
    bare = [lane for lane in lanes.lanes() if middle(lane) >= RULER_HEIGHT]  # the ruler covers the others
    poses = row_of(lanes, "poses")
    for number, x in shown.poses(lanes, poses):
        if x < LABEL_WIDTH or poses not in bare:
            continue
        handle = lanes.handle_at(x, middle(poses))
        assert handle.kind == "pose"
        assert dict(shown.poses(lanes, poses))[handle.item] == pytest.approx(x, abs=7.0)
        assert lanes.find_take_time(poses, x) == pytest.approx(times[number], abs=1e-6)
    band = row_of(lanes, "band")
    for _, left, right in shown.bands(lanes, band)[1:]:
        if left >= LABEL_WIDTH and abs(right - left) > 12 and band in bare:
            handle = lanes.handle_at(left, middle(band))
            assert handle.kind == "switch"
    mark = shown.constraint_marks(lanes, row_of(lanes, "held"))[0][2]
    if mark >= LABEL_WIDTH and row_of(lanes, "held") in bare:
        assert lanes.handle_at(mark, middle(row_of(lanes, "held"))).kind == "held"
    bar = row_of(lanes, "bar")
    assert lanes.handle_at(5.0, middle(bar)).kind == ("mute" if bar in bare else "nothing")
    if bar.right > LABEL_WIDTH and bar in bare:
        assert lanes.handle_at(bar.right, middle(bar)).kind == "edge"


def test_only_the_chosen_puppet_shows_more_than_its_layers() -> None:
    project = play_take(posed((0.0, 0.75)), "star", "walk")
    lanes, chosen = (
        TimelineLayout(
            4.0,
            900.0,
            project=project,
            details=PuppetDetails(puppet, lambda take: None, lambda layer: ()),
        )
        for puppet in (None, project.puppet("star"))
    )
    assert [(row.kind, row.layers) for row in lanes.lanes()] == [("bar", (0,)), ("bar", (1,))]
    assert [row.kind for row in chosen.lanes()] == ["bar", "poses", "band"] * 2
    assert lanes.height < chosen.height


def drag(workspace: Workspace, start: tuple[float, float], x: float, **held: bool) -> None:
    timeline = workspace.state(TimelineInput)
    timeline.press(*start, **held)
    for share in (0.3, 0.7, 1.0):
        timeline.drag(start[0] + share * (x - start[0]))
    timeline.release(x)


@pytest.mark.slow
def test_dragging_a_diamond_retimes_its_key_pose_as_one_edit_and_a_click_opens_it(tmp_path) -> None:
    workspace = desk_with(tmp_path, posed((0.0, 0.75, 2.25), offset=0.5))
    timeline = workspace.state(TimelineInput)
    lanes = timeline.layout
    row = row_of(lanes, "poses")
    x = lanes.find_x(row, 0.75)
    drag(workspace, (x, middle(row)), lanes.find_x(row, 1.2))
    assert workspace.editor.project.puppets["star"].poses[1].time == pytest.approx(1.2, abs=0.02)
    assert workspace.editor.history.names[-1] == "retime a key pose" and not find_puppets(workspace).is_posing
    workspace.editor.undo()
    assert workspace.editor.project.puppets["star"].poses[1].time == 0.75
    timeline.press(x, middle(row))
    timeline.release(x)
    assert find_puppets(workspace).number == 1 and workspace.editor.time == pytest.approx(1.25)


def test_bars_are_moved_stretched_and_muted(tmp_path) -> None:
    workspace = desk_with(tmp_path, posed((0.0, 0.75)))
    timeline = workspace.state(TimelineInput)
    lanes = timeline.layout
    row = row_of(lanes, "bar")
    y, (left, right) = middle(row), (row.left, row.right)
    drag(workspace, (left + 20, y), left + 20 + timeline.layout.x(0.6) - timeline.layout.x(0.0))
    assert workspace.editor.project.puppets["star"].layers[0].offset == pytest.approx(0.6)
    workspace.editor.undo()
    drag(workspace, (right, y), (left + right) / 2, ctrl=True)
    assert workspace.editor.project.puppets["star"].layers[0].speed == pytest.approx(2.0, rel=0.01)
    timeline.press(5.0, y)
    timeline.release(5.0)
    assert workspace.editor.project.puppets["star"].layers[0].muted
    assert workspace.editor.history.names[-2:] == ("change speed", "mute")


def test_switches_are_moved_added_removed_and_found_again(tmp_path) -> None:
    workspace = desk_with(tmp_path, posed((0.0, 0.75, 2.25), switches=SWITCHES))
    timeline = workspace.state(TimelineInput)

    def switches() -> list[tuple[int, str]] | None:
        switches = workspace.editor.project.puppets["star"].layers[0].switches
        return None if switches is None else [(switch.frame, switch.kind) for switch in switches]

    def at(second: float) -> tuple[float, float]:
        lanes = timeline.layout
        row = row_of(lanes, "band")
        return lanes.find_x(row, second), middle(row)

    drag(workspace, at(1.0), at(1.5)[0])
    assert switches() == [(0, "contact"), (45, "flight"), (60, "contact")]
    drag(workspace, at(1.5), at(2.9)[0])
    assert switches() == [(0, "contact"), (59, "flight"), (60, "contact")], "it stops at the next one"
    workspace.editor.undo()
    assert timeline.double_click(*at(0.5))
    assert switches() is not None and (15, "flight") in switches() and len(switches()) == 5
    timeline.press(*at(0.5))
    timeline.release(at(0.5)[0])
    assert workspace.input.key("delete") and switches() == [(0, "contact"), (45, "flight"), (60, "contact")]
    row = row_of(timeline.layout, "band")
    timeline.press(60.0, middle(row))
    timeline.release(60.0)
    assert switches() is None and "star" in workspace.editor.project.puppets


def test_delete_removes_the_constraint_and_then_means_the_puppet(tmp_path) -> None:
    held = (Position("left", 45, (-0.4, 0.5, 0.0)),)
    workspace = desk_with(tmp_path, posed((0.0, 0.75, 2.25), positions=held))
    timeline = workspace.state(TimelineInput)
    lanes = timeline.layout
    row = row_of(lanes, "held")
    x = timeline.rows.details.constraint_marks(lanes, row)[0][2]
    timeline.press(x, middle(row))
    timeline.release(x)
    assert workspace.editor.time == pytest.approx(1.5)
    workspace.input.key("delete")
    assert workspace.editor.project.puppets["star"].layers[0].positions == ()
    assert not timeline.rows.type("delete")


def test_a_click_on_a_suggestion_begins_a_key_pose_there(tmp_path) -> None:
    workspace = desk_with(tmp_path, posed((0.0,)))
    timeline = workspace.state(TimelineInput)
    lanes = timeline.layout
    row = row_of(lanes, "poses")
    second, x = timeline.rows.details.suggest_marks(lanes, row)[0]
    timeline.press(x, middle(row))
    timeline.release(x)
    poses = workspace.editor.project.puppets["star"].poses
    assert len(poses) == 2 and poses[1].time == pytest.approx(second) and find_puppets(workspace).number == 1


def test_the_found_contacts_are_shown_as_soon_as_it_moves(tmp_path) -> None:
    workspace = desk_with(tmp_path, posed((0.0, 0.75, 2.25)))
    find_puppets(workspace).motion_solver.settle(workspace.editor.project, "star")
    lanes = workspace.state(TimelineInput).layout
    bands = workspace.state(TimelineInput).rows.details.bands(lanes, row_of(lanes, "band"))
    assert bands and bands[0][0].frame == 0
    starts, ends = np.array([b[1] for b in bands]), np.array([b[2] for b in bands])
    np.testing.assert_allclose(ends[:-1], starts[1:])


def test_a_scrub_ends_in_the_surface_that_its_time_has_whatever_came_before(tmp_path) -> None:
    project = posed((0.0, 0.75, 2.25))
    scrubbed, fresh = desk_with(tmp_path / "one", project), desk_with(tmp_path / "other", project)
    timeline, layout = scrubbed.state(TimelineInput), scrubbed.state(TimelineInput).layout
    for each in (scrubbed, fresh):
        get_puppet_editor(each.editor).motion_solver.settle(project, "star")
    timeline.press(layout.x(0.1), RULER_HEIGHT / 2)
    for time in (0.4, 1.9, 0.2, 2.2, 1.1):
        timeline.drag(layout.x(time))
        hasty = find_puppets(scrubbed).stage.puppets[0].surface
    fresh.editor.scrub(1.1)
    settled = find_puppets(fresh).stage.puppets[0].surface
    assert scrubbed.editor.scrubbing and np.abs(hasty - settled).max() > 1e-6, "it was solved in haste"
    timeline.release(layout.x(1.1))
    assert not scrubbed.editor.scrubbing
    np.testing.assert_allclose(find_puppets(scrubbed).stage.puppets[0].surface, settled, atol=1e-9)
