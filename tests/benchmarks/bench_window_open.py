"""Measures the time from the start of the window's process to its first frame. Without a display it uses an X
server.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from figure import Figure

LAPS = 5
CHILD = """
import time
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.workspace import Workspace

def shown(window):
    print(time.monotonic(), flush=True)
    window.close()

StudioWindow(Workspace.new(Editor(StudioSettings()))).run(seconds=60, after=shown)
"""


def figures() -> Iterator[Figure]:
    """Yields window.open_s: the median of some starts, after one that fills the disk cache."""
    with _display() as display:
        took = [_start({**os.environ, "DISPLAY": display}) for _ in range(LAPS + 1)]
    yield Figure("window.open_s", statistics.median(took[1:]), "s")


def _start(environment: dict[str, str]) -> float:
    """Returns the seconds from the start of the process to the end of its first frame. Both times are system
    time."""
    began = time.monotonic()
    command = [sys.executable, "-c", CHILD]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=120)
    return float(done.stdout.split()[0]) - began


@contextmanager
def _display() -> Iterator[str]:
    """Yields the existing display, or that of an X server that runs until the context ends."""
    if os.environ.get("DISPLAY"):
        yield os.environ["DISPLAY"]
        return
    server = shutil.which("Xvfb")
    if server is None:
        raise SystemExit("window.open_s needs a display, or Xvfb")
    command = [server, "-displayfd", "1", "-screen", "0", "1280x820x24"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as running:
        assert running.stdout is not None
        yield f":{running.stdout.readline().strip()}"
        running.terminate()
