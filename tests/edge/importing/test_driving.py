"""Tests that imported joints drive a mesh: replayed, possessed, recorded, and read by a viewer."""

from __future__ import annotations

import uuid
from pathlib import Path

import numpy as np
import pytest
import typer
from made_bvh import danced, write_bvh
from typer.testing import CliRunner

from enliven.person.joints import Joint
from enliven_edge.commands.import_ import import_recording
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.replay import ReplaySensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor, default_parts
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import Timeline

HOLD = 1.64
"""Time in the exercise at which the arms are held out, seconds."""


@pytest.fixture(scope="module")
def performed(tmp_path_factory) -> Document:
    """Returns the lamp, driven by a BVH file of a person raising their arms, as the viewer reads the take."""
    folder = tmp_path_factory.mktemp("driving")
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command("import")(import_recording)
    write_bvh(folder / "arms.bvh", danced("overhead", seconds=3.4))
    result = CliRunner().invoke(app, [str(folder / "arms.bvh"), "-o", str(folder / "arms.mcap")])
    assert result.exit_code == 0, result.output
    play(folder / "arms.mcap", folder / "performance.mcap")
    document = Document(Timeline(bounded=False))
    take = TakeFeed(folder / "performance.mcap")
    while take.poll(document):
        pass
    assert take.unreadable == 0
    return document


def play(recording: Path, performance: Path) -> None:
    """Plays a recording like `enliven edge --recording ... --mesh lamp --possess-at ... --record ...`."""
    actor = create_actor("lamp")
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with (
        ReplaySensor(recording, speed=0.0) as sensor,
        Outlet(wire, sensor.name, record=performance) as outlet,
    ):
        outlet.introduce(actor.character)
        edge = Edge(sensor, Tracker(), Stage([actor]), outlet, possess_at=HOLD, parts=default_parts("lamp"))
        edge.run()
        assert edge.frames == 85


def moment(document: Document, second: float):
    instant = document.timeline.find_moment(document.timeline.start_ns + round(second * 1e9))
    assert instant is not None
    return instant


@pytest.mark.slow
def test_the_lamp_waits_and_is_possessed_when_it_was_asked_for(performed) -> None:
    assert not moment(performed, HOLD - 0.1).possessed
    assert moment(performed, HOLD + 0.1).possessed
    early, late = moment(performed, 0.3).poses["lamp"], moment(performed, HOLD - 0.1).poses["lamp"]
    np.testing.assert_allclose(early.positions, late.positions, atol=2e-3)


def test_every_frame_keeps_the_clock_of_the_recording(performed) -> None:
    assert performed.timeline.end_ns - performed.timeline.start_ns == 84 * 40_000_000


def test_the_shade_rises_with_the_right_hand_and_the_foot_stays(performed) -> None:
    character = performed.characters["lamp"]
    shade = character.pivots[:, 0] < -0.85
    foot = character.pivots[:, 1] < 0.06
    before, after = moment(performed, HOLD).poses["lamp"], moment(performed, 2.6).poses["lamp"]
    hands = [moment(performed, second).bodies[0].joints[Joint.HAND_RIGHT, 1] for second in (HOLD, 2.6)]
    assert hands[1] - hands[0] > 0.4
    risen = after.positions[:, 1] - before.positions[:, 1]
    assert risen[shade].mean() > 0.25
    # It leans with the hip and stays on the floor.
    assert np.abs(risen[foot]).mean() < 0.12
    assert np.isfinite(after.linear).all()


def test_shipped_meshes_have_their_default_parts() -> None:
    assert default_parts("lamp") == "hip and right arm"
    assert default_parts("chair") == default_parts("horse.obj") == "all"
