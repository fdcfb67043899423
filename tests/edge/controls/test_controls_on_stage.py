"""Tests that a press on a real serial port reaches the stage through a real edge, like a viewer's key."""

from __future__ import annotations

import contextlib
import logging
import sys
from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven.wire import CALLS
from enliven_edge.controls.base import WORDS, Press, check_map
from enliven_edge.controls.control_set import Controls, open_controls
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import SensorFault
from enliven_edge.service import Edge
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "matching"))

from edge_session import EdgeSession, GivenPeople, open_outlet
from pedals_for_tests import Pedal
from rigs_for_stage import person, star


class Say:
    """A control that sends the commands set by the test."""

    name = "test"
    is_present = True

    def __init__(self) -> None:
        self.words: list[str] = []

    def read_presses(self) -> list[Press]:
        presses, self.words = [Press(word, word) for word in self.words], []
        return presses

    def show(self, lamps: Lamps) -> None:
        self.lamps = lamps

    def close(self) -> None: ...


class StarSession(EdgeSession):
    """An edge with a star, controls and the given people."""

    def __init__(self, outlet: Outlet, controls: Controls) -> None:
        self.actor, self.people = RigActor(star(), MatchingSettings(fade=0.0)), [person()]
        self.actor.preview(None, "arms")
        super().__init__(outlet, [self.actor], lambda: self.people, controls=controls)

    @property
    def shown(self) -> list[str]:
        names = self.actor.live_shape.shape.skeleton.names
        return [names[b.chain[1]][:-2] for b in self.actor.chooser.pick.match.pairs if b is not None]

    @property
    def driven(self) -> list[tuple[int, list[str]]]:
        names = self.actor.live_shape.shape.skeleton.names
        return [(h.body, [names[target[1]][:-2] for _, target in h.pairs]) for h in self.actor.holds]


@pytest.fixture
def outlet():
    with open_outlet() as opened:
        yield opened


def test_pedal_cycles_accepts_and_releases_matches(outlet, tmp_path):
    pytest.importorskip("serial", reason="pyserial is not installed (the extra 'controls')")
    pedal = Pedal(tmp_path / "pedal")
    words = {"A": "possess", "B": "next", "C": "release"}
    settings = ControlSettings("serial", words, port=str(pedal.path), debounce=0.0, retry=0.02)
    with open_controls({"pedal": settings}) as controls:
        session = StarSession(outlet, controls)
        session.step()
        first = session.shown
        session.until(lambda: not controls.missing)
        pedal.send(b"B\n")
        session.until(lambda: session.actor.chooser.pick.place == 1)
        second = session.shown
        assert second != first
        pedal.send(b"A\n")
        # The selection expires after seconds of the sensor's clock, which runs fast here. Only the match
        # shown when the pedal is pressed counts.
        shown = [second]
        session.until(lambda: session.actor.holds or shown.append(session.shown))
        assert session.driven == [(1, shown[-1])]
        pedal.send(b"C\n")
        session.until(lambda: not session.actor.holds)
    pedal.close()


def test_every_control_word_equals_a_viewers_request(outlet, caplog):
    say = Say()
    session = StarSession(outlet, Controls([say]))

    def said(*words: str) -> None:
        say.words = list(words)
        session.edge.poll_requests()
        session.step()

    session.people = []
    session.step()
    said("possess")
    assert "the command 'possess' was refused" in caplog.text and "nobody is in view" in caplog.text
    session.people = [person(), person(left=(0.0, 1.0, 0.0), id=2, at=(1.0, 0.0, -2.5))]
    session.step()
    first = session.shown
    said("next", "next")
    assert session.actor.chooser.pick.place == 2
    said("previous")
    assert session.actor.chooser.pick.place == 1
    said("follow")
    assert session.shown == first
    said("possess")
    assert session.driven == [(1, first)]
    other = session.shown
    said("join")
    assert session.driven == [(1, first), (2, other)]
    said("release")
    assert session.driven == []
    session.actor.preview(2, "arms")
    session.step()
    shown = session.shown
    said("possess")
    assert session.driven == [(2, shown)], "whose match is shown takes it, not the first in view"
    session.actor.preview(None, "legs")
    session.step()
    said("extend")
    ((body, limbs),) = session.driven
    assert body == 2 and len(limbs) == 4 and set(shown) <= set(limbs), "legs, and the arms as before"


def test_parts_are_named_by_a_word(outlet):
    say = Say()
    session = StarSession(outlet, Controls([say]))

    def said(*words: str) -> list[str]:
        say.words = list(words)
        session.edge.poll_requests()
        session.step()
        return [limb for _, limbs in session.driven for limb in limbs]

    session.step()
    assert len(said("possess left arm")) == 1 and len(said("release", "possess arms")) == 2
    assert len(said("extend legs")) == 4, "the arms as before, and the legs"
    said("release")
    said("parts legs")
    assert session.actor.candidate[1] == "legs", "what the next hold takes, which is shown"
    shown = session.shown
    assert said("possess") == shown and len(shown) == 2


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("possess left foo", "Did you mean left foot"),
        ("release legs", "Did you mean 'release'"),
        ("parts", "For example"),
        ("posess", "Did you mean 'possess'"),
    ],
)
def test_impossible_command_is_refused(said, remedy):
    with pytest.raises(InputError) as refused:
        check_map({"A": said}, "controls.pedal.map")
    assert remedy in refused.value.remedy


def test_unsupported_command_is_reported_and_edge_continues(outlet, caplog):
    caplog.set_level(logging.WARNING)
    say = Say()
    session = StarSession(outlet, Controls([say]))
    session.step()
    say.words = ["lock", "unlock", "release", "possess"]
    session.step()
    assert caplog.text.count("only the performers of one depth sensor can be locked") == 2
    assert session.driven == [(1, ["left", "right"])]


def test_lock_command_locks_the_tracker(outlet):
    say = Say()
    edge = Edge(GivenPeople(list), Tracker(), Stage([]), outlet, controls=Controls([say]))
    say.words = ["lock"]
    edge.poll_requests()
    assert edge.tracker.is_locked
    say.words = ["unlock"]
    edge.poll_requests()
    assert not edge.tracker.is_locked


def test_lamps_show_the_stage_and_its_health(outlet):
    say = Say()
    session = StarSession(outlet, Controls([say]))
    session.people = []
    session.step()
    assert say.lamps == Lamps(attract="breathing")
    session.people = [person()]
    session.step()
    assert say.lamps == Lamps(possess="breathing")
    say.words = ["possess"]
    session.step()
    assert say.lamps == Lamps(possess="steady")
    session.edge.tracker = Tracker()  # no frame has been read yet
    session.edge.tracker.lock()
    session.edge.poll_requests()
    assert say.lamps == Lamps(possess="steady", locked="steady")
    session.edge.tracker.unlock()
    session.edge.health.record_read_error(SensorFault("the cable is out", where="people"))
    session.edge._wait()
    session.edge.poll_requests()
    assert say.lamps == Lamps(possess="steady", fault="flashing")
    session.step()
    assert say.lamps == Lamps(possess="steady"), "the sensor is back"


def test_there_are_14_control_words():
    assert len(set(WORDS)) == 14


def test_window_commands_are_forwarded_to_windows(outlet):
    say, heard = Say(), []
    session = StarSession(outlet, Controls([say]))
    with contextlib.closing(EdgeClient([outlet.publisher.endpoint])) as client:

        def came(count: int) -> bool:
            client.poll()
            heard.extend(client.take(CALLS))
            return client.status is not None and client.edges[0].has_all_characters and len(heard) >= count

        def is_subscribed() -> bool:
            """Sends a command again until the first arrives. The edge sends each command only once."""
            say.words = ["stop"]
            return came(1)

        session.until(is_subscribed)
        say.words = ["record", "again", "stop"]
        session.until(lambda: came(1) and {"record", "again"} <= {call.word for call in heard[:-1]})
    assert [(command.word, command.control) for command in heard[-3:]] == [
        (w, "test") for w in ("record", "again", "stop")
    ]
