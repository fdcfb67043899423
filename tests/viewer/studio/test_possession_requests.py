"""Tests that pressing Possess acts at once, or as soon as possible, or is refused with advice."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import TIMEOUT_S
from sample_meshes.chair import make_chair
from staged_session import person, staged_sessions

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.wire import ScanMessage
from enliven_viewer.studio.features.perform import possession_requests
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.files import add_sample


def actor(name: str = "chair", **options: object) -> EmbeddedActor:
    mesh = make_chair(0.05)
    graph = DeformationGraph.build(mesh, nodes=48, seed=0)
    return EmbeddedActor(character_from_graph(mesh, graph, name), graph, ActorSettings(**options))


@pytest.fixture
def sitting(tmp_path: Path, monkeypatch) -> Iterator:
    monkeypatch.setattr(possession_requests, "MIN_TIME_IN_VIEW_S", 0.1)
    with staged_sessions(tmp_path) as make:
        yield make


def test_person_in_view_steps_in_at_once(sitting) -> None:
    session = sitting(actor())
    session.connect()
    session.present = [person()]
    session.until(lambda: session.perform.performers)
    session.perform.possession_requests.press()
    assert not session.perform.possession_requests.words
    session.until(lambda: session.held == {"chair"})
    assert not session.toasts


def test_possession_without_people_waits_for_the_first_person(sitting) -> None:
    session = sitting(actor())
    session.connect()
    session.perform.possession_requests.press()
    assert session.perform.possession_requests.words.startswith("No one is in view"), "it is said at once"
    session.run_frames(5)
    assert not session.held and session.perform.possession_requests.is_waiting
    session.present = [person()]
    session.until(lambda: session.held == {"chair"})
    assert not session.perform.possession_requests.is_waiting and not session.toasts


def test_the_next_press_gives_up_one_that_waits(sitting) -> None:
    session = sitting(actor())
    session.connect()
    session.perform.possession_requests.press()
    session.perform.possession_requests.press()
    session.present = [person()]
    session.until(lambda: session.perform.performers)
    session.run_frames(10)
    assert not session.held and not session.perform.possession_requests.is_waiting


def test_press_without_a_performer_ends_with_a_reason(sitting, monkeypatch) -> None:
    monkeypatch.setattr(possession_requests, "MAX_WAIT_S", 0.1)
    session = sitting(actor())
    session.connect()
    session.perform.possession_requests.press()
    session.until(lambda: not session.perform.possession_requests.is_waiting)
    assert session.toasts == [
        ("“Possess” has waited too long", "No one is in view: step in front of the camera")
    ]


def test_refusal_by_the_edge_is_shown_with_advice(sitting) -> None:
    session = sitting(actor(place="fixed"))
    session.connect()
    session.present = [person(z=-9.0)]
    session.until(lambda: session.perform.performers)
    session.perform.possession_requests.press()
    session.until(lambda: session.toasts)
    ((message, remedy),) = session.toasts
    assert message.startswith("No part of the mesh is within") and remedy.startswith("Step into the mesh")
    assert not session.perform.possession_requests.is_waiting


@pytest.mark.slow
def test_a_chosen_character_that_is_not_on_the_stage_is_put_there_first(sitting) -> None:
    session = sitting(actor("bench"))
    session.connect()
    session.present = [person()]
    add_sample(session.editor, "chair")
    session.editor.select_only("chair")
    session.until(lambda: session.perform.performers)
    session.perform.possession_requests.press()
    assert session.perform.possession_requests.words == "chair is being prepared for the stage"
    session.until(lambda: session.held == {"chair"}, "the chair, and not the bench that stood there")


def test_a_press_before_the_stage_is_ready_is_kept(sitting) -> None:
    session = sitting(actor())
    session.perform.connect(str(session.scanning_edge.outlet.publisher.endpoint))
    session.perform.live.is_local = True  # as for a stage that this window started
    session.perform.possession_requests.press()
    assert session.perform.possession_requests.words == session.perform.live.preparation_text
    session.present = [person()]
    session.until(lambda: session.held == {"chair"})


@pytest.mark.parametrize("is_local", [False, True])
def test_a_waiting_press_outlasts_a_silent_edge(sitting, monkeypatch, is_local) -> None:
    session = sitting(actor())
    session.connect()
    session.perform.live.is_local = is_local
    session.until(lambda: len(session.perform.live.document.timeline))
    requests = session.perform.possession_requests

    def press() -> bool:
        if not requests.is_waiting:
            requests.press()
        return requests.is_waiting

    # On a busy machine, the edge may be silent when the button is pressed, and the request is refused.
    session.until(press)
    refused = list(session.toasts)
    session.until(lambda: requests.words.startswith("No one is in view"))
    with monkeypatch.context() as silent:
        silent.setattr(PerformSession, "connected", property(lambda _: False))
        session.run_frames(5)
        assert (
            requests.words
            == "The stage sends nothing. Check that its camera program (enliven edge) is running"
        )
    session.present = [person()]
    session.until(lambda: session.held == {"chair"})
    assert session.toasts == refused


def test_a_new_press_on_a_silent_stage_is_refused(sitting, monkeypatch) -> None:
    session = sitting(actor())
    session.connect()
    monkeypatch.setattr(PerformSession, "connected", property(lambda _: False))
    session.perform.possession_requests.press()
    assert not session.perform.possession_requests.is_waiting
    assert session.toasts == [
        ("The stage sends nothing", "Check that its camera program (enliven edge) is running")
    ]


@pytest.mark.slow
def test_a_press_while_a_scan_is_made_is_for_the_character_that_it_becomes(sitting) -> None:
    session = sitting(actor(), actor("scan"))
    session.connect()
    session.present = [person()]
    session.until(lambda: session.perform.performers and len(session.perform.stage_ids) == 2)
    session.scanning_edge.outlet.send(ScanMessage(1, "scanning"), 0)
    session.until(lambda: session.perform.possession_requests.scan_message.phase == "scanning")
    session.perform.possession_requests.press()
    assert session.toasts == [("The camera is scanning", "Finish or cancel the scan first")]
    session.scanning_edge.outlet.send(ScanMessage(1, "finishing"), 0)
    session.until(lambda: session.perform.possession_requests.scan_message.phase == "finishing")
    session.perform.possession_requests.press()
    assert session.perform.possession_requests.words == "The scan is being turned into a character"
    session.run_frames(5)
    assert not session.held
    session.scanning_edge.outlet.send(ScanMessage(1, "done", character="scan"), 0)
    session.until(lambda: session.held == {"scan"})


def test_a_busy_stage_is_asked_again(sitting, monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.link.edge_connection._COMMAND_TIMEOUT_S", 0.1)
    session = sitting(actor())
    session.connect()
    session.present = [person()]
    session.until(lambda: session.perform.performers)
    session.perform.possession_requests.press()
    end = time.monotonic() + TIMEOUT_S
    while not session.perform.possession_requests.words and time.monotonic() < end:
        session.poll()  # meanwhile the edge compiles, and is otherwise idle
        time.sleep(0.01)
    assert session.perform.possession_requests.words.startswith("The stage is busy")
    session.until(lambda: session.held == {"chair"})


def test_empty_and_missing_stage_are_reported(sitting) -> None:
    session = sitting()
    session.connect()
    session.until(lambda: session.perform.connected)
    session.perform.possession_requests.press()
    assert session.toasts == [("The stage has no character", "Choose a character, and put it on the stage")]
    session.perform.disconnect()
    session.perform.possession_requests.press()
    assert not session.perform.possession_requests.is_waiting
