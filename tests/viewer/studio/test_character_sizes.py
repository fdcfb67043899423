"""Tests that scaling a project's character with both hands is one edit, and that undo reaches the stage."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from patience import TIMEOUT_S
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.formats.project.file import parse_project, project_bytes
from enliven.formats.project.one_character import project_of_mesh
from enliven.frames import BodyFrame
from enliven.modeling.edits import handle_characters
from enliven.person import Body, Joint
from enliven.possession import ActorSettings, EmbeddedActor, make_standing_figure
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.workspace import Workspace

STEP = 33_333_333
HANDS = [Joint.HAND_LEFT, Joint.HAND_RIGHT]


class Person(Sensor):
    """A sensor of one performer with the hands at a given distance, metres."""

    name = "person"

    def __init__(self) -> None:
        self.away, self._count = 0.5, 0

    def read(self, timeout: float | None = None) -> BodyFrame:
        self._count += 1
        joints = make_standing_figure() + np.array([0.0, 0.0, 2.0])
        middle = joints[HANDS].mean(0)
        joints[HANDS] = middle + np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]]) * self.away
        return BodyFrame([Body(1, joints, np.ones(20), stature=1.75)], self._count * STEP, self.name)

    def close(self) -> None: ...


class House:
    """A real edge with a chair, and a workspace with the same chair in its project, in one thread."""

    def __init__(self, outlet: Outlet, folder) -> None:
        mesh = make_chair(0.08)
        graph = DeformationGraph.build(mesh, nodes=24, seed=0)
        self.actor = EmbeddedActor(
            character_from_graph(mesh, graph, "chair"), graph, ActorSettings(fade=0.1, fade_pace=100.0)
        )
        self.person = Person()
        self.edge = Edge(self.person, Tracker(), Stage([self.actor]), outlet)
        self.workspace = Workspace(Editor(project=project_of_mesh(mesh, "chair")), folder)
        self.workspace.editor.select_only("chair")
        self.session = self.workspace.state(PerformSession)
        self.session.active_workspace = "Perform"
        self.session.connect(str(outlet.publisher.endpoint))

    def until(self, done: Callable[[], object]) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.edge.step(self.person.read())
            self.edge.poll_requests()
            self.session.advance(0.01)
            time.sleep(0.002)


@pytest.fixture
def house(tmp_path) -> Iterator[House]:
    with Outlet(WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), "person") as outlet:
        opened = House(outlet, tmp_path)
        yield opened
        opened.session.disconnect()


def test_hand_scaling_is_kept_undone_and_set_again(house: House) -> None:
    session, editor, sizes = house.session, house.workspace.editor, house.session.sizes
    first = editor.project
    house.until(lambda: session.connected and session.performers and "chair" in session.stage_ids)
    assert session.target == "chair" and not house.workspace.actions.do("perform.its_own_size_again")
    house.workspace.actions.do("perform.scale_with_both_hands_or_let_it_stay")
    house.until(lambda: sizes.scaled_character == "chair")
    house.until(lambda: sizes.text is not None)
    assert sizes.text[0] == "chair: 100%" and "apart" in sizes.text[1]
    house.person.away = 1.2
    house.until(lambda: sizes.find_size("chair") > 1.6)
    assert editor.project is first, "nothing is kept before it stays"
    house.until(lambda: sizes.scaled_character is None)  # until the hands have been still for a while
    assert "This size is kept." in sizes.text
    size = sizes.find_size("chair")
    house.until(lambda: editor.project.handling)
    assert editor.project.handling["chair"].size == pytest.approx(size)
    kept = parse_project(project_bytes(editor.project)).handling["chair"]
    assert kept.size == pytest.approx(size), "it is saved"
    # Undo and redo reach the stage.
    editor.undo()
    assert editor.project is first
    house.until(lambda: house.actor.growth == 1.0 and sizes.find_size("chair") == 1.0)
    editor.redo()
    house.until(lambda: house.actor.growth == pytest.approx(size, rel=1e-3))
    house.until(lambda: not sizes.describe_missing_size("chair"))
    assert house.workspace.actions.do("perform.its_own_size_again")
    house.until(lambda: house.actor.growth == 1.0)
    assert not editor.project.handling, "it is as if it had never been"


def test_soft_swing_setting_is_dragged_undone_and_set_again(house: House) -> None:
    session, editor, actor = house.session, house.workspace.editor, house.actor
    house.until(lambda: session.connected and session.performers and "chair" in session.stage_ids)
    assert actor.exaggeration is None, "as the stage's settings say"
    editor.preview_edit(lambda project: handle_characters(project, ["chair"], exaggeration=3.0))
    house.until(lambda: actor.exaggeration == 3.0)  # also during the drag
    editor.edit("swing", lambda project: handle_characters(project, ["chair"], exaggeration=2.5))
    house.until(lambda: actor.exaggeration == 2.5)
    assert parse_project(project_bytes(editor.project)).handling["chair"].exaggeration == 2.5, "it is saved"
    editor.undo()
    house.until(lambda: actor.exaggeration is None)
    editor.redo()
    house.until(lambda: actor.exaggeration == 2.5)
    # A restarted edge has lost the setting.
    actor.exaggerate(None)
    house.until(lambda: actor.exaggeration == 2.5)
