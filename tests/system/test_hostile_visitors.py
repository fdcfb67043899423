"""Tests that visitors can neither block the artist nor grow memory by adding, reserving or leaving
characters.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.document import Character
from enliven.formats.project.one_character import project_of_mesh
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.samples.shipped import load_sample
from enliven.wire import (
    MAX_REVISION,
    STREAMS,
    Awaited,
    CharacterPart,
    Done,
    GetState,
    Hello,
    Possess,
    PutCharacter,
    Refused,
    Release,
    RemoveCharacter,
    Resize,
    Welcome,
    unpack_stream,
)
from enliven_edge import character_upload
from enliven_edge.character_upload import MAX_REVISION_JUMP
from enliven_edge.stage.stage_capacity import StageSettings
from enliven_viewer.link.edge_client import EdgeClient

from ..edge.matching.rigs_for_stage import person
from ..shared.test_logs_escaped import EVIL, is_safe
from .exposed_edge import BOX_DATA, BOX_MESH, ExposedEdge

VISITORS = int(os.environ.get("ENLIVEN_VISITORS", "300"))
"""Number of characters that are added and removed in the soak test. `make test-long` sets 10,000."""


@pytest.fixture
def exposed() -> Iterator[ExposedEdge]:
    started = ExposedEdge()
    yield started
    started.close()


@pytest.mark.parametrize("revision", [2**53, MAX_REVISION, MAX_REVISION + 1, 1 + 2 * MAX_REVISION_JUMP])
def test_a_revision_that_jumps_is_refused_and_newcomers_still_join(
    exposed: ExposedEdge, revision: int
) -> None:
    rude = exposed.visitor()
    answer = rude.put("chair", revision)
    assert isinstance(answer, Refused) and f"revision {revision}" in answer.reason
    assert "Send revision 1." in answer.reason
    assert rude.put("chair", 1) == Done()
    rude.ask(RemoveCharacter("chair"))
    assert rude.put("chair", MAX_REVISION_JUMP) == Done()
    newcomer = EdgeClient([exposed.outlet.publisher.endpoint])
    exposed.until(lambda: "chair" in newcomer.characters, newcomer.poll)
    newcomer.close()


@pytest.mark.slow
def test_the_artist_replaces_a_character_that_a_visitor_put_as_high_as_it_may(exposed: ExposedEdge) -> None:
    rude, artist = exposed.visitor(), EdgeClient([exposed.outlet.publisher.endpoint])
    highest = 0
    for _ in range(3):
        highest += MAX_REVISION_JUMP
        assert rude.put("chair", highest, BOX_DATA) == Done()
        rude.ask(RemoveCharacter("chair"))
    assert rude.put("chair", highest) == Done()
    exposed.until(lambda: artist.edges[0].has_all_characters, artist.poll)
    shown = artist.edges[0].revision("chair")
    assert highest <= shown <= highest + 1
    digest = hashlib.sha256(BOX_DATA).digest()
    assert exposed.visitor().ask(PutCharacter("chair", shown + 1, digest, len(BOX_DATA))) == Done(), (
        "the same"
    )
    answers: list[object] = []
    artist.stage.put(project_of_mesh(load_sample("chair"), "chair"), "chair", then=answers.append)
    exposed.until(lambda: answers, artist.poll)
    assert answers == [Done()]
    exposed.until(lambda: len(artist.characters["chair"].vertices) > 100, artist.poll)
    artist.close()


def put_box(exposed: ExposedEdge, artist: EdgeClient) -> None:
    """Puts a box onto the stage as the artist's window does, and waits until it is there."""
    exposed.until(lambda: artist.status is not None and artist.edges[0].has_all_characters, artist.poll)
    answers: list[object] = []
    artist.stage.put(project_of_mesh(BOX_MESH, "box"), "box", then=answers.append)
    exposed.until(lambda: answers, artist.poll)
    assert answers == [Done()]


@pytest.mark.slow
def test_artist_continues_with_a_restarted_edge() -> None:
    """The artist's revision is higher than a new edge accepts as the first one."""
    exposed = ExposedEdge()
    endpoint = exposed.outlet.publisher.endpoint
    rude, artist = exposed.visitor(), EdgeClient([endpoint])
    assert rude.put("box", MAX_REVISION_JUMP) == Done()
    rude.ask(RemoveCharacter("box"))
    put_box(exposed, artist)
    edge = artist.edges[0]
    exposed.until(lambda: edge.revision("box") > MAX_REVISION_JUMP, artist.poll)
    before = edge.instance
    exposed.close()
    exposed = ExposedEdge(ports=(endpoint.pose_port, endpoint.control_port))
    exposed.until(lambda: edge.instance != before, artist.poll)
    put_box(exposed, artist)
    exposed.until(lambda: edge.revision("box") == 1, artist.poll)
    exposed.close()
    artist.close()


@pytest.mark.slow
def test_the_stage_takes_a_limited_number_of_characters_in_all_and_of_each_visitor() -> None:
    exposed = ExposedEdge(StageSettings(characters=4, per_viewer=2))
    rude, artist = exposed.visitor(), exposed.visitor()
    assert [rude.put(name) for name in "ab"] == [Done(), Done()]
    refused = rude.put("c")
    assert isinstance(refused, Refused) and "this viewer already has 2 characters" in refused.reason
    assert "per_viewer under [stage]" in refused.reason
    assert [artist.put(name) for name in "xy"] == [Done(), Done()]
    refused = exposed.visitor().put("z")
    assert isinstance(refused, Refused) and "the stage is full, because it has 4 characters" in refused.reason
    assert "Remove a character" in refused.reason and "characters under [stage]" in refused.reason
    changed = exposed.visitor().put("x", 2, BOX_DATA)
    assert changed == Done(), "one that has a place is replaced"
    rude.ask(RemoveCharacter("a"))
    assert rude.put("c") == Done()
    assert list(exposed.stage.actors) == ["b", "x", "y", "c"]
    exposed.close()


def test_reconnecting_visitors_share_the_quota_of_their_address() -> None:
    exposed = ExposedEdge(StageSettings(characters=8, per_viewer=2))
    for name in "ab":
        visitor = exposed.visitor()
        assert visitor.put(name) == Done()
        visitor.close()
    exposed.until(lambda: not list(exposed.outlet.publisher._server.connections))
    refused = exposed.visitor().put("c")
    assert isinstance(refused, Refused) and "this viewer already has 2" in refused.reason
    exposed.close()


def test_default_stage_holds_sixteen_characters() -> None:
    exposed = ExposedEdge()
    for number in range(20):
        exposed.stage.places.watch(lambda k=number: [(f"coming {k}", None)])
        if number < 15:
            exposed.stage.places.check("mine", None)
    refused = exposed.visitor().announce("mine")[1]
    assert isinstance(refused, Refused) and "full" in refused.reason
    exposed.close()


def test_undelivered_characters_do_not_block_the_artist(exposed: ExposedEdge) -> None:
    """One visitor reserves four characters and thirty others one each. The artist's character is added at
    once.
    """
    rude = exposed.visitor()
    for name in "abcd":
        rude.announce(name)
    for number in range(30):
        exposed.visitor().announce(f"never {number % 10}")
    assert exposed.visitor().put("mine") == Done()
    assert list(exposed.stage.actors) == ["mine"]


@pytest.mark.parametrize("bytes_each", [0, 1])
def test_reservations_expire_without_enough_data(
    exposed: ExposedEdge, monkeypatch: pytest.MonkeyPatch, bytes_each: int
) -> None:
    rude = exposed.visitor()
    orders = [rude.announce(name)[0] for name in "abcd"]
    received = dict.fromkeys("abcd", 0)
    assert isinstance(rude.announce("e")[1], Refused), "four characters are reserved"
    monkeypatch.setattr(character_upload, "_TIMEOUT_S", 0.3)

    def trickle() -> None:
        for order in orders if bytes_each else []:
            if order.id in received:
                at = received[order.id]
                answer = rude.ask(CharacterPart(order.id, order.digest, at, BOX_DATA[at : at + bytes_each]))
                if isinstance(answer, Awaited):
                    received[order.id] = answer.received
                else:
                    del received[order.id]

    # On a busy machine, the four reservations were made at clearly different times.
    for name in "eabc":
        exposed.until(lambda name=name: rude.announce(name)[1] == Awaited(0), trickle)


def latched(exposed: ExposedEdge) -> list[tuple[str, str]]:
    """Returns topic and key of each stored message that a new viewer receives."""
    welcome = exposed.visitor().ask(Hello("newcomer", True))
    exposed.visitors.pop().close()
    assert isinstance(welcome, Welcome)
    latest = [unpack_stream(each) for each in welcome.latest]
    return [(topic.name, topic.key(message)) for topic, message in latest]


def box_actor(graph: DeformationGraph, box: Character, name: str) -> EmbeddedActor:
    """Returns an actor of a small box, without searching for a person in it."""
    return EmbeddedActor(replace(box, id=name), graph, ActorSettings(), 1.0, None, lambda: None)


def memory() -> float:
    """Returns resident memory in megabytes, after garbage collection."""
    gc.collect()
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_departed_characters_leave_no_memory(
    exposed: ExposedEdge, capsys: pytest.CaptureFixture[str]
) -> None:
    """Characters are added, attached, resized and removed. Memory and messages to new viewers do not grow."""
    viewer, visitor = EdgeClient([exposed.outlet.publisher.endpoint]), exposed.visitor()
    exposed.until(lambda: viewer.status is not None, viewer.poll)
    graph = DeformationGraph.build(BOX_MESH, nodes=8)
    box = character_from_graph(BOX_MESH, graph, "box")
    exposed.people = [person()]
    counts: list[int] = []
    used: list[float] = []
    for number in range(VISITORS):
        name = f"guest {number}"
        exposed.stage.place_actor(box_actor(graph, box, name))
        exposed.frame()
        exposed.edge.carry_out(Resize("set", name, size=1.5))
        if number % 10 == 0:  # attaching and network requests take longer than everything else
            assert visitor.ask(Possess(name)) == Done()
            exposed.frame()
            assert visitor.ask(Release(name)) == visitor.ask(RemoveCharacter(name)) == Done()
        else:
            exposed.frame()
            exposed.edge.carry_out(RemoveCharacter(name))
        exposed.frame()
        viewer.poll()
        if number % (VISITORS // 6) == VISITORS // 6 - 1:
            exposed.frame()
            counts.append(len(latched(exposed)))
            used.append(memory())
    with capsys.disabled():
        if VISITORS > 1000:
            print(f"\n{VISITORS} characters: latched {counts}, MB {[round(each, 1) for each in used]}")
    about = [name for name, topic in STREAMS.items() if topic.is_per_character]
    assert len({*counts}) == 1 and not {name for name, _ in latched(exposed)} & {*about}
    assert used[-1] - used[1] < 8.0, f"memory grows: {used}"
    exposed.until(lambda: viewer.edges[0].has_all_characters, viewer.poll)
    kept = {key for name in about for key in viewer.edges[0].values.latest.get(name, ())}
    assert kept <= {f"guest {VISITORS - 1}"}, "the viewer forgets them, too"
    exposed.stage.place_actor(box_actor(graph, box, "last"))
    newcomer = EdgeClient([exposed.outlet.publisher.endpoint])
    exposed.until(lambda: "last" in newcomer.characters, newcomer.poll, viewer.poll)
    assert isinstance(exposed.visitor().ask(GetState("guest 1")), Refused)
    newcomer.close()
    viewer.close()


@pytest.mark.parametrize("evil", EVIL.values(), ids=EVIL.keys())
def test_text_from_a_visitor_is_escaped_in_the_log(
    exposed: ExposedEdge, evil: str, caplog: pytest.LogCaptureFixture
) -> None:
    if "\ud800" in evil:
        pytest.skip("the wire does not carry lone surrogates")
    visitor = exposed.visitor()
    with caplog.at_level(logging.DEBUG):
        assert visitor.ask(Hello(evil)) is not None
        assert visitor.put(evil) == Done()
        exposed.edge.carry_out(Resize("set", evil, size=1.5))
        damaged = BOX_DATA[:-40] + bytes(40)
        refusals = [
            visitor.put(evil, 2, damaged),
            visitor.put(evil, 2**50, BOX_DATA + b"x"),
            visitor.ask(Possess(evil, 77)),
        ]
        refusals += [visitor.ask(RemoveCharacter(evil)), visitor.ask(RemoveCharacter(evil))]
    logged = [record.getMessage() for record in caplog.records if record.name.startswith("enliven")]
    reasons = [each.reason for each in refusals if isinstance(each, Refused)]
    assert len(reasons) == 4 and any("\\" in text for text in logged)
    assert all(map(is_safe, [*logged, *reasons])) and any("is on the stage" in text for text in logged)
