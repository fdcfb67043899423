"""How soon one may begin: the help, the first pose, the first frame; and a fresh checkout's two commands.

``make bench ONLY=start`` installs everything into an empty folder too (start.install_s), which ``make bench``
without a name leaves out. The whole suite of a fresh checkout (start.test_s, many minutes) is run where
``ENLIVEN_BENCH_TESTS=1`` asks for it besides.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from figure import Figure

from enliven.wire.ports import free_ports
from enliven.wire.sockets import Endpoint
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.edges import EdgeClient
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import Timeline

ROOT = Path(__file__).parents[2]
ASKED_FOR_TESTS = "ENLIVEN_BENCH_TESTS"
"""The environment variable that asks for start.test_s."""
LAPS = 5
"""Repetitions of what takes seconds; the median is told."""
LATER = 30
"""Frames after the first with which it is compared."""
PATIENCE = 120.0
"""Seconds in which the first pose must have come."""
ENLIVEN = [sys.executable, "-m", "enliven"]

FIRST_FRAME = f"""
import itertools, time
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.doctor import shipped_recording
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
warm_up_tracking()
frames = (f for f in Recording(shipped_recording()).frames() if isinstance(f, DepthFrame))
tracker = Tracker()
for frame in itertools.islice(list(frames), {LATER} + 1):
    began = time.perf_counter()
    tracker.track(frame)
    print(1000 * (time.perf_counter() - began))
"""
"""Prints the milliseconds of a tracker's first frames, in a process that is otherwise fresh."""


def figures() -> Iterator[Figure]:
    """start.help_s, .first_pose_s and .first_frame_ms; where named, .install_s and .test_s."""
    yield Figure("start.help_s", statistics.median(_help() for _ in range(LAPS)), "s")
    _first_pose()  # kernels are compiled, and files are in memory, from here on
    yield Figure("start.first_pose_s", statistics.median(_first_pose() for _ in range(LAPS)), "s")
    laps = [_frames() for _ in range(LAPS)]
    first = statistics.median(lap[0] for lap in laps)
    later = statistics.median(ms for lap in laps for ms in lap[1:])
    yield Figure("start.first_frame_ms", first, "ms", f"the median of the next {LATER}", later / first)
    if "start" in sys.argv[1:]:
        yield from _fresh()


def _help() -> float:
    """Seconds of ``enliven --help``."""
    began = time.perf_counter()
    subprocess.run([*ENLIVEN, "--help"], check=True, capture_output=True)
    return time.perf_counter() - began


def _frames() -> list[float]:
    """Milliseconds of each of the first frames."""
    made = subprocess.run([sys.executable, "-c", FIRST_FRAME], check=True, capture_output=True, text=True)
    return [float(line) for line in made.stdout.split()]


def _first_pose() -> float:
    """Seconds from the start of an edge that takes hold at once to the first pose that a viewer receives."""
    port, control = free_ports()[:2]
    document = Document(Timeline(bounded=False))
    feed = EdgeFeed(EdgeClient([str(Endpoint("127.0.0.1", port, control))]))
    words = ["edge", "--possess-at", "0", "--port", str(port), "--control-port", str(control)]
    began = time.perf_counter()
    edge = subprocess.Popen([*ENLIVEN, *words, "--name", f"bench-{port}"], stderr=subprocess.DEVNULL)
    try:
        while not _is_possessed(document):
            if time.perf_counter() - began > PATIENCE or edge.poll() is not None:
                raise RuntimeError("the edge sent no pose")
            if not feed.poll(document):
                time.sleep(0.001)
        return time.perf_counter() - began
    finally:
        feed.close()
        edge.terminate()
        edge.wait()


def _is_possessed(document: Document) -> bool:
    """Whether a pose of a mesh that a body holds has come."""
    moment = document.timeline.at(document.timeline.end_ns) if len(document.timeline) else None
    return moment is not None and moment.possessed


def _fresh() -> Iterator[Figure]:
    """What the two commands take in a new clone of the last commit; pip may have kept the packages."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["git", "clone", "-q", str(ROOT), folder], check=True)
        yield Figure("start.install_s", _made(folder, "setup-dev"), "s")
        if os.environ.get(ASKED_FOR_TESTS) == "1":
            subprocess.run(["git", "clean", "-qfdx"], cwd=folder, check=True)
            yield Figure("start.test_s", _made(folder, "test"), "s")


def _made(folder: str, target: str) -> float:
    """Seconds of ``make target`` in a folder, which must end well."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("MAKE", "MFLAGS"))}
    began = time.perf_counter()
    subprocess.run(["make", "-s", target], cwd=folder, env=clean, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began
