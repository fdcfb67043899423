"""The window: from an edit to the stage of a running edge, and a scrub along the timeline.

An edit is of a mesh of 20,000 vertices that is held. A real edge replays the shipped recording and its
performer holds the chair, which is put again and again, a little taller each time, by a client in this
process.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from figure import Figure

sys.path += [str(Path(__file__).parents[1] / part) for part in ("helpers", "shared", "shared/modeling")]
sys.path.append(str(Path(__file__).parents[2] / "scripts"))
from test_character_laws import graph_world, skeleton_world

from enliven.document import Project
from enliven.formats.project import project_of_mesh
from enliven.meshes import refine
from enliven.modeling.edits import paste_character
from enliven.modeling.puppet import play_take
from enliven.motion.layers import bind_chain
from enliven.samples import cactus_project, load_sample
from enliven.wire import CUES, POSE, Done
from enliven.wire.ports import free_ports
from enliven.wire.sockets import Endpoint
from enliven_viewer.link.edges import EdgeClient
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.timeline import RULER
from enliven_viewer.studio.workspace import Workspace

LAYERS = 10
SCRUBS = 80
VERTICES = 20_000
LAPS = 9
PATIENCE = 120.0
"""Seconds in which the edge has started, and a character stands on the stage."""
QUIET = 2.0
"""Seconds of frames before the first edit, with which those during an edit are compared."""
TURN = 0.002
"""Seconds between two looks at the sockets."""


def figures() -> Iterator[Figure]:
    """window.scrub_ms, window.edit_to_stage_ms and window.put_latency_ms."""
    yield _scrub()
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


def _scrub() -> Figure:
    """Milliseconds of this thread from a place of the pointer on the ruler to all characters there.

    A skeleton with eight layers, a possessed mesh and a puppet with one each; drawing is apart.
    """
    project, names = Project(), []
    for source, name in (skeleton_world(), graph_world(), (_acting(), "cactus")):
        project, pasted = paste_character(project, source, name)
        names.append(pasted)
    arm = project.shape(names[0])
    for number in range(LAYERS - 2 - len(arm.layers)):
        take, chain = arm.layers[0].take, range(len(arm.skeleton))
        project = bind_chain(project, arm.id, chain, take, arm.layers[0].chain, offset=0.1 * number)
    workspace = Workspace(Editor(project=project))
    workspace.editor.solving.settle(project, names[2])
    surfaces, puppet = workspace.puppets.stage.surfaces, project.puppet(names[2])
    while not surfaces.prepared(puppet):
        time.sleep(TURN)
    timeline, layout, took = workspace.timeline, workspace.timeline.layout, list[float]()
    timeline.press(layout.x(0.0), RULER / 2)
    for step in range(SCRUBS):
        x = layout.x((0.137 * step) % layout.length)
        began = time.thread_time()
        timeline.drag(x)
        timeline.layout.lanes()
        assert len(workspace.editor.standing) == 3
        took.append(1e3 * (time.thread_time() - began))
    return Figure("window.scrub_ms", statistics.median(took[SCRUBS // 4 :]), "ms")


def _acting() -> Project:
    """The cactus that ships, with its take."""
    project = cactus_project()
    return play_take(project, "cactus", next(iter(project.takes)))


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
