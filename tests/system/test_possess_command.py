"""Tests of ``enliven possess``, and of the attachments on the wire and in takes, as docs/possession.md
describes them.
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S
from performed_take import STEP_NS, Performers, chair_actor, record_performance
from sample_meshes.cactus import make_cactus

from enliven import cli
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project
from enliven.meshes.files import save_mesh
from enliven.modeling.possessed.pose import graph_pose
from enliven.modeling.possessed.solving import stale
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.possession import ActorSettings
from enliven.recording import Recording
from enliven.wire import HOLDS, HoldMessage, Possess, Release
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.playback.document import Document

OLD = Path(__file__).parent / "references" / "two_characters.mcap"
"""A recording from before attachments were published."""


@pytest.fixture(scope="module")
def take(tmp_path_factory) -> Path:
    """Records two performers for 1.5 s. One attaches the chair; the other joins and releases."""
    path = tmp_path_factory.mktemp("possess") / "take.mcap"
    requests_at = {4: (Possess("chair", 1, "all", "alone"),), 20: (Possess("chair", 2, "legs", "join"),)}
    refused = record_performance(
        path,
        [{1, 2}] * 45,
        {**requests_at, 34: (Release("chair", 2),)},
        [chair_actor(ActorSettings(fade=0.2))],
    )
    assert not refused
    return path


def motion(project, name, seconds):
    return np.array([graph_pose(project, project.graph(name), t)[1] for t in seconds])


def test_the_holds_of_a_recording_are_read_with_its_performers(take):
    project = read_possessed(take)
    how = project.graph("chair").parts[0].possession
    assert [(round(h.seconds * 30), h.mode, h.performer, h.parts) for h in how.holds] == [
        (4, "alone", 1, "all"), (20, "join", 2, "legs"), (34, "release", 2, "all"),
    ]  # fmt: skip
    assert project.bodies[how.take].people.tolist() == [1, 2] and '"fade": 0.2' in how.settings


@pytest.mark.slow
def test_another_mesh_performs_the_recording(take, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_mesh(make_cactus(cell=0.08), tmp_path / "CACTUS.obj")
    asked = ["possess", str(take), "--mesh", "CACTUS.obj", "--nodes", "40", "-o"]
    assert cli.run([*asked, "cactus.enliven"]) == 0
    project = read_project("cactus.enliven")
    (name,) = project.graphs
    shape = project.graph(name)
    assert len(shape.positions) == 40 and not stale(project, shape)
    places = motion(project, name, np.linspace(0.0, 1.4, 15))
    assert np.linalg.norm(np.ptp(places, axis=0), axis=1).mean() > 0.17
    seen = project.bodies["take"].joints[:, 0, 0]
    np.testing.assert_allclose(places.mean((0, 1))[[0, 2]], seen.mean(0)[[0, 2]], atol=0.35)
    assert cli.run([*asked, "cactus.glb"]) == 0
    assert read_gltf(tmp_path / "cactus.glb").clips[0].duration == pytest.approx(44 / 30, abs=0.04)


def test_other_parts_are_attached_to_the_recorded_mesh(take, tmp_path, capsys):
    out = tmp_path / "again.enliven"
    assert cli.run(["possess", str(take), "-o", str(out)]) == 0
    whole = read_project(out)
    assert (whole.streams["chair"].positions == read_possessed(take).streams["chair"].positions).all()
    assert cli.run(["possess", str(take), "--parts", "legs", "--at", "0.5", "-o", str(out)]) == 0
    legs = read_project(out)
    times = np.linspace(0.0, 0.48, 6)
    still = motion(legs, "chair", times)
    np.testing.assert_allclose(still, still[:1].repeat(6, 0), atol=1e-6)
    later = np.linspace(0.9, 1.4, 6)
    assert np.abs(motion(legs, "chair", later) - motion(whole, "chair", later)).max() > 0.05
    assert "chair" in capsys.readouterr().out


def test_invalid_possess_arguments_are_reported(take, tmp_path, capsys):
    out = str(tmp_path / "no.enliven")
    for asked, words in (
        ([str(take), "-c", "table", "-o", out], "Possessed characters: chair"),
        ([str(OLD), "-o", out], "no performer|bodies|--mesh"),
        ([str(take), "--mesh", str(tmp_path / "none.obj"), "-o", out], "none.obj"),
        ([str(take), "--parts", "tail", "-o", out], "tail"),
        ([str(take), "-o", str(tmp_path / "no.doc")], ".doc"),
    ):
        assert cli.run(["possess", *asked]) in (2, 3)
        error = capsys.readouterr().err
        assert any(word in error for word in words.split("|")), error


def test_recording_without_attachments_has_motion_and_no_performers():
    assert "holds" not in Recording(OLD).info.topics
    project = read_possessed(OLD)
    assert project.graphs and not project.bodies
    assert all(part.possession is None for shape in project.graphs.values() for part in shape.parts)


@pytest.mark.slow
def test_late_viewer_receives_attachments_and_removals(tmp_path):
    wire = WireSettings(name=f"holds-{time.time_ns()}", port=0, control_port=0)
    with Outlet(wire, "performers", record=tmp_path / "take.mcap") as outlet:
        stage = Stage([chair_actor(ActorSettings()), chair_actor(ActorSettings(), name="twin")])
        edge = Edge(Performers([{1, 2}] * 9, away=2.5), Tracker(), stage, outlet)
        for number in range(4):
            edge.step(edge.sensor.read())
            if number == 1:
                edge.carry_out(Possess("chair", 1, "legs"))
                edge.carry_out(Possess("chair", 2, "upper body", "join"))
        stage.remove("twin")
        edge.step(edge.sensor.read())
        client, document = EdgeClient([outlet.publisher.endpoint]), Document()
        feed, deadline = EdgeFeed(client), time.monotonic() + TIMEOUT_S
        while "chair" not in client.latest(HOLDS):
            assert time.monotonic() < deadline, "it was never told"
            feed.poll(document)
            outlet.publisher.poll()
            time.sleep(0.001)
        chair = client.latest(HOLDS)["chair"]
        assert document.timeline.generation == 0, "an old message starts no new timeline"
        assert (chair.mode, chair.body, chair.holders, chair.revision) == ("join", 2, [1, 2], 1)
        assert "twin" not in client.latest(HOLDS), "who joins later hears nothing of what has left"
        feed.close()
    written = Recording(tmp_path / "take.mcap").messages("holds")
    messages = [msgspec.msgpack.decode(message, type=HoldMessage) for _, message in written]
    modes = [(message.character, message.mode) for message in messages]
    assert modes == [("chair", "alone"), ("chair", "join"), ("twin", "remove")]
    assert [message.time_ns - messages[0].time_ns for message in messages] == [0, 0, 2 * STEP_NS]
