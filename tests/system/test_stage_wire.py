"""Tests that a client adds characters to a real edge's stage, replaces attached ones, and removes them."""

from __future__ import annotations

import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import trimesh
import typer
from patience import TIMEOUT_S, wait_until
from typer.testing import CliRunner

from enliven.formats.project.one_character import project_of_mesh
from enliven.meshes import Mesh, load_mesh, save_mesh
from enliven.recording import Recorder, Recording
from enliven.samples.shipped import cactus_project, load_sample
from enliven.wire import CUES, POSE, Answer, Done, Endpoint, Refused, StageMessage
from enliven_edge.commands.scan import scan
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_viewer.commands.stage import stage as command
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.render.scene import make_scene

CHAIR = load_sample("chair")


class StagedEdge:
    """The program of staged_edge.py with its take, and a client."""

    def __init__(self, folder: Path, rate: float) -> None:
        script = Path(__file__).with_name("staged_edge.py")
        arguments = [sys.executable, str(script), f"test-{uuid.uuid4().hex[:10]}", str(folder), str(rate)]
        self.take = folder / "take.mcap"
        self.process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        ports = self.process.stdout.readline().split()
        assert len(ports) == 2, "the edge did not start"
        self.endpoint = Endpoint("127.0.0.1", *map(int, ports))
        self.link = EdgeClient([self.endpoint])
        self.until(lambda: self.holders("chair"))

    def until(self, done: Callable[[], object]) -> None:
        # Kernels may have to be compiled first.
        wait_until(done, patience=10 * TIMEOUT_S, step=self.link.poll, interval=0.002)

    def holders(self, character: str) -> bool:
        cues = self.link.latest(CUES).get(character)
        return cues is not None and cues.state == "possessed"

    def put(self, *what: object, **how: object) -> Answer:
        answers: list[Answer] = []
        self.link.stage.put(*what, **how, then=answers.append)
        self.until(lambda: answers)
        return answers[0]

    def end(self) -> float:
        """Ends the edge and returns the processor time of its longest frame in milliseconds."""
        self.link.close()
        self.process.terminate()
        return float(self.process.communicate(timeout=TIMEOUT_S)[0])


@pytest.fixture
def edge(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[StagedEdge]:
    started = StagedEdge(tmp_path, getattr(request, "param", 100.0))
    yield started
    started.link.close()
    started.process.kill()
    started.process.wait()


def taller(by: float) -> Mesh:
    return replace(CHAIR, vertices=CHAIR.vertices * [1.0, by, 1.0])


@pytest.mark.slow
def test_take_records_adding_changing_and_removing_a_character(edge: StagedEdge) -> None:
    link = edge.link
    assert edge.put(project_of_mesh(taller(1.05), "chair"), "chair") == Done()
    edge.until(
        lambda: link.edges[0].has_all_characters and link.characters["chair"].vertices[:, 1].max() > 1.04
    )
    link.take(POSE)
    edge.until(lambda: [p for p in link.take(POSE) if p.character is link.characters["chair"]])
    assert edge.holders("chair") and link.edges[0].revision("chair") == 2
    assert edge.put(cactus_project(), "cactus", name="guest") == Done()
    answers: list[Answer] = []
    link.stage.remove("guest", answers.append)
    link.stage.remove("nobody", answers.append)
    edge.until(lambda: len(answers) == 2 and set(link.characters) == {"chair"})
    assert answers[0] == Done() and isinstance(answers[1], Refused) and "chair" in answers[1].reason
    refused = edge.put(project_of_mesh(replace(CHAIR, vertices=CHAIR.vertices * 0.0), "chair"), "chair")
    assert isinstance(refused, Refused) and edge.holders("chair")
    assert link.characters["chair"].vertices[:, 1].max() > 1.04, "what stood there stays"
    edge.end()
    messages = [
        msgspec.msgpack.decode(data, type=StageMessage) for _, data in Recording(edge.take).messages("stage")
    ]
    names = [
        [(character.character, character.revision) for character in message.characters]
        for message in messages
    ]
    both = [("chair", 2), ("guest", 1)]
    assert names == [[("chair", 1)], [("chair", 2)], both, [("chair", 2)]]
    document = Document()
    with closing(TakeFeed(edge.take)) as take:
        while take.poll(document):
            pass
    for message, high in zip(messages, (1.0, 1.05, 1.05, 1.05), strict=True):
        moment = document.timeline.find_moment(document.timeline.neighbour(message.time_ns, 1))
        assert moment is not None and set(moment.poses) == {
            character.character for character in message.characters
        }
        drawn = {character.character.id: character for character in make_scene(document, moment, None).actors}
        assert set(drawn) == set(moment.poses)
        tall = drawn["chair"].character.vertices[:, 1].max() / CHAIR.vertices[:, 1].max()
        assert abs(tall - high) < 1e-3 and len(drawn["chair"].pose.positions) == len(
            moment.poses["chair"].positions
        )


@pytest.mark.slow
@pytest.mark.parametrize("edge", [20.0], indirect=True)
def test_large_character_passes_the_rate_limit_and_only_the_newest_follows(
    edge: StagedEdge,
) -> None:
    random = np.random.default_rng(0)
    large = replace(CHAIR, colours=random.integers(0, 256, CHAIR.vertices.shape).astype(np.uint8))
    answers: list[tuple[int, Answer]] = []
    for k in range(5):
        mesh = replace(large, vertices=large.vertices * (1 + 0.01 * k))
        edge.link.stage.put(
            project_of_mesh(mesh, "chair"), "chair", then=lambda a, k=k: answers.append((k, a))
        )
    edge.until(lambda: len(answers) == 2)
    assert answers == [(0, Done()), (4, Done())] and not edge.link.stage.is_uploading


@pytest.mark.slow
def test_stage_command_lists_puts_removes_and_reports_errors(edge: StagedEdge, tmp_path: Path) -> None:
    def run(*words: str) -> str:
        result = CliRunner().invoke(command, [*words, "--edge", str(edge.endpoint)])
        return result.output if result.exit_code == 0 else str(result.exception)

    lying = tmp_path / "lying.off"
    save_mesh(replace(CHAIR, vertices=CHAIR.vertices[:, [0, 2, 1]] * [1000.0, -1000.0, 1000.0]), lying)
    assert "controlled by performers 1" in run("list")
    output = run("put", str(lying), "--name", "stool")
    assert "is used as the up axis" in output and "stool is now on the stage" in output
    listed = run("list").splitlines()
    assert len(listed) == 2 and listed[1].startswith("stool: revision 1, a possessed mesh")
    edge.until(lambda: "stool" in edge.link.characters)
    stool = edge.link.characters["stool"].vertices
    assert np.ptp(stool[:, 1]) == pytest.approx(1.75, abs=1e-3), "it stands upright, as tall as a person"
    assert "removed" in run("remove", "stool") and "there is no character 'stool'" in run("remove", "stool")
    assert "the file does not exist" in run("put", str(tmp_path / "none.obj"))


@pytest.mark.slow
def test_scan_is_added_to_the_stage_of_a_running_edge(edge: StagedEdge, tmp_path: Path) -> None:
    box = trimesh.creation.box((0.4, 0.5, 0.3))
    thing = Mesh(np.add(box.vertices, [0.0, 0.25, 0.0]), np.array(box.faces, np.int32))
    path = HandheldPath(target=(0.0, 0.2, 0.0), radius=1.25, height=(0.8, 1.0), turns=0.1, seconds=0.4)
    with Recorder(tmp_path / "carried.mcap") as recorder:
        for frame in HandheldScan(thing, load_profile("kinect1"), path, width=320):
            recorder.write_frame(frame)
    app, target = typer.Typer(pretty_exceptions_enable=False), tmp_path / "box.glb"
    app.command()(scan)
    words = ["--recording", str(tmp_path / "carried.mcap"), "-o", str(target), "--voxel", "12"]
    result = CliRunner().invoke(app, [*words, "--edge", str(edge.endpoint)])
    assert result.exit_code == 0 and "box is now on the stage" in result.output, result.output
    edge.until(lambda: "box" in edge.link.characters)
    on_stage, scanned = (
        np.ptp(edge.link.characters["box"].vertices, 0),
        np.ptp(load_mesh(target).mesh.vertices, 0),
    )
    assert on_stage == pytest.approx(scanned * 1.75 / scanned[1], abs=1e-3), "as tall as a person"
    assert edge.holders("chair"), "who holds another goes on"
    nowhere = CliRunner().invoke(app, [*words, "--overwrite", "--edge", "127.0.0.1:1"])
    assert "no edge answers" in str(nowhere.exception) and target.exists()
