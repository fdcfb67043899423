"""Tests that missing states of a starting edge are not taken as a sign of an older edge."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from enliven.wire import VOICE, VoiceMessage
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform import stage_switches
from enliven_viewer.studio.features.perform.stage_switches import StagePhysics, StageVoice
from enliven_viewer.studio.settings import StudioSettings

WAITING = "Waiting for the stage"


class Link:
    """An edge client without a network: the test sets the instance and the latest messages."""

    def __init__(self) -> None:
        self.edges = [SimpleNamespace(instance=None)]
        self.messages: dict[str, object] = {}

    def take(self, topic: object) -> list[object]:
        return []

    def latest(self, topic: object) -> dict[str, object]:
        return {"": message} if (message := self.messages.get(topic.name)) else {}


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(stage_switches.time, "monotonic", lambda: now.seconds)
    return now


def test_voice_and_physics_wait_for_a_starting_edge_and_call_only_a_silent_one_older(
    clock: SimpleNamespace,
) -> None:
    editor = Editor(StudioSettings())
    voice, physics, link = StageVoice(editor), StagePhysics(editor), Link()

    def texts() -> tuple[str, str]:
        voice.advance(link, is_near=False)
        physics.advance(link)
        return voice.status, physics.state_text

    assert texts() == (WAITING, WAITING), "no message yet"
    clock.seconds += 600.0
    assert texts() == (WAITING, WAITING), "an edge that compiles for minutes is not an older edge"
    link.edges[0].instance = 7
    assert texts() == (WAITING, WAITING), "the first message, before the states"
    clock.seconds += stage_switches.MAX_FIRST_STATE_DELAY_S + 0.1
    assert all("older" in text for text in texts())
    link.edges[0].instance = 8
    assert texts() == (WAITING, WAITING), "it was restarted"


def test_state_that_arrives_is_shown_and_forgotten_with_the_link(clock: SimpleNamespace) -> None:
    voice, link = StageVoice(Editor(StudioSettings())), Link()
    link.edges[0].instance = 7
    link.messages[VOICE.name] = VoiceMessage(state="off")
    voice.advance(link, is_near=False)
    assert voice.status == "The microphone is off"
    voice.forget()
    assert (voice.state, voice.status) == (None, WAITING)
