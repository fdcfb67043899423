"""Tests of finding matching poses over real sockets: a viewer browses the matches by keys and selects one."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from edge_session import ViewedSession, open_outlet

from enliven_edge.network.outlet import Outlet
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_viewer.live.match_cards import make_cards
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.overlay.match_lines import make_match_rows
from enliven_viewer.settings import ViewerSettings

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "matching"))

from rigs_for_stage import person, star


class StarSession(ViewedSession):
    """An edge with a star and one person with arms in given directions, and a viewer with a camera."""

    def __init__(self, outlet: Outlet) -> None:
        self.actor = RigActor(star(), MatchingSettings(fade=0.1))
        self.left, self.right = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
        super().__init__(outlet, [self.actor], lambda: [person(self.left, self.right)])
        self.camera = OrbitCamera(ViewerSettings().render.opening)
        self.camera.face(0.0, 0.2)
        self.camera.advance(10.0)

    def step(self) -> None:
        super().step()
        self.live.report_view(self.camera.view(1.0))

    @property
    def board(self):
        return self.live.scene.boards.get("star")

    @property
    def tips(self) -> list[str]:
        """Returns the limbs that the viewer highlights, identified by the positions of their tips."""
        names, joints = self.actor.live_shape.shape.skeleton.names, self.actor.live_shape.joints
        lines = self.board.rows[self.board.shown].lines
        return [names[int(np.linalg.norm(joints - line[-1], axis=1).argmin())][:-2] for line in lines]


@pytest.fixture
def session() -> Iterator[StarSession]:
    with open_outlet() as outlet, StarSession(outlet) as opened:
        opened.until(lambda: opened.document.characters and opened.board is not None and opened.board.rows)
        yield opened


def test_viewer_shows_selects_and_accepts_matches(session: StarSession) -> None:
    live, camera = session.live, session.camera
    live.choose_parts(3)  # the arms
    session.until(lambda: len(session.board.rows[0].lines) == 2)
    session.until(lambda: session.tips == ["left", "right"])
    cards = make_cards(live.scene, camera.view(1.6))
    assert len(cards) == 6 and [card.meant for card in cards].index(True) == session.board.shown
    assert all(card.bones.min() >= 0.0 and card.bones[..., 1].max() <= 1.0 for card in cards)
    rows, deep = make_match_rows(live.scene.boards)
    assert len(rows) == 2 * (2 + 3) and deep > 0.0
    session.left = (0.0, 1.0, 0.0)
    session.until(lambda: session.tips == ["up", "right"])
    live.show_other_match(1)
    session.until(lambda: session.board.shown == 1)
    second = session.tips
    live.possess()
    session.until(lambda: session.board.state == "playing")
    assert session.tips == second
    assert make_cards(live.scene, camera.view(1.6)) == ()
    before = session.actor.live_shape.joints
    session.right = (0.0, -1.0, 0.0)
    session.until(lambda: np.abs(session.actor.live_shape.joints - before).max() > 0.2)
    live.release()
    session.until(lambda: session.board.state == "choosing")


def test_edge_ranks_matches_for_the_viewing_direction(session: StarSession) -> None:
    session.live.choose_parts(3)
    session.until(lambda: session.tips == ["left", "right"])
    session.camera.face(np.pi, 0.2)
    session.camera.advance(10.0)
    session.until(lambda: session.tips == ["right", "left"])


def test_the_camera_turns_to_where_the_bones_are_seen(session: StarSession) -> None:
    session.camera.face(1.5, 0.2)
    session.camera.advance(10.0)
    session.live.show_bones(session.camera)
    session.camera.advance(10.0)
    forward = -session.camera.view(1.0).camera_from_world[2, :3]
    assert abs(forward[2]) > 0.75, "most limbs of the star lie across z"
