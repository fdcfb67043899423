"""Measures the start times of the help, the first pose and the first frame, and of the two commands of a
fresh checkout.

``make bench ONLY=start`` also installs everything into an empty folder (start.install_s); ``make bench``
without a name skips that. The test suite of a fresh checkout (start.test_s, many minutes) runs only if
``ENLIVEN_BENCH_TESTS=1`` is set in addition.
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
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import Timeline

ROOT = Path(__file__).parents[2]
ASKED_FOR_TESTS = "ENLIVEN_BENCH_TESTS"
"""Environment variable that enables start.test_s."""
LAPS = 5
"""Repetitions of jobs that take seconds. The median is reported."""
LATER = 30
"""Number of later frames with which the first one is compared."""
PATIENCE = 120.0
"""Timeout for the first pose, seconds."""
POLL_INTERVAL = 0.01
"""Seconds between two looks for a pose. Looking every millisecond would take a third of a processor core from
the edge, which compiles on both cores of a small machine.
"""
ENLIVEN = [sys.executable, "-m", "enliven"]

FIRST_FRAME = f"""
import itertools, time
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
warm_up_tracking()
frames = (f for f in Recording(find_shipped_recording()).frames() if isinstance(f, DepthFrame))
tracker = Tracker()
for frame in itertools.islice(list(frames), {LATER} + 1):
    began = time.perf_counter()
    tracker.track(frame)
    print(1000 * (time.perf_counter() - began))
"""
"""Program that prints the milliseconds of a tracker's first frames, in a fresh process."""


def figures() -> Iterator[Figure]:
    """Yields start.help_s, .first_pose_s and .first_frame_ms. If ``start`` is named, also .install_s and
    .test_s.
    """
    yield Figure("start.help_s", statistics.median(_time_help() for _ in range(LAPS)), "s")
    time_first_pose()  # kernels are compiled and files are in the disk cache afterwards
    yield Figure("start.first_pose_s", statistics.median(time_first_pose() for _ in range(LAPS)), "s")
    laps = [_time_frames() for _ in range(LAPS)]
    first = statistics.median(lap[0] for lap in laps)
    later = statistics.median(ms for lap in laps for ms in lap[1:])
    yield Figure("start.first_frame_ms", first, "ms", f"the median of the next {LATER}", later / first)
    if "start" in sys.argv[1:]:
        yield from _time_fresh_clone()


def _time_help() -> float:
    """Returns the seconds of ``enliven --help``."""
    began = time.perf_counter()
    subprocess.run([*ENLIVEN, "--help"], check=True, capture_output=True)
    return time.perf_counter() - began


def _time_frames() -> list[float]:
    """Returns the milliseconds of each of a tracker's first frames."""
    result = subprocess.run([sys.executable, "-c", FIRST_FRAME], check=True, capture_output=True, text=True)
    return [float(line) for line in result.stdout.split()]


def time_first_pose(patience: float = PATIENCE, **environment: str) -> float:
    """Returns the seconds from the start of an edge until a viewer receives the first pose. The edge
    possesses at once.

    Args:
        patience: timeout in seconds.
        environment: additional environment variables of the edge.
    """
    port, control = free_ports()[:2]
    document = Document(Timeline(bounded=False))
    feed = EdgeFeed(EdgeClient([str(Endpoint("127.0.0.1", port, control))]))
    words = ["edge", "--possess-at", "0", "--port", str(port), "--control-port", str(control)]
    began = time.perf_counter()
    command = [*ENLIVEN, *words, "--name", f"bench-{port}"]
    edge = subprocess.Popen(command, env={**os.environ, **environment}, stderr=subprocess.DEVNULL)
    try:
        while not _is_possessed(document):
            if time.perf_counter() - began > patience or edge.poll() is not None:
                raise RuntimeError("the edge sent no pose")
            if not feed.poll(document):
                time.sleep(POLL_INTERVAL)
        return time.perf_counter() - began
    finally:
        feed.close()
        edge.terminate()
        edge.wait()


def _is_possessed(document: Document) -> bool:
    """Returns True if a pose of a possessed mesh has arrived."""
    moment = document.timeline.find_moment(document.timeline.end_ns) if len(document.timeline) else None
    return moment is not None and moment.possessed


def _time_fresh_clone() -> Iterator[Figure]:
    """Yields the time of the two commands in a new clone of the last commit. pip may have cached the
    packages."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["git", "clone", "-q", str(ROOT), folder], check=True)
        yield Figure("start.install_s", _time_make(folder, "setup-dev"), "s")
        if os.environ.get(ASKED_FOR_TESTS) == "1":
            subprocess.run(["git", "clean", "-qfdx"], cwd=folder, check=True)
            yield Figure("start.test_s", _time_make(folder, "test"), "s")


def _time_make(folder: str, target: str) -> float:
    """Returns the seconds of ``make target`` in a folder. The command must succeed."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("MAKE", "MFLAGS"))}
    began = time.perf_counter()
    subprocess.run(["make", "-s", target], cwd=folder, env=clean, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began
