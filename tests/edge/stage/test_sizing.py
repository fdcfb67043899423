"""Tests of resizing a character with both hands: the gesture, the kept properties, and a continuous
attachment.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.person import Body, Joint
from enliven.possession import Actor, ActorSettings, EmbeddedActor, make_standing_figure
from enliven.possession.placement import Placement
from enliven.wire import MAX_GROWTH, Resize
from enliven_edge.controls.base import orders_from_command
from enliven_edge.stage.sizing import DEAD_BAND, DISTANCE_OFFSET_M, HandSizing
from enliven_edge.stage.stage import Stage

FRAME = 33_333_333
MESH = make_chair(0.08)
GRAPH = DeformationGraph.build(MESH, nodes=24, seed=0)
CHAIR = character_from_graph(MESH, GRAPH, "chair")
FIGURE = make_standing_figure()
OWN = float(np.linalg.norm(FIGURE[Joint.HAND_LEFT] - FIGURE[Joint.HAND_RIGHT]))
few = settings(deadline=None, max_examples=8)


def person(away: float | None = None, id: int = 1, x: float = 0.0) -> Body:
    """Returns a performer with the hands ``away`` metres apart."""
    joints = FIGURE + np.array([x, 0.0, -2.5])
    if away is not None:
        middle = joints[[Joint.HAND_LEFT, Joint.HAND_RIGHT]].mean(0)
        joints[Joint.HAND_LEFT] = middle + np.array([away / 2, 0, 0.0])
        joints[Joint.HAND_RIGHT] = middle - np.array([away / 2, 0, 0.0])
    return Body(id, joints, np.ones(20), stature=1.75)


class Play:
    """A stage with a chair, advanced frame by frame."""

    def __init__(self) -> None:
        self.stage = Stage([EmbeddedActor(CHAIR, GRAPH, ActorSettings(fade=0.1, fade_pace=100.0))])
        self.sizing = HandSizing(self.stage)
        self.time_ns, self.told = 0, []

    @property
    def growth(self) -> float:
        return self.stage.actors["chair"].growth

    def frames(self, body: Body, count: int = 1):
        for _ in range(count):
            self.time_ns += FRAME
            self.sizing.follow([body], self.time_ns)
            (pose,) = self.stage.perform([body], self.time_ns)
            self.told += self.sizing.changes()
        return pose


@pytest.mark.slow
@few
@given(st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_hands_multiply_the_size_within_play_and_bounds_and_it_stays(first, last):
    play = Play()
    play.frames(person(first))
    play.sizing.handle(Resize("hands"))
    play.frames(person(first), 3)
    assert play.growth == 1.0, "nothing happens before the hands move"
    play.frames(person(last), 40)
    ratio = np.log((last + DISTANCE_OFFSET_M) / (first + DISTANCE_OFFSET_M))
    wanted = np.sign(ratio) * max(abs(ratio) - DEAD_BAND, 0.0)
    expected = np.exp(np.clip(wanted, -np.log(MAX_GROWTH), np.log(MAX_GROWTH)))
    assert play.growth == pytest.approx(expected, rel=0.01)
    for wobble in (1.03, 0.98, 1.0):
        before = play.growth
        play.frames(person(last * wobble + DISTANCE_OFFSET_M * (wobble - 1)), 2)
        assert play.growth == pytest.approx(before, rel=0.015), "hands that tremble change nothing"
    play.sizing.handle(Resize("end"))
    stays = play.growth
    play.frames(person(0.3), 20)
    assert play.growth == stays and play.told[-1].body == -1
    assert play.told[-1].size == pytest.approx(stays, rel=1e-6) or abs(stays - 1) < 1e-6


def test_holding_still_ends_it_and_lost_hands_change_nothing():
    play = Play()
    play.frames(person(0.5))
    play.sizing.handle(Resize("hands"))
    play.frames(person(0.5), 90)
    assert play.told[-1].body == 1, "it waits until the hands have moved"
    play.frames(person(1.0), 20)
    grown, lost = play.growth, person(0.1)
    lost.confidence[Joint.HAND_LEFT] = 0.0
    play.frames(lost, 10)
    assert play.growth == pytest.approx(grown, rel=0.02)
    play.frames(person(1.0), 60)
    assert play.told[-1].body == -1 and play.growth == pytest.approx(grown, rel=0.02)


def test_resizing_keeps_the_attachment():
    plain, grown = Play(), Play()
    for play in (plain, grown):
        play.frames(person())
        play.stage.possess("chair", 1)
        play.frames(person(), 5)
    grown.sizing.handle(Resize("set", size=2.0))
    before, after = plain.frames(person(OWN + 0.2), 20), grown.frames(person(OWN + 0.2), 20)
    assert [hold.body for hold in grown.stage.actors["chair"].holds] == [1]
    here = before.positions - before.positions.mean(0)
    there = after.positions - after.positions.mean(0)
    np.testing.assert_allclose(there, 2.0 * here, atol=2e-3)
    np.testing.assert_allclose(after.linear, 2.0 * before.linear, atol=2e-3)
    assert after.positions[:, 1].min() == pytest.approx(2.0 * before.positions[:, 1].min(), abs=5e-3)
    # The chair keeps its size when it is released, attached again, or replaced by an edited version.
    tall = np.ptp(after.positions[:, 1])
    grown.stage.release()
    assert np.ptp(grown.frames(person(), 30).positions[:, 1]) > 0.8 * tall
    grown.stage.possess("chair", 1)
    assert np.ptp(grown.frames(person(), 30).positions[:, 1]) > 0.8 * tall
    grown.stage.place_actor(EmbeddedActor(CHAIR, GRAPH, ActorSettings(fade=0.1, fade_pace=100.0)))
    assert grown.growth == 2.0
    assert np.ptp(grown.frames(person(), 30).positions[:, 1]) > 0.8 * tall


@few
@given(st.floats(0.25, 4.0), st.floats(0.25, 4.0), st.integers(0, 2**32 - 1))
def test_a_placement_grows_about_a_place_and_back(one, other, seed):
    rng = np.random.default_rng(seed)
    about, points = rng.normal(size=3), rng.normal(size=(5, 3))
    place = Placement(float(rng.uniform(0.5, 2)), float(rng.uniform(-3, 3)), rng.normal(size=3))
    grown = place.scale_about(one, about)
    expected = about + one * (place.to_world(points) - about)
    np.testing.assert_allclose(grown.to_world(points), expected, atol=1e-9)
    twice = grown.scale_about(other, about).to_world(points)
    np.testing.assert_allclose(twice, place.scale_about(one * other, about).to_world(points), atol=1e-8)


def test_exaggeration_is_published_kept_by_revisions_and_reset():
    play = Play()
    play.sizing.handle(Resize("exaggerate", "chair", exaggeration=2.5))
    play.frames(person())
    actor = play.stage.actors["chair"]
    assert actor.exaggeration == 2.5 and [message.exaggeration for message in play.told] == [2.5]
    later = EmbeddedActor(CHAIR, GRAPH, ActorSettings(exaggeration=0.5))
    play.stage.place_actor(later)
    play.frames(person())
    assert later.exaggeration == 2.5 and later._swing._exaggeration == 2.5
    play.sizing.handle(Resize("exaggerate", "chair"))
    play.frames(person())
    assert later._swing._exaggeration == 0.5 and play.told[-1].exaggeration is None


def test_rigid_mesh_refuses_follow_through():
    class Stiff(EmbeddedActor):
        exaggerate = Actor.exaggerate  # as for characters with bones, and for puppets

    play = Play()
    play.stage.place_actor(Stiff(CHAIR, GRAPH, ActorSettings()))
    with pytest.raises(
        InputError,
        match=r"exaggerating 'chair': no part of this character can swing freely, .*\. Choose a mesh",
    ):
        play.sizing.handle(Resize("exaggerate", "chair", exaggeration=2.0))


def test_word_scale_starts_and_ends_scaling_and_refusals_are_reported():
    play = Play()
    assert orders_from_command("scale", play.stage) == [Resize("hands")]
    with pytest.raises(InputError, match="nobody is in view"):
        play.sizing.handle(Resize("hands", "chair"))
    with pytest.raises(InputError, match="no character 'ghost'"):
        play.sizing.handle(Resize("hands", "ghost"))
    play.frames(person())
    play.sizing.handle(Resize("hands"))
    assert play.sizing.changes()[-1].body == 1
    play.sizing.handle(Resize("hands"))
    assert play.sizing.changes()[-1].body == -1
    play.sizing.handle(Resize("hands"))
    play.stage.remove("chair")
    play.sizing.follow([person()], play.time_ns + FRAME)
    ended = play.sizing.changes()
    assert [(message.character, message.size, message.body) for message in ended] == [("chair", 1.0, -1)]
