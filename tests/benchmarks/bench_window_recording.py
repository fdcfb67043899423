"""Measures the cost of recording in the window: processor time per frame with and without it, without
drawing.

A real edge replays the shipped recording, its performer possesses the chair, and the project plays in both
cases, so that only the recording differs. The overhead is relative to a frame at 60 Hz.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from figure import Figure

from enliven.document import Project
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.files import read_library

RATE = 60.0
"""Frames per second."""
SPAN, TURNS = 2.0, 5
"""Seconds of each measurement, and the number of alternations."""
PATIENCE = 120.0
"""Timeout for the start of the edge until its performer possesses the chair, seconds."""


def figures() -> Iterator[Figure]:
    """Yields window.record_overhead: the fraction of a frame's time that recording takes."""
    with tempfile.TemporaryDirectory() as folder:
        session = PerformSession(Editor(project=Project().with_takes(*read_library())), Path(folder))
        session.active_workspace, session.recording.count_in = "Perform", False
        session.connect_local("--loop", "--possess-at", "0.5")
        try:
            _run(session, lambda: session.holders)
            extra = list[float]()
            for _ in range(TURNS):
                before = statistics.median(_time_pictures(session))
                session.recording.toggle()
                _run(session, lambda: session.recording.phase == "recording")
                extra.append(statistics.median(_time_pictures(session)) - before)
                session.recording.stop()
        finally:
            session.disconnect()
    yield Figure("window.record_overhead", 100 * statistics.median(extra) * RATE, "%")


def _time_pictures(session: PerformSession) -> list[float]:
    """Returns this thread's seconds for each frame while the project plays."""
    took, end = list[float](), time.monotonic() + SPAN
    while time.monotonic() < end:
        began, before = time.monotonic(), time.thread_time()
        session.editor.playing = True
        session.editor.advance(1 / RATE)
        session.advance(1 / RATE)
        assert session.editor.stage_characters is not None
        took.append(time.thread_time() - before)
        time.sleep(max(began + 1 / RATE - time.monotonic(), 0.0))
    return took


def _run(session: PerformSession, done: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "the edge does not come"
        session.advance(1 / RATE)
        time.sleep(1 / RATE)
