"""Tests of several edges in one window: shown and recorded together, and one continues without the other."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from patience import TIMEOUT_S

from enliven.errors import InputError
from enliven_viewer.live.followed_edge import find_shared_performer_id
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.camera_preview import list_views
from enliven_viewer.studio.features.perform.session import PerformSession

EDGE = Path(__file__).parents[2] / "system" / "staged_edge.py"


def started(name: str, folder: Path) -> tuple[subprocess.Popen[str], str]:
    """Starts an edge with a performer in a chair. Returns the edge and its address."""
    folder.mkdir()
    edge = subprocess.Popen(
        [sys.executable, str(EDGE), name, str(folder), "100"], stdout=subprocess.PIPE, text=True
    )
    assert edge.stdout is not None
    return edge, ":".join(["127.0.0.1", *edge.stdout.readline().split()])


@pytest.fixture
def two(tmp_path: Path):
    """Starts a session that follows two real edges. Returns the session and the first edge's process."""
    stamp = time.time_ns()
    edges = [started(f"{name}-{stamp}", tmp_path / name) for name in ("left", "right")]
    session = PerformSession(Editor(), tmp_path)
    session.active_workspace = "Perform"
    session.recording.count_in = False
    for _, address in edges:
        session.add_secondary(address)
    yield session, edges
    session.disconnect()
    for edge, _ in edges:
        edge.kill()
        edge.wait()


def until(session: PerformSession, done: Callable[[], object]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end
        session.advance(0.01)
        time.sleep(0.01)


@pytest.mark.slow
def test_two_edges_are_recorded_and_one_continues_alone(two) -> None:
    session, edges = two
    with pytest.raises(InputError, match="already follows"):
        session.add_secondary(edges[1][1])
    (guest,) = session.secondary_edges
    until(session, lambda: session.performers and guest.performers and len(session.holders) == 2)
    until(session, lambda: session.scene is not None and len(session.scene.actors) == 2)
    until(session, lambda: session.scene is not None and len(session.scene.bodies) == 2)
    shown = session.scene
    assert {body.id for body in shown.bodies} == {1, find_shared_performer_id(1, 1)}
    assert {actor.character.id for actor in shown.actors} == {"chair", f"{guest.name}/chair"}
    assert f"Performer 1 at {guest.name}" in session.present
    views = list_views(session)
    assert [view.name for view in views] == ["Performer", guest.name]
    assert all(view.bodies for view in views), "each edge's performers are seen in a view of their own"
    session.recording.toggle()
    until(session, lambda: session.recording.seconds > 0.3)
    edges[0][0].kill()
    reached = session.recording.recorder.seconds
    until(session, lambda: not session.connected)
    until(session, lambda: session.recording.seconds > reached + 1.0)
    assert session.recording.phase == "recording" and guest.connected
    session.recording.stop()
    project = session.editor.project
    assert set(project.graphs) == {"chair", f"{guest.name}/chair"}
    lasts = [project.end_of(graph) for graph in project.graphs.values()]
    assert lasts[1] > lasts[0] + 0.5, "the second one was recorded to the end"
    assert len(session.editor.history.names) == 1, "one edit"
    session.remove_secondary(guest)
    assert session.secondary_edges == []
