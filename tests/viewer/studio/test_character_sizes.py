"""Tests that scaling a project's character with both hands is one edit, and that undo reaches the stage."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from edge_session import EdgeSession, open_outlet
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.formats.project.file import parse_project, project_bytes
from enliven.formats.project.one_character import project_of_mesh
from enliven.modeling.edits import handle_characters
from enliven.person import Body, Joint
from enliven.possession import ActorSettings, EmbeddedActor, make_standing_figure
from enliven_edge.network.outlet import Outlet
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.workspace import Workspace

HANDS = [Joint.HAND_LEFT, Joint.HAND_RIGHT]


class ScalingSession(EdgeSession):
    """An edge with a chair and one person, and a workspace with the same chair in its project.

    Attributes:
        hand_distance: distance of the person's hands in metres.
    """

    def __init__(self, outlet: Outlet, folder: Path) -> None:
        mesh = make_chair(0.08)
        graph = DeformationGraph.build(mesh, nodes=24, seed=0)
        settings = ActorSettings(fade=0.1, fade_pace=100.0)
        self.actor = EmbeddedActor(character_from_graph(mesh, graph, "chair"), graph, settings)
        self.hand_distance = 0.5
        super().__init__(outlet, [self.actor], self._make_people)
        self.workspace = Workspace(Editor(project=project_of_mesh(mesh, "chair")), folder)
        self.workspace.editor.select_only("chair")
        self.session = self.workspace.state(PerformSession)
        self.session.active_workspace = "Perform"
        self.session.connect(str(outlet.publisher.endpoint))

    def _make_people(self) -> list[Body]:
        joints = make_standing_figure() + np.array([0.0, 0.0, 2.0])
        middle = joints[HANDS].mean(0)
        joints[HANDS] = middle + np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]]) * self.hand_distance
        return [Body(1, joints, np.ones(20), stature=1.75)]

    def step(self) -> None:
        super().step()
        self.session.advance(0.01)


@pytest.fixture
def scaling(tmp_path) -> Iterator[ScalingSession]:
    with open_outlet() as outlet:
        opened = ScalingSession(outlet, tmp_path)
        yield opened
        opened.session.disconnect()


def test_hand_scaling_is_kept_undone_and_set_again(scaling: ScalingSession) -> None:
    session, editor, sizes = scaling.session, scaling.workspace.editor, scaling.session.sizes
    first = editor.project
    scaling.until(lambda: session.connected and session.performers and "chair" in session.stage_ids)
    assert session.target == "chair" and not scaling.workspace.actions.do("perform.its_own_size_again")
    scaling.workspace.actions.do("perform.scale_with_both_hands_or_let_it_stay")
    scaling.until(lambda: sizes.scaled_character == "chair")
    scaling.until(lambda: sizes.text is not None)
    assert sizes.text[0] == "chair: 100%" and "apart" in sizes.text[1]
    scaling.hand_distance = 1.2
    scaling.until(lambda: sizes.find_size("chair") > 1.6)
    assert editor.project is first, "nothing is kept before it stays"
    scaling.until(lambda: sizes.scaled_character is None)  # until the hands have been still for a while
    assert "This size is kept." in sizes.text
    size = sizes.find_size("chair")
    scaling.until(lambda: editor.project.handling)
    assert editor.project.handling["chair"].size == pytest.approx(size)
    kept = parse_project(project_bytes(editor.project)).handling["chair"]
    assert kept.size == pytest.approx(size), "it is saved"
    # Undo and redo reach the stage.
    editor.undo()
    assert editor.project is first
    scaling.until(lambda: scaling.actor.growth == 1.0 and sizes.find_size("chair") == 1.0)
    editor.redo()
    scaling.until(lambda: scaling.actor.growth == pytest.approx(size, rel=1e-3))
    scaling.until(lambda: not sizes.describe_missing_size("chair"))
    assert scaling.workspace.actions.do("perform.its_own_size_again")
    scaling.until(lambda: scaling.actor.growth == 1.0)
    assert not editor.project.handling, "it is as if it had never been"


@pytest.mark.slow
def test_soft_swing_setting_is_dragged_undone_and_set_again(scaling: ScalingSession) -> None:
    session, editor, actor = scaling.session, scaling.workspace.editor, scaling.actor
    scaling.until(lambda: session.connected and session.performers and "chair" in session.stage_ids)
    assert actor.exaggeration is None, "as the stage's settings say"
    editor.preview_edit(lambda project: handle_characters(project, ["chair"], exaggeration=3.0))
    scaling.until(lambda: actor.exaggeration == 3.0)  # also during the drag
    editor.edit("swing", lambda project: handle_characters(project, ["chair"], exaggeration=2.5))
    scaling.until(lambda: actor.exaggeration == 2.5)
    assert parse_project(project_bytes(editor.project)).handling["chair"].exaggeration == 2.5, "it is saved"
    editor.undo()
    scaling.until(lambda: actor.exaggeration is None)
    editor.redo()
    scaling.until(lambda: actor.exaggeration == 2.5)
    # A restarted edge has lost the setting.
    actor.exaggerate(None)
    scaling.until(lambda: actor.exaggeration == 2.5)
