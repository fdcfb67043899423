"""Tests of the tools on a document without a window: pointer actions, undo, and refusals."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sample_motions
from scipy.spatial.transform import Rotation
from studio_driver import (
    Click,
    Do,
    Drag,
    HeadlessStage,
    JointPlace,
    Key,
    Near,
    OnBone,
    OnTimeline,
    Pixel,
    SourceJoint,
    Wait,
    Widget,
    play,
)

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
from made_bodies import horse, random_motion, shape_with_markers, walk

from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter
from enliven.mapping.model_clips import play_own_clip
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.mapping.map_tool import MapTool
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.workspace.files import read_library
from enliven_viewer.studio.workspace.workspace import Workspace

Limb = Callable[..., RiggedCharacter]


@pytest.fixture
def workspace(make_limb: Limb, tmp_path) -> Workspace:
    """Returns a workspace with two limbs and the library, seen from the front."""
    opened = Workspace.new(Editor(), tmp_path)
    shapes = make_limb("limb", 4), make_limb("arm", 2, 0.6, (0.7, 0.2, 0.0))
    opened.store.new(opened.editor.project.with_characters(*shapes))
    return opened


def do(workspace: Workspace, *actions) -> Workspace:
    play([Key("1"), Wait(1.0), *actions], HeadlessStage(workspace))
    return workspace


def said(workspace: Workspace) -> str:
    return " | ".join(f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown)


def moving(project: Project, shape: str = "limb", take: str = "wave") -> Project:
    count = len(project.shapes[shape].skeleton)
    return bind_chain(project, shape, range(count), take, range(len(project.takes[take].skeleton)))


def test_a_click_chooses_and_a_shift_click_chooses_the_chain(workspace: Workspace) -> None:
    do(workspace, Click(JointPlace("limb", 1)))
    assert (workspace.editor.selection.character, workspace.editor.selection.handle) == ("limb", 1)
    do(workspace, Click(JointPlace("limb", 4), shift=True))
    assert workspace.editor.selection.chain == (1, 2, 3, 4)
    do(workspace, Click(Pixel(0.05, 0.2)))
    assert workspace.editor.selection.character is None and workspace.editor.history.names == ()


def test_drag_of_empty_space_only_turns_the_view(workspace: Workspace) -> None:
    before = workspace.editor.camera.view(1.5).eye
    do(workspace, Drag((Pixel(0.05, 0.3), Pixel(0.2, 0.4))))
    assert np.linalg.norm(workspace.editor.camera.view(1.5).eye - before) > 0.1
    assert workspace.editor.history.names == ()


def test_a_shape_is_carried_as_far_as_the_pointer_goes(workspace: Workspace) -> None:
    do(workspace, Key("g"), Drag((JointPlace("arm", 1), Near(JointPlace("arm", 1), 0, -80))))
    before = workspace.editor.history.project.shapes["arm"].skeleton.positions[0]
    at = workspace.editor.lens.project(
        np.stack([before, workspace.editor.stage_character("arm").handles[0]])
    )[0]
    assert np.abs(at[1] - at[0] - [0.0, -80.0]).max() < 1.5, "the root goes with the pointer"
    assert workspace.editor.history.names == ("move arm",)


def test_escape_drops_a_drag(workspace: Workspace) -> None:
    before = workspace.editor.project
    stage = HeadlessStage(workspace)
    play([Key("g"), Wait(0.5)], stage)
    stage.move((500.0, 300.0))
    joint = workspace.editor.lens.project(workspace.editor.stage_character("arm").handles)[0][1]
    stage.move((float(joint[0]), float(joint[1])))
    stage.button(0, True)
    stage.move((float(joint[0]), float(joint[1]) - 50))
    assert workspace.editor.project is not before
    stage.key("escape")
    stage.button(0, False)
    assert workspace.editor.project is before and workspace.editor.history.names == ()


def test_posing_points_the_bone_at_the_pointer(workspace: Workspace) -> None:
    do(workspace, Key("r"), Drag((JointPlace("limb", 2), Near(JointPlace("limb", 2), 60, 30))))
    shape = workspace.editor.project.shapes["limb"]
    assert np.abs(shape.modeling[2] - [1, 0, 0, 0]).max() > 0.05
    assert np.allclose(shape.modeling[[0, 1, 3, 4]], [1, 0, 0, 0])
    posed = workspace.editor.stage_character("limb")
    assert np.allclose(np.linalg.norm(np.diff(posed.handles, axis=0), axis=1), 0.25)
    workspace.editor.undo()
    assert np.allclose(workspace.editor.project.shapes["limb"].modeling, [1, 0, 0, 0])


def test_posing_at_a_time_leaves_what_moves_it(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    do(
        workspace,
        Do(lambda d: d.editor.scrub(0.8)),
        Key("r"),
        Drag((JointPlace("limb", 4), Near(JointPlace("limb", 4), 50, 50))),
    )
    assert (
        workspace.editor.project.shapes["limb"].spans == workspace.editor.history.project.shapes["limb"].spans
    )
    assert any(spans[0].refs for spans in workspace.editor.project.shapes["limb"].spans)
    assert workspace.editor.time == pytest.approx(0.8)


def test_nodes_are_put_in_where_the_bone_is_clicked_and_taken_out(workspace: Workspace) -> None:
    do(workspace, Key("i"), Click(OnBone("limb", 2, 0.4)))
    skeleton = workspace.editor.project.shapes["limb"].skeleton
    assert len(skeleton) == 6 and workspace.editor.selection.handle == 2
    assert np.allclose(skeleton.positions[2], [0.0, 0.2 + 0.25 + 0.1, 0.0], atol=0.01)
    do(workspace, Key("x"), Click(JointPlace("limb", 2)))
    restored = workspace.editor.project.shapes["limb"].skeleton
    assert len(restored) == 5 and np.allclose(restored.positions[:, 1], [0.2, 0.45, 0.7, 0.95, 1.2])


def test_root_removal_is_refused_with_advice(workspace: Workspace) -> None:
    before = workspace.editor.project
    do(workspace, Key("x"), Click(JointPlace("limb", 0)))
    assert (
        workspace.editor.project is before and "root" in said(workspace) and "cut them off" in said(workspace)
    )


def test_a_chain_is_mapped_by_clicking_and_flipped_with_y(workspace: Workspace) -> None:
    do(
        workspace,
        Click(Widget("take curl")),
        *map(Click, (SourceJoint(0), SourceJoint(5), JointPlace("limb", 0))),
    )
    assert workspace.editor.history.names == ()
    do(workspace, Click(JointPlace("limb", 4)))
    layer = workspace.editor.project.shape("limb").layer("curl")
    assert layer.take == "curl" and layer.chain == (0, 1, 2, 3, 4, 5) and layer.loop
    workspace.editor.scrub(1.2)
    tip = workspace.editor.stage_character("limb").handles[-1]
    do(workspace, Key("y"))
    other = workspace.editor.stage_character("limb").handles[-1]
    assert np.abs(tip - other).max() > 0.05 and workspace.editor.history.names == ("map curl",)
    assert np.abs((tip + other)[0]) < 0.02, "the other way in the picture"


def test_a_chain_that_is_clicked_from_its_end_runs_outwards(workspace: Workspace) -> None:
    do(workspace, Click(Widget("take wave")), *map(Click, (SourceJoint(0), SourceJoint(6))))
    do(workspace, Click(JointPlace("limb", 4)), Click(JointPlace("limb", 0)))
    assert workspace.editor.history.names == ("map wave",)


def test_matches_are_offered_and_one_is_accepted(workspace: Workspace) -> None:
    do(workspace, Click(JointPlace("limb", 0)), Click(Widget("take curl")), Click(Widget("find matches")))
    mapping = workspace.input.tools["map"]
    scores = [offer.score for offer in mapping.offered]
    assert scores and scores == sorted(scores, reverse=True)
    do(workspace, Click(Widget("match 0")))
    assert workspace.editor.history.names == ("map curl",)


def test_a_stroke_cuts_and_both_parts_stay_where_they_are(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    workspace.editor.scrub(0.7)
    before = workspace.editor.stage_character("limb").handles
    middle = OnBone("limb", 3, 0.5)
    do(workspace, Key("c"), Drag((Near(middle, -70, 0), Near(middle, 70, 0))))
    assert set(workspace.editor.project.shapes) == {"limb", "arm", "limb 2"}, said(workspace)
    assert np.allclose(workspace.editor.stage_character("limb").handles[:3], before[:3], atol=1e-9)
    assert np.allclose(workspace.editor.stage_character("limb 2").handles[-2:], before[-2:], atol=1e-9)
    assert workspace.editor.selection.character == "limb 2"


def test_stroke_across_nothing_is_reported(workspace: Workspace) -> None:
    do(workspace, Key("c"), Drag((Pixel(0.05, 0.2), Pixel(0.1, 0.3))))
    assert workspace.editor.history.names == () and "across a limb" in said(workspace)


def test_a_root_dropped_on_a_node_merges_and_undo_takes_apart(workspace: Workspace) -> None:
    before = workspace.editor.project
    do(workspace, Key("g"), Drag((JointPlace("arm", 0), JointPlace("limb", 2))))
    merged = workspace.editor.project
    assert list(merged.shapes) == ["limb"] and len(merged.shapes["limb"].skeleton) == 7
    assert workspace.editor.selection.character == "limb"
    workspace.editor.undo()
    assert set(workspace.editor.project.shapes) == set(before.shapes)
    workspace.editor.redo()
    assert list(workspace.editor.project.shapes) == ["limb"]


def test_a_root_dropped_on_a_bone_puts_a_node_there(workspace: Workspace) -> None:
    do(workspace, Key("g"), Drag((JointPlace("arm", 0), OnBone("limb", 2, 0.5))))
    assert list(workspace.editor.project.shapes) == ["limb"]
    assert len(workspace.editor.project.shapes["limb"].skeleton) == 8


def test_copies_have_motion_of_their_own(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    do(workspace, Click(JointPlace("limb", 0)), Key("ctrl+c"), Key("ctrl+v"), Key("ctrl+v"))
    assert {"limb 2", "limb 3"} <= set(workspace.editor.project.shapes)
    assert [len(shape.layers) for shape in workspace.editor.project.shapes.values() if shape.layers] == [
        1,
        1,
        1,
    ]
    places = [workspace.editor.project.shapes[name].place[0] for name in ("limb", "limb 2", "limb 3")]
    assert places[0] < places[1] < places[2], "side by side"


def test_motion_is_copied_from_chain_to_chain(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    do(workspace, Click(JointPlace("limb", 0)), Click(JointPlace("limb", 4), shift=True), Key("ctrl+shift+c"))
    do(workspace, Click(JointPlace("arm", 2)), Click(JointPlace("arm", 0), shift=True), Key("ctrl+shift+v"))
    assert any(spans[0].refs for spans in workspace.editor.project.shapes["arm"].spans), said(workspace)
    do(workspace, Key("ctrl+shift+x"))
    assert not any(spans[0].refs for spans in workspace.editor.project.shapes["arm"].spans)


@pytest.mark.parametrize("key", ["ctrl+c", "ctrl+d", "ctrl+m", "ctrl+shift+c", "ctrl+shift+d", "delete"])
def test_commands_without_a_selection_give_advice(workspace: Workspace, key: str) -> None:
    before = workspace.editor.project
    do(workspace, Key(key))
    assert workspace.editor.project is before and "chosen" in said(workspace)


def test_scaling_mirroring_and_turning_are_undone_one_by_one(workspace: Workspace) -> None:
    before = workspace.editor.project
    do(workspace, Click(JointPlace("arm", 0)), Key("ctrl+equal"), Key("ctrl+m"), Key("ctrl+left"))
    assert len(workspace.editor.history.names) == 3
    for _ in range(3):
        workspace.editor.undo()
    assert workspace.editor.project is before
    workspace.editor.undo()
    assert "Nothing" in said(workspace)


def test_a_closed_stroke_becomes_a_part_with_bones(workspace: Workspace) -> None:
    angles = np.linspace(0, 2 * np.pi, 30)
    places = tuple(Pixel(0.25 + 0.03 * np.cos(a), 0.5 + 0.25 * np.sin(a)) for a in angles)
    do(workspace, Key("s"), Drag(places, 1.5))
    part = workspace.editor.project.shapes["part"]
    assert len(part.skeleton) >= 2 and part.mesh is not None
    tall = float(
        np.ptp(workspace.editor.lens.project(workspace.editor.stage_character("part").vertices)[0][:, 1])
    )
    assert tall == pytest.approx(0.5 * workspace.editor.size[1], rel=0.12)


def test_dot_creates_no_part(workspace: Workspace) -> None:
    do(workspace, Key("s"), Drag((Pixel(0.2, 0.2), Pixel(0.21, 0.2)), 0.2))
    assert "part" not in workspace.editor.project.shapes and "too short" in said(workspace)


def test_a_clip_is_dragged_in_time_and_trimmed_by_its_end(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    do(workspace, Drag((OnTimeline(0.5, 0), OnTimeline(1.1, 0))))
    assert workspace.editor.project.shape("limb").layer("wave").offset == pytest.approx(0.6, abs=0.02)
    layout = workspace.state(TimelineInput).layout
    bar = layout.bars()[0]
    end = layout.time(bar.right)
    do(workspace, Drag((OnTimeline(end, 0), OnTimeline(end - 1.0, 0))))
    layout = workspace.state(TimelineInput).layout
    assert layout.time(layout.bars()[0].right) == pytest.approx(end - 1.0, abs=0.03)
    assert workspace.editor.project.shape("limb").layer("wave").speed == 1.0
    assert workspace.editor.history.names == ("map", "move clip", "trim clip")


def test_the_ruler_scrubs_and_changes_nothing(workspace: Workspace) -> None:
    do(workspace, Drag((OnTimeline(0.2), OnTimeline(1.5))))
    assert workspace.editor.time == pytest.approx(1.5, abs=0.02) and workspace.editor.history.names == ()


def test_playing_begins_again_at_the_end_or_stops_there(workspace: Workspace) -> None:
    workspace.editor.playing = True
    workspace.editor.advance(workspace.editor.length + 0.25)
    assert workspace.editor.time == pytest.approx(0.25) and workspace.editor.playing
    workspace.editor.loop = False
    workspace.editor.advance(workspace.editor.length)
    assert workspace.editor.time == workspace.editor.length and not workspace.editor.playing


def test_every_motion_of_the_library_can_be_looped_or_stays(workspace: Workspace) -> None:
    for clip in read_library():
        turns = np.abs((clip.turns[0] * clip.turns[-1]).sum(1))
        assert clip.id == "quarter turn" or np.allclose(turns, 1.0, atol=1e-9), clip.id
        steps = np.abs((clip.turns[1:] * clip.turns[:-1]).sum(2))
        assert 2 * np.arccos(np.clip(steps, -1, 1)).max() < 0.35, f"{clip.id} jumps"


def test_a_bone_of_the_library_turns_with_the_bones_before_it() -> None:
    """All bones in every frame are compared with an evaluation of all frames at once."""

    def bends(phase: float) -> list[np.ndarray]:
        return [np.array([phase, 0.3 * bone, -0.5 * phase * bone]) for bone in range(1, 4)]

    clip = sample_motions.make_clip("made", sample_motions.make_chain(3, 0.2), 0.5, bends)
    for frame, turns in enumerate(clip.turns):
        total = Rotation.identity()
        for bone, bend in enumerate(bends(frame / (len(clip.turns) - 1)), start=1):
            total = total * Rotation.from_rotvec(bend)
            turn = Rotation.from_quat(turns[bone], scalar_first=True)
            assert (turn.inv() * total).magnitude() < 1e-9


def test_the_best_view_shows_more_of_the_bones(workspace: Workspace) -> None:
    do(workspace, Click(JointPlace("limb", 0)), Key("7"), Wait(1.0))

    def seen() -> float:
        return float(
            np.ptp(
                workspace.editor.lens.project(workspace.editor.stage_character("limb").handles)[0], axis=0
            ).max()
        )

    from_above = seen()
    do_next = [Key("v"), Wait(1.5)]
    play(do_next, HeadlessStage(workspace))
    assert seen() > 2 * from_above and workspace.editor.history.names == ()


def test_take_of_another_build_gives_advice_or_is_fully_mapped(workspace: Workspace) -> None:
    do(workspace, Click(JointPlace("limb", 0)), Click(Widget("take walk")), Click(Widget("whole body")))
    workspace.editor.background.finish()
    assert workspace.editor.history.names == ("map all of walk",) or "chain by chain" in said(workspace)


def test_whole_body_is_fitted_in_the_background_and_measured(workspace: Workspace) -> None:
    """The result equals the command's: on the floor, stepping, smoothed. Edits made meanwhile are kept."""
    clip, shape = replace(walk(0.3), id="steps"), shape_with_markers("horse", horse())
    tool = workspace.input.tools["map"]
    assert isinstance(tool, MapTool)
    workspace.store.new(workspace.editor.project.with_characters(shape).with_takes(clip))
    editor = workspace.editor
    editor.select_only("horse")
    tool.source.show(clip.id)
    tool.whole_body.travel = True
    tool.map_whole()
    workspace.editor.edit("meanwhile", lambda p: p.drop_character("arm"))
    editor.background.finish()
    assert editor.history.names == ("meanwhile", "map all of steps"), said(workspace)
    assert set(editor.project.shapes) == {"horse", "limb"} and tool.last_mapping is not None
    _, _, plan, quality = tool.last_mapping
    assert plan.travel and plan.steps and quality.slide is not None and quality.slide < 2.5
    low = [joints[:, 1].min() for joints in Player(editor.project, "horse").sample(np.linspace(0, 2, 9))[1]]
    np.testing.assert_allclose(low, horse().positions[:, 1].min(), atol=0.06)


def test_whole_body_honours_loop_box_and_is_replaced_by_remapping(
    workspace: Workspace,
) -> None:
    """The checkbox "loop" also applies to the whole body. A second retargeting replaces the first."""
    clip, shape = replace(walk(0.3), id="steps"), shape_with_markers("horse", horse())
    tool = workspace.input.tools["map"]
    assert isinstance(tool, MapTool)
    workspace.store.new(workspace.editor.project.with_characters(shape).with_takes(clip))
    editor = workspace.editor
    editor.select_only("horse")
    tool.source.show(clip.id)
    poses = []
    for loop in (True, False, False):
        tool.loop = loop
        tool.map_whole()
        editor.background.finish()
        layers = editor.project.shape("horse").layers
        assert layers and all(layer.loop == loop for layer in layers), said(workspace)
        poses.append(Player(editor.project, "horse").sample(np.array([0.5, 0.5 + clip.duration]))[0])
    np.testing.assert_allclose(poses[0][0], poses[0][1], atol=1e-9)
    np.testing.assert_allclose(poses[2], poses[1], atol=1e-9)
    assert np.abs(poses[1][0] - poses[1][1]).max() > 1e-3


def test_a_take_of_the_very_model_is_copied_joint_by_joint(workspace: Workspace) -> None:
    random, shape = np.random.default_rng(4), shape_with_markers("horse", horse())
    clip = random_motion(random, horse(), 6, name="own")
    tool = workspace.input.tools["map"]
    assert isinstance(tool, MapTool)
    workspace.store.new(workspace.editor.project.with_characters(shape).with_takes(clip))
    editor = workspace.editor
    editor.select_only("horse")
    tool.source.show("own")
    tool.map_whole()
    editor.background.finish()
    times = np.arange(5) * clip.step
    np.testing.assert_allclose(Player(editor.project, "horse").sample(times)[0], clip.turns[:5], atol=1e-12)


def test_a_chain_that_is_mapped_ends_the_clip_that_a_model_came_with(workspace: Workspace) -> None:
    clip = random_motion(np.random.default_rng(4), workspace.editor.project.shape("limb").skeleton, 6)
    workspace.store.new(play_own_clip(workspace.editor.project.with_takes(clip), "limb", "take"))
    do(workspace, Click(Widget("take wave")), *(Click(SourceJoint(joint)) for joint in (0, 1)))
    do(workspace, Click(JointPlace("limb", 0)), Click(JointPlace("limb", 2)))
    assert {layer.take for layer in workspace.editor.project.shape("limb").layers} == {"wave"}, said(
        workspace
    )


def test_foot_is_pinned_and_released(workspace: Workspace) -> None:
    workspace.editor.edit("map", moving)
    do(workspace, Click(JointPlace("limb", 4)), Key("p"))
    assert [pin.joint for pin in workspace.editor.project.shapes["limb"].pins] == ["limb 4"], said(workspace)
    do(workspace, Click(JointPlace("limb", 4)), Key("p"))
    assert workspace.editor.project.shapes["limb"].pins == ()
