"""From an edit in the window to the stage of a running edge: a mesh of 20,000 vertices that is held.

A real edge replays the shipped recording and its performer holds the chair, which is put again and again, a
little taller each time, by a client in this process.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

from figure import Figure

from enliven.formats.project import project_of_mesh
from enliven.meshes import refine
from enliven.samples import load_sample
from enliven.wire import CUES, POSE, Done
from enliven.wire.ports import free_ports
from enliven.wire.sockets import Endpoint
from enliven_viewer.link.edges import EdgeClient

VERTICES = 20_000
LAPS = 9
PATIENCE = 120.0
"""Seconds in which the edge has started, and a character stands on the stage."""
QUIET = 2.0
"""Seconds of frames before the first edit, with which those during an edit are compared."""
TURN = 0.002
"""Seconds between two looks at the sockets."""


def figures() -> Iterator[Figure]:
    """window.edit_to_stage_ms and window.put_latency_ms."""
    pose, control = free_ports()[:2]
    words = ["--possess-at", "0.5", "--loop", "--port", str(pose), "--control-port", str(control)]
    command = [sys.executable, "-m", "enliven", "edge", *words, "--name", f"bench-{os.getpid()}"]
    edge = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    link = EdgeClient([Endpoint("127.0.0.1", pose, control)])
    try:
        yield from _measured(link)
    finally:
        link.close()
        edge.terminate()
        edge.wait()


def _measured(link: EdgeClient) -> Iterator[Figure]:
    _until(link, lambda: (held := link.latest(CUES).get("chair")) is not None and held.state == "possessed")
    link.take(POSE)
    _until(link, lambda ends=time.monotonic() + QUIET: time.monotonic() > ends)
    usual = statistics.median(each.sensor_to_pose_ms for each in link.take(POSE))
    mesh = load_sample("chair")
    edge = 0.04
    while len(mesh.vertices) < VERTICES:
        edge *= 0.9
        mesh = refine(mesh, edge)
    laps = [_lap(link, replace(mesh, vertices=mesh.vertices * (1 + 0.01 * k))) for k in range(1 + LAPS)]
    yield Figure("window.edit_to_stage_ms", statistics.median(lap[0] for lap in laps[1:]), "ms")
    slowest = statistics.median(lap[1] for lap in laps[1:])
    yield Figure("window.put_latency_ms", slowest, "ms", "the median frame without an edit", usual / slowest)


def _lap(link: EdgeClient, mesh) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Milliseconds from an edit to its first pose, and the longest from sensor to pose meanwhile."""
    answers, seen, before = [], [], link.characters["chair"]
    began = time.perf_counter()
    link.stage.put(project_of_mesh(mesh, "chair"), "chair", then=answers.append)

    def shown() -> bool:
        seen.extend(link.take(POSE))
        return bool(seen) and seen[-1].character is not before

    _until(link, shown)
    took = time.perf_counter() - began
    _until(link, lambda: answers)
    assert answers == [Done()]
    return 1e3 * took, max(each.sensor_to_pose_ms for each in seen)


def _until(link: EdgeClient, done) -> None:  # type: ignore[no-untyped-def]
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "it never came"
        link.poll()
        time.sleep(TURN)
