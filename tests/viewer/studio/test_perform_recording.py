"""Tests of automatic ends of a recording: holding still, the end of the span, a pedal or voice command."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from patience import TIMEOUT_S
from swaying import swaying

from enliven.document.project import Project
from enliven.formats.project.one_character import project_of_mesh
from enliven.frames import BodyFrame
from enliven.modeling.edits import compute_vertices
from enliven.modeling.puppet.edits import make_puppet
from enliven.overdub.performance import PerformedMotion
from enliven.person.body import Body
from enliven.samples.shipped import load_sample
from enliven.wire import CALLS, CallMessage
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.recorder import Stillness
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace

EDGE = Path(__file__).parents[2] / "system" / "staged_edge.py"
STEP = 33_333_333


def seen(frames: list[list[Body]]) -> Stillness:
    stillness = Stillness()
    for number, bodies in enumerate(frames):
        stillness.add_frame(BodyFrame(bodies, number * STEP, "edge"))
    return stillness


def standing(who: int, tremble: float = 0.0, seed: int = 0) -> Body:
    body = swaying(who, 0)
    shaken = body.joints + tremble * np.random.default_rng(seed).uniform(-0.5, 0.5, (20, 3))
    return Body(who, shaken, np.ones(20))


@pytest.mark.slow
@given(st.integers(3, 30), st.integers(2, 60))
def test_still_counts_from_where_the_last_performer_came_to_rest(moving: int, still: int) -> None:
    moves = [[standing(1), swaying(2, 4 * n)] for n in range(moving)]
    last = swaying(2, 4 * (moving - 1))
    rests = [[standing(1, 0.02, n), last] for n in range(still)]
    frames = [*moves, *rests]
    stillness = seen(frames)
    now = (len(frames) - 1) * STEP
    assert stillness.since_ns is not None
    assert abs(stillness.since_ns - moving * STEP) <= 2 * STEP
    assert stillness.seconds(now) == pytest.approx(still / 30, abs=0.1)


def test_unmoved_or_absent_performer_does_not_end_the_recording() -> None:
    assert seen([[standing(1, 0.02, n)] for n in range(90)]).seconds(90 * STEP) == 0.0
    away = [[swaying(1, 4 * n)] for n in range(20)] + [[]] * 90
    assert seen(away).seconds(110 * STEP) == 0.0
    unseen = [[swaying(1, 4 * n)] for n in range(20)]
    rest = swaying(1, 76)
    confidence = np.ones(20)
    confidence[7] = 0.1
    for n in range(40):
        jumping = rest.joints.copy()
        jumping[7] += 0.2 * (n % 2)
        unseen.append([Body(1, jumping, confidence)])
    assert seen(unseen).seconds(59 * STEP) > 1.0, "a joint that is guessed does not count"


def test_still_end_is_trimmed() -> None:
    frames = [BodyFrame([standing(1)], n * STEP, "edge") for n in range(10)]
    kept = PerformedMotion("take 1", 0, frames=frames).cut_at(4 * STEP)
    assert [frame.time_ns // STEP for frame in kept.frames] == [0, 1, 2, 3, 4]


@pytest.fixture
def session(tmp_path: Path):
    """Starts a session that follows a real edge with a performer lifting a knee in a chair."""
    edge = subprocess.Popen(
        [sys.executable, str(EDGE), f"stage-{time.time_ns()}", str(tmp_path), "100"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert edge.stdout is not None
    connected = PerformSession(Editor(), tmp_path)
    get_puppet_editor(connected.editor)  # This call registers the editor of puppets, as the workspace does.
    connected.active_workspace, connected.recording.count_in = "Perform", False
    connected.connect(":".join(["127.0.0.1", *edge.stdout.readline().split()]))
    until(connected, lambda: connected.holders)
    yield connected
    connected.disconnect()
    edge.kill()
    edge.wait()


def until(session: PerformSession, done: Callable[[], object]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end
        session.advance(0.01)
        time.sleep(0.01)


@pytest.mark.slow
def test_a_span_is_recorded_and_no_more_and_again_where_it_loops(session: PerformSession) -> None:
    editor = session.editor
    session.recording.span = (0.3, 0.9)
    session.recording.toggle()
    until(session, lambda: session.recording.phase == "recording")
    until(session, lambda: session.recording.phase == "idle")
    part = editor.project.graphs["chair"].parts[0]
    assert part.offset == pytest.approx(0.3, abs=0.05)
    assert editor.project.length_of(part) == pytest.approx(0.6, abs=0.1)
    editor.undo()
    session.recording.loops = True
    session.recording.toggle()
    until(session, lambda: len(editor.history.names) > 1)
    assert session.recording.phase == "recording", "the next one is under way"
    session.recording.stop()


@pytest.mark.slow
def test_voice_command_starts_repeats_and_ends_a_recording(session: PerformSession) -> None:
    heard = session.live.feed.on_message

    def called(word: str) -> None:
        heard(CALLS, CallMessage(word, "left pedal"))

    called("stop")
    assert session.recording.phase == "idle"
    called("again")
    assert session.recording.phase == "idle", "nothing was recorded yet"
    called("record")
    until(session, lambda: session.recording.recorder.seconds > 0.4)
    called("again")
    assert session.recording.recorder.seconds == 0.0
    until(session, lambda: session.recording.recorder.seconds > 0.4)
    called("stop")
    assert session.recording.phase == "idle" and session.editor.history.names[-1] == "record take 1"
    called("again")
    assert session.recording.phase == "counting" and "chair" not in session.editor.project.characters
    until(session, lambda: session.recording.recorder.seconds > 0.4)
    called("record")
    assert session.recording.phase == "idle" and session.editor.history.names[-1] == "record take 1"


@pytest.mark.slow
def test_the_motion_of_a_scanned_mesh_is_on_that_mesh(session: PerformSession) -> None:
    """A mesh from a file is a puppet without examples, and a scanned mesh is at rest. Neither is
    duplicated.
    """
    mesh, editor = load_sample("chair"), session.editor

    def scanned(project: Project) -> Project:
        chair = project_of_mesh(mesh, "chair")
        return project.with_streams(*chair.streams.values()).with_characters(chair.graph("chair"))

    for kind, add in (("puppet", lambda project: make_puppet(project, mesh, "chair")), ("graph", scanned)):
        editor.open_project(Project())
        assert editor.edit("open", add)
        before = editor.project.characters["chair"].kind
        session.recording.toggle()
        until(session, lambda: session.recording.recorder.seconds > 0.8)
        session.recording.toggle()
        assert list(editor.project.characters) == ["chair"], kind
        chair = editor.project.graph("chair")
        assert chair.mesh is not None and len(chair.mesh.vertices) == len(mesh.vertices)
        moved = np.stack(
            [compute_vertices(editor.project, "chair", second) for second in np.linspace(0.1, 0.7, 7)]
        )
        # The recorded dance depends on the clock: in a slow part, it moves by 1 cm in 0.4 s.
        assert np.ptp(moved, axis=0).max() > 0.005
        editor.undo()
        assert editor.project.characters["chair"].kind == before


@pytest.mark.slow
def test_waiting_samples_are_put_on_the_stage(session: PerformSession, tmp_path: Path) -> None:
    """One sample was opened before the stage connected, and one afterwards."""
    later = Workspace.new(Editor(), tmp_path / "own")
    perform = later.state(PerformSession)
    later.editor.edit("a chair", lambda project: make_puppet(project, load_sample("lamp"), "chair"))
    assert later.actions.do("sample.chair")
    assert later.editor.selection.character == "chair 2" and later.tabs.active == "Perform"
    assert later.editor.project.graph("chair 2").mesh is not None, "nothing has to be prepared"
    assert session.client is not None
    perform.connect(str(session.client.edges[0].endpoint))
    until(perform, lambda: "chair 2" in perform.stage_ids)
    assert perform.target == "chair 2", "Possess means it"
    assert later.actions.do("sample.chair")
    until(perform, lambda: "chair 3" in perform.stage_ids)
    perform.disconnect()
