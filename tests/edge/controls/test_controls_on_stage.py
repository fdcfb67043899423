"""Tests that a press on a real serial port reaches the stage through a real edge, like a viewer's key."""

from __future__ import annotations

import contextlib
import logging
import sys
import time
import uuid
from pathlib import Path

import pytest

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.wire import CALLS
from enliven_edge.controls.base import WORDS, Press, check_map
from enliven_edge.controls.control_set import Controls, open_controls
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import SensorFault
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.rig.rig_actor import RigActor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "matching"))

from patience import TIMEOUT_S
from pedals_for_tests import Pedal
from rigs_for_stage import person, star

from enliven_edge.sensors.base import Sensor

STEP = 33_333_333


class People(Sensor):
    """A sensor that returns the people in ``bodies``."""

    name = "people"

    def __init__(self) -> None:
        self.bodies, self._count = [person()], 0

    def read(self, timeout: float | None = None) -> BodyFrame:
        self._count += 1
        return BodyFrame(self.bodies, self._count * STEP, self.name)

    def close(self) -> None: ...


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


class House:
    def __init__(self, outlet: Outlet, controls: Controls) -> None:
        self.actor, self.sensor = RigActor(star(), MatchingSettings(fade=0.0)), People()
        self.actor.preview(None, "arms")
        outlet.introduce(self.actor.character)
        self.edge = Edge(self.sensor, Tracker(), Stage([self.actor]), outlet, controls=controls)

    def step(self) -> None:
        self.edge.step(self.sensor.read())
        self.edge.poll_requests()

    def until(self, done) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.step()

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
    with Outlet(WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), "people") as opened:
        yield opened


def test_pedal_cycles_accepts_and_releases_matches(outlet, tmp_path):
    pytest.importorskip("serial", reason="pyserial is not installed (the extra 'controls')")
    pedal = Pedal(tmp_path / "pedal")
    words = {"A": "possess", "B": "next", "C": "release"}
    settings = ControlSettings("serial", words, port=str(pedal.path), debounce=0.0, retry=0.02)
    with open_controls({"pedal": settings}) as controls:
        house = House(outlet, controls)
        house.step()
        first = house.shown
        house.until(lambda: not controls.missing)
        pedal.send(b"B\n")
        house.until(lambda: house.actor.chooser.pick.place == 1)
        second = house.shown
        assert second != first
        pedal.send(b"A\n")
        # The selection expires after seconds of the sensor's clock, which runs fast here. Only the match
        # shown when the pedal is pressed counts.
        shown = [second]
        house.until(lambda: house.actor.holds or shown.append(house.shown))
        assert house.driven == [(1, shown[-1])]
        pedal.send(b"C\n")
        house.until(lambda: not house.actor.holds)
    pedal.close()


def test_every_control_word_equals_a_viewers_request(outlet, caplog):
    say = Say()
    house = House(outlet, Controls([say]))

    def said(*words: str) -> None:
        say.words = list(words)
        house.edge.poll_requests()
        house.step()

    house.sensor.bodies = []
    house.step()
    said("possess")
    assert "the command 'possess' was refused" in caplog.text and "nobody is in view" in caplog.text
    house.sensor.bodies = [person(), person(left=(0.0, 1.0, 0.0), id=2, at=(1.0, 0.0, -2.5))]
    house.step()
    first = house.shown
    said("next", "next")
    assert house.actor.chooser.pick.place == 2
    said("previous")
    assert house.actor.chooser.pick.place == 1
    said("follow")
    assert house.shown == first
    said("possess")
    assert house.driven == [(1, first)]
    other = house.shown
    said("join")
    assert house.driven == [(1, first), (2, other)]
    said("release")
    assert house.driven == []
    house.actor.preview(2, "arms")
    house.step()
    shown = house.shown
    said("possess")
    assert house.driven == [(2, shown)], "whose match is shown takes it, not the first in view"
    house.actor.preview(None, "legs")
    house.step()
    said("extend")
    ((body, limbs),) = house.driven
    assert body == 2 and len(limbs) == 4 and set(shown) <= set(limbs), "legs, and the arms as before"


def test_parts_are_named_by_a_word(outlet):
    say = Say()
    house = House(outlet, Controls([say]))

    def said(*words: str) -> list[str]:
        say.words = list(words)
        house.edge.poll_requests()
        house.step()
        return [limb for _, limbs in house.driven for limb in limbs]

    house.step()
    assert len(said("possess left arm")) == 1 and len(said("release", "possess arms")) == 2
    assert len(said("extend legs")) == 4, "the arms as before, and the legs"
    said("release")
    said("parts legs")
    assert house.actor.candidate[1] == "legs", "what the next hold takes, which is shown"
    shown = house.shown
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
    house = House(outlet, Controls([say]))
    house.step()
    say.words = ["lock", "unlock", "release", "possess"]
    house.step()
    assert caplog.text.count("only the performers of one depth sensor can be locked") == 2
    assert house.driven == [(1, ["left", "right"])]


def test_lock_command_locks_the_tracker(outlet):
    say = Say()
    edge = Edge(People(), Tracker(), Stage([]), outlet, controls=Controls([say]))
    say.words = ["lock"]
    edge.poll_requests()
    assert edge.tracker.is_locked
    say.words = ["unlock"]
    edge.poll_requests()
    assert not edge.tracker.is_locked


def test_lamps_show_the_stage_and_its_health(outlet):
    say = Say()
    house = House(outlet, Controls([say]))
    house.sensor.bodies = []
    house.step()
    assert say.lamps == Lamps(attract="breathing")
    house.sensor.bodies = [person()]
    house.step()
    assert say.lamps == Lamps(possess="breathing")
    say.words = ["possess"]
    house.step()
    assert say.lamps == Lamps(possess="steady")
    house.edge.tracker = Tracker()  # no frame has been read yet
    house.edge.tracker.lock()
    house.edge.poll_requests()
    assert say.lamps == Lamps(possess="steady", locked="steady")
    house.edge.tracker.unlock()
    house.edge.health.record_read_error(SensorFault("the cable is out", where="people"))
    house.edge._wait()
    house.edge.poll_requests()
    assert say.lamps == Lamps(possess="steady", fault="flashing")
    house.step()
    assert say.lamps == Lamps(possess="steady"), "the sensor is back"


def test_there_are_14_control_words():
    assert len(set(WORDS)) == 14


def test_window_commands_are_forwarded_to_windows(outlet):
    say, heard = Say(), []
    house = House(outlet, Controls([say]))
    with contextlib.closing(EdgeClient([outlet.publisher.endpoint])) as client:

        def came(count: int) -> bool:
            client.poll()
            heard.extend(client.take(CALLS))
            return client.status is not None and client.edges[0].has_all_characters and len(heard) >= count

        house.until(lambda: came(0))
        say.words = ["record", "again", "stop"]
        house.until(lambda: came(3))
    assert [(command.word, command.control) for command in heard] == [
        (w, "test") for w in ("record", "again", "stop")
    ]
