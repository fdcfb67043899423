"""Tests from key presses to attached nodes and back: an edge, a link and a viewer app over real sockets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from edge_session import ViewedSession, open_outlet
from patience import wait_until
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.person.body import Body
from enliven.possession import ActorSettings, EmbeddedActor
from enliven_edge.network.outlet import Outlet
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.tracker import Tracker


def make_joints() -> np.ndarray:
    """Returns (20, 3) metres: a person with bent arms."""
    arms_forward = standing_pose(arm_forward=0.1, elbow=1.5)
    return Posture(np.array([0.0, 1.0, -2.5]), arms_forward, model.lengths_for_height(1.75)).joints()


class ChairSession(ViewedSession):
    """An edge with a chair and two people, one inside and one next to it, and a viewer."""

    def __init__(self, outlet: Outlet) -> None:
        mesh = make_chair(0.05)
        graph = DeformationGraph.build(mesh, nodes=48, seed=0)
        self.actor = EmbeddedActor(character_from_graph(mesh, graph, "chair"), graph, ActorSettings(fade=0.1))
        self._joints = make_joints()
        super().__init__(outlet, [self.actor], self._make_people)

    def _make_people(self) -> list[Body]:
        people = [Body(k, self._joints.copy(), np.ones(20), stature=1.75) for k in (1, 2)]
        people[1].joints[:, 0] += 0.05
        return people

    @property
    def cues(self):
        moment = self.document.timeline.find_moment(self.document.timeline.end_ns)
        return moment.cues.get("chair") if moment else None

    @property
    def holders(self) -> dict[int, list[str]]:
        return {hold.body: [grip.parts for grip in hold.attachments] for hold in self.actor.holds}


@pytest.fixture
def session() -> Iterator[ChairSession]:
    with open_outlet() as outlet, ChairSession(outlet) as opened:
        opened.until(
            lambda: opened.cues and opened.document.characters and len(opened.live.scene.bodies) == 2
        )
        yield opened


def test_two_performers_attach_their_parts_by_keys(session: ChairSession) -> None:
    assert session.cues.state == "preview" and not session.cues.attached_mask.any()
    session.live.choose_parts(2)
    whole = set(session.cues.nodes)
    session.until(lambda: set(session.cues.nodes) < whole)
    shown = dict(zip(session.cues.nodes.tolist(), session.cues.strengths.tolist(), strict=True))
    session.live.possess()
    session.until(lambda: session.cues.state == "possessed" and session.cues.held)
    assert session.holders == {1: ["legs"]}
    strengths = session.actor.holds[0].strengths(48)
    held = {int(n): strengths[n] for n in np.flatnonzero(strengths)}
    assert held.keys() == shown.keys() and all(abs(held[n] - shown[n]) < 1 / 255 for n in held)
    session.until(lambda: len(session.live.scene.bodies) == 2)
    session.live.choose_performer()
    session.live.choose_performer()
    words = session.live.possession.describe_choice(int)
    assert words == "Press P to step in with the legs of performer 2"
    session.live.choose_parts(1)
    session.live.possess("join")
    session.until(lambda: set(session.cues.owners[session.cues.attached_mask].tolist()) == {1, 2})
    assert session.holders == {1: ["legs"], 2: ["upper body"]}
    session.live.choose_parts(8)
    session.live.possess("extend")
    session.until(lambda: len(session.holders[2]) == 2 or session.holders[2] == ["head"])
    session.live.release()
    session.until(lambda: session.holders == {1: ["legs"]})
    session.live.possession.body = None
    session.live.release()
    session.until(lambda: session.holders == {})


def test_smoothing_reaches_the_edge_and_refused_lock_is_not_shown(session: ChairSession) -> None:
    session.live.choose_performer()
    session.live.change_smoothing(1)
    session.until(lambda: session.edge.tracker.output.smoothing_amount(1) == 2.0)
    assert session.edge.tracker.output.smoothing_amount(2) == 1.0
    session.live.toggle_lock()
    session.until(lambda: "only the performers of one depth sensor" in session.document.edge.message)
    assert not session.live.possession.locked


def test_key_locks_and_unlocks_tracked_people(session: ChairSession) -> None:
    """The sensor delivers nothing, so only requests are processed, as between two depth frames."""
    session.edge.tracker = Tracker()  # no frame has been read yet

    def process_requests() -> None:
        session.edge.poll_requests()
        session.feed.poll(session.document)

    for wanted, ids in ((True, frozenset()), (False, None)):
        session.live.toggle_lock()
        wait_until(lambda wanted=wanted: session.live.possession.locked == wanted, step=process_requests)
        assert session.edge.tracker.locked_ids == ids


def test_refused_possession_is_reported(session: ChairSession) -> None:
    session.live.possession.body = 9
    session.live.possess()
    session.until(lambda: "performer 9 is not in view" in session.document.edge.message)
