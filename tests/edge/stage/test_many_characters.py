"""Tests of several characters on one stage: assigning performers, and continuity when one comes or goes."""

import uuid

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.recording import Recording
from enliven.samples.shipped import cactus_project
from enliven.wire import (
    POSE,
    REQUEST,
    STREAMS,
    Browse,
    CharacterMessage,
    PoseCodec,
    PoseMessage,
    Possess,
    Release,
    Request,
    message_to_character,
    pack_control,
    unpack_control,
)
from enliven_edge.commands.preparation import prepare_actors
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import CharacterSettings, EdgeSettings, WireSettings, characters_from_options
from enliven_edge.stage.choice import pair_nearest
from enliven_edge.stage.initial_possession import InitialPossession
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

from ..matching.rigs_for_stage import star
from .test_stage import FRAME, person


@pytest.fixture(scope="module")
def graph():
    return make_chair(0.05), DeformationGraph.build(make_chair(0.05), nodes=24, seed=0)


def chair(graph, name: str) -> EmbeddedActor:
    return EmbeddedActor(character_from_graph(*graph, name), graph[1], ActorSettings(fade=0.0))


def held(stage: Stage) -> dict[str, list[int]]:
    return {name: [hold.body for hold in actor.holds] for name, actor in stage.actors.items()}


def after(stage: Stage, bodies, frame: int):
    """Returns the poses after a frame, by character."""
    return {pose.character: pose for pose in stage.perform(bodies, frame * FRAME)}


def test_a_stage_of_all_kinds_moves_each_by_its_own_performer(graph):
    project = cactus_project()
    actors = [chair(graph, "chair"), RigActor(star()), PuppetActor(project, project.puppet("cactus"))]
    stage = Stage(actors)
    people = [person(x=-2.0, id=1), person(x=0.0, id=2), person(x=2.0, id=3)]
    poses = after(stage, people, 0)
    assert list(poses) == ["chair", "star", "cactus"] == list(stage.cues())
    for name, who in zip(poses, people, strict=True):
        stage.possess(name, who.id)
    assert held(stage) == {"chair": [1], "star": [2], "cactus": [3]} and stage.holders == {1, 2, 3}
    assert [board.character for board in stage.boards()] == ["star"]
    before = after(stage, people, 1)
    people[1] = person(x=0.0, id=2, elbow=0.2, lift=1.2)
    after(stage, people, 2)
    moved = after(stage, people, 30)
    change = {name: float(np.abs(moved[name].positions - before[name].positions).max()) for name in moved}
    assert change["star"] > 0.05 > 0.01 > change["chair"], "only its own performer moves it"
    stage.release(body=2)
    assert held(stage) == {"chair": [1], "star": [], "cactus": [3]}
    with pytest.raises(InputError, match="performer 2 possesses no character"):
        stage.release(body=2)
    stage.release()
    assert not stage.holders


@pytest.mark.slow
def test_characters_wait_side_by_side_and_the_nearest_is_attached(graph):
    stage = Stage([chair(graph, "a"), chair(graph, "b")])
    poses = after(stage, [person(x=0.0, id=1)], 0)
    low, high = (poses[name].positions[:, 0] for name in "ab")
    assert high.min() > low.max() + 0.2, "no two stand in one place"
    beside = float(high.mean())
    after(stage, [person(x=beside, id=1)], 1)
    stage.possess()
    assert held(stage) == {"a": [], "b": [1]}
    stage.possess(body=1)
    assert held(stage) == {"a": [1], "b": [1]}, "who asks by name may hold a second one"


@pytest.mark.slow
def test_conflict_goes_to_nearest_pair_and_one_character_each(graph):
    stage = Stage([chair(graph, "a"), chair(graph, "b")])
    people = [person(x=0.0, id=1)]
    where = float(after(stage, people, 0)["b"].positions[:, 0].mean())
    people = [person(x=where - 0.3, id=7), person(x=where, id=4)]
    after(stage, people, 1)
    stage.possess()
    assert held(stage) == {"a": [7], "b": [4]}, "4 stands in b; 7, nearer to b too, takes what is left"
    with pytest.raises(InputError, match="no performer in view is free"):
        stage.possess()
    stage.release(body=4)
    stage.possess(mode="join")
    assert held(stage) == {"a": [7], "b": [4]}
    stage.possess(mode="extend", parts="arms")
    assert held(stage) == {"a": [7], "b": [4]}
    stage.possess("a", 4)
    assert held(stage) == {"a": [4], "b": [4]}, "what is named is done"


@pytest.mark.slow
def test_free_performer_has_priority_over_nearer_one(graph):
    stage = Stage([chair(graph, "a"), chair(graph, "b")])
    where = float(after(stage, [person(id=7)], 0)["b"].positions[:, 0].mean())
    people = [person(x=where, id=7), person(x=where + 2.0, id=4)]
    stage.possess("a", 7)
    after(stage, people, 1)
    stage.possess("b")
    assert held(stage) == {"a": [7], "b": [4]}, "7 stands in b, and has a character"
    stage.release("b")
    after(stage, people[:1], 2)
    stage.possess("b")
    assert held(stage) == {"a": [7], "b": [7]}, "where nobody else is there it is asked for by name"


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=5),
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=5),
)
def test_pairs_are_the_nearest_first_by_trying_all(performers, places):
    class Free:
        holds = ()

    bodies = [person(x=x, z=z, id=k) for k, (x, z) in enumerate(performers)]
    names = {f"c{k}": np.array(place) for k, place in enumerate(places)}
    links = pair_nearest(bodies, dict.fromkeys(names, Free()), names, includes_busy=False)
    assert len(links) == min(len(performers), len(places)) == len(dict(links)) == len({w for _, w in links})
    remaining = {(name, body.id) for name in names for body in bodies}
    hips = {body.id: body.joints[0][[0, 2]] for body in bodies}
    for name, who in links:
        metres = {pair: np.linalg.norm(hips[pair[1]] - names[pair[0]]) for pair in remaining}
        assert metres[name, who] == min(metres.values())
        remaining = {(n, w) for n, w in remaining if n != name and w != who}


def test_at_the_opening_each_takes_one_and_a_second_performer_takes_the_second(graph):
    stage = Stage([chair(graph, "a"), chair(graph, "b")])
    opening = InitialPossession(stage, 0.0, {"a": "all", "b": "upper body"})
    after(stage, [person(id=1)], 0)
    opening.possess_if_due(0.0)
    assert held(stage) == {"a": [1], "b": []}
    after(stage, [person(id=1), person(x=1.5, id=2)], 1)
    opening.possess_if_due(0.1)
    assert held(stage) == {"a": [1], "b": [2]}
    assert [grip.parts for grip in stage.actors["b"].holds[0].attachments] == ["upper body"]


def test_a_hold_is_not_handed_to_a_performer_of_another_character(graph):
    stage = Stage([chair(graph, "a"), chair(graph, "b")])
    people = [person(id=1), person(x=1.5, id=2)]
    after(stage, people, 0)
    stage.possess()
    assert stage.holders == {1, 2}
    (mine,) = [name for name, who in held(stage).items() if who == [1]]
    after(stage, people[:1], 1)
    after(stage, people[:1], 10_000)
    assert held(stage)[mine] == [1] and stage.holders == {1, 2}, "2 is away, and 1 has a character"
    after(stage, [*people[:1], person(x=1.5, id=3)], 20_000)
    assert stage.holders == {1, 3}, "3 has none"


@pytest.mark.slow
def test_characters_come_change_and_go_while_others_continue(graph):
    stage = Stage([chair(graph, "a")])
    body = person(id=1)
    after(stage, [body], 0)
    stage.possess("a", parts="legs")
    first = after(stage, [body], 1)
    stage.place_actor(chair(graph, "b"))
    both = after(stage, [body], 2)
    assert list(both) == ["a", "b"] and held(stage) == {"a": [1], "b": []}
    np.testing.assert_allclose(both["a"].positions, first["a"].positions, atol=0.01)
    stage.place_actor(chair(graph, "a"))
    assert held(stage)["a"] == [1], "the performer goes on in the new one"
    assert [grip.parts for grip in stage.actors["a"].holds[0].attachments] == ["legs"]
    again = after(stage, [body], 3)
    np.testing.assert_allclose(again["a"].positions, both["a"].positions, atol=0.02)
    stage.remove("a")
    assert list(after(stage, [body], 4)) == ["b"] and not stage.holders
    with pytest.raises(InputError, match="there is no character 'a'"):
        stage.remove("a")
    stage.possess()
    assert held(stage) == {"b": [1]}


def test_the_command_line_names_any_number_and_ids_are_unique():
    wanted = characters_from_options(["chair", "chair", "cactus"], ["graph"], ["all", "legs", "arms"], {})
    actors, parts = prepare_actors(wanted, EdgeSettings(nodes=16))
    assert [actor.character.id for actor in actors] == ["chair", "chair 2", "cactus"]
    assert parts == {"chair": "all", "chair 2": "legs", "cactus": "arms"}
    named = {"left": CharacterSettings("lamp", parts="arms"), "right": CharacterSettings()}
    assert characters_from_options([], [], [], named) == list(named.items())
    assert characters_from_options([], [], [], {}) == [("", CharacterSettings("chair"))]
    assert characters_from_options(["throne=chair", "a b=c.obj"], [], [], {}) == [
        ("throne", CharacterSettings("chair")),
        ("", CharacterSettings("a b=c.obj")),
    ]
    assert characters_from_options(["x.glb", "y.obj"], ["skeleton", "graph"], [], named) == [
        ("", CharacterSettings("x.glb", "skeleton")),
        ("", CharacterSettings("y.obj", "graph")),
    ]
    with pytest.raises(InputError, match="--parts is given 2 times"):
        characters_from_options(["a", "b", "c"], [], ["all", "legs"], {})
    with pytest.raises(InputError, match="skelton"):
        characters_from_options(["a"], ["skelton"], [], {})


def test_possession_requests_round_trip_without_names():
    for body in (Possess(), Release(), Browse(), Possess("chair", 3, "legs", "join")):
        assert unpack_control(pack_control(Request(1, body)), REQUEST).body == body
    assert Possess().character is None and Release("x").body is None


@pytest.mark.slow
def test_all_are_published_and_recorded_and_each_is_read_by_its_own_character(graph, tmp_path):
    """A character that is added, replaced or removed between frames is recorded with its own revision."""

    class People(Sensor):
        name, fps = "people", 30.0

        def read(self, timeout=None):
            return None

    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "people", record=tmp_path / "two.mcap") as outlet:
        stage = Stage([chair(graph, "a")])
        edge = Edge(People(), Tracker(), stage, outlet)
        frames = iter(BodyFrame([person(id=1)], k * FRAME, "people") for k in range(1, 100))
        edge.step(next(frames))
        stage.place_actor(chair(graph, "b"))
        edge.step(next(frames))
        stage.place_actor(chair(graph, "b"))
        edge.step(next(frames))
        stage.remove("b")
        edge.step(next(frames))
        assert outlet.publisher.revision("b") == 0
        stage.place_actor(chair(graph, "b"))
        edge.step(next(frames))
        assert outlet.publisher.revision("b") == 3, "a viewer sees that it is not the one before"
    take = Recording(tmp_path / "two.mcap")
    assert set(take.info.topics) <= {*STREAMS, "character"}
    messages = _read(take, "character", CharacterMessage)
    codecs = {
        (message.id, message.revision): PoseCodec(message_to_character(message)) for message in messages
    }
    poses = _read(take, POSE.name, PoseMessage)
    published = [(pose.character, pose.revision) for pose in poses]
    assert published == [("a", 1), ("a", 1), ("b", 1), ("a", 1), ("b", 2), ("a", 1), ("a", 1), ("b", 3)]
    assert all(key in codecs for key in published)


def _read(take: Recording, topic: str, kind: type) -> list:
    return [msgspec.msgpack.decode(data, type=kind) for _, data in take.messages(topic)]
