"""Measures the window: the time from an edit to the stage of a running edge, and scrubbing along the
timeline.

The edit changes an attached mesh of 20,000 vertices. A real edge replays the shipped recording, and its
performer possesses the chair. A client in this process uploads the chair repeatedly, slightly taller each
time.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from figure import Figure

sys.path += [str(Path(__file__).parents[1] / part) for part in ("helpers", "shared", "shared/modeling")]
sys.path.append(str(Path(__file__).parents[2] / "scripts"))
from rig_worlds import graph_world, skeleton_world
from swaying import possessed_chair

from enliven.document import Clip, Project, still_shape
from enliven.formats.project.file import parse_project, project_bytes
from enliven.formats.project.one_character import project_of_mesh
from enliven.meshes import refine
from enliven.modeling.edits import paste_character
from enliven.modeling.puppet.edits import play_take
from enliven.motion.layers.retarget import bind_chain
from enliven.rotation import IDENTITY
from enliven.samples.shipped import cactus_project, load_sample
from enliven.wire import CUES, POSE, Done
from enliven.wire.ports import free_ports
from enliven.wire.sockets import Endpoint
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.studio.app.time_axis import RULER_HEIGHT
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace

LAYERS = 10
SCRUBS = 80
VERTICES = 20_000
LAPS = 9
HALF_MINUTE = 30.0
"""Length of the motion of each of ten characters, seconds."""
PATIENCE = 120.0
"""Timeout for the start of the edge with a character on the stage, seconds."""
QUIET = 2.0
"""Time before the first edit, seconds. Its frames are compared with those during an edit."""
TURN = 0.002
"""Interval between two polls of the sockets, seconds."""


def figures() -> Iterator[Figure]:
    """Yields window.scrub_ms, window.project_mb and _disk_mb, window.edit_to_stage_ms and
    window.put_latency_ms."""
    yield _scrub()
    yield from _measure_size()
    pose, control = free_ports()[:2]
    words = ["--possess-at", "0.5", "--loop", "--port", str(pose), "--control-port", str(control)]
    command = [sys.executable, "-m", "enliven", "edge", *words, "--name", f"bench-{os.getpid()}"]
    edge = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    link = EdgeClient([Endpoint("127.0.0.1", pose, control)])
    try:
        yield from _measure_laps(link)
    finally:
        link.close()
        edge.terminate()
        edge.wait()


def _scrub() -> Figure:
    """Measures this thread's milliseconds from a pointer position on the ruler until all characters are at
    that time.

    The characters are a skeleton with eight layers, and a possessed mesh and a puppet with one layer each.
    Drawing is not included.
    """
    project, names = Project(), []
    for source, name in (skeleton_world(), graph_world(), (_load_acting_cactus(), "cactus")):
        project, pasted = paste_character(project, source, name)
        names.append(pasted)
    arm = project.shape(names[0])
    for number in range(LAYERS - 2 - len(arm.layers)):
        take, chain = arm.layers[0].take, range(len(arm.skeleton))
        project = bind_chain(project, arm.id, chain, take, arm.layers[0].chain, offset=0.1 * number)
    workspace = Workspace(Editor(project=project))
    get_puppet_editor(workspace.editor).motion_solver.settle(project, names[2])
    surfaces, puppet = get_puppet_editor(workspace.editor).stage.surfaces, project.puppet(names[2])
    while not surfaces.is_prepared(puppet):
        time.sleep(TURN)
    timeline, took = workspace.state(TimelineInput), list[float]()
    layout = timeline.layout
    timeline.press(layout.x(0.0), RULER_HEIGHT / 2)
    for step in range(SCRUBS):
        x = layout.x((0.137 * step) % layout.length)
        began = time.thread_time()
        timeline.drag(x)
        timeline.layout.lanes()
        assert len(workspace.editor.stage_characters) == 3
        took.append(1e3 * (time.thread_time() - began))
    return Figure("window.scrub_ms", statistics.median(took[SCRUBS // 4 :]), "ms")


def _measure_size() -> Iterator[Figure]:
    """Measures the megabytes of a project, read from its file, of ten characters with half a minute of motion
    each.

    It has four skeletons of the cactus' performer, three possessed chairs and three puppets, each with its
    own take. Memory is what Python reports after reading.
    """
    project, names = Project(), list[str]()
    dance = _make_long_take(next(iter(cactus_project().takes.values())))
    puppet = play_take(cactus_project().with_takes(dance), "cactus", dance.id)
    dancer = Project().with_takes(dance).with_characters(still_shape("dancer", dance.skeleton))
    for joint in range(1, len(dance.skeleton)):
        dancer = bind_chain(dancer, "dancer", (joint,), dance.id, (joint,), basis=IDENTITY)
    chair, name = possessed_chair(frames=round(HALF_MINUTE * 30))
    for source, character, count in ((dancer, "dancer", 4), (chair, name, 3), (puppet, "cactus", 3)):
        for number in range(count):
            project, pasted = paste_character(project, _delay_takes(source, number), character)
            names.append(pasted)
    assert len(set(names)) == len(project.characters) == 10
    stored = project_bytes(project)
    tracemalloc.start()
    read = parse_project(stored)
    used_bytes = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert (len(read.characters), len(read.takes), len(read.streams)) == (10, 6, 3)
    yield Figure("window.project_mb", used_bytes / 1e6, "MB")
    yield Figure("window.project_disk_mb", len(stored) / 1e6, "MB")


def _delay_takes(project: Project, number: int) -> Project:
    """Returns the project with takes that begin some frames later, so that each character has a different
    motion."""
    by = 7 * number
    takes = [
        replace(take, turns=np.roll(take.turns, by, 0), root=np.roll(take.root, by, 0))
        for take in project.takes.values()
    ]
    streams = [
        replace(stream, linear=np.roll(stream.linear, by, 0), positions=np.roll(stream.positions, by, 0))
        for stream in project.streams.values()
    ]
    return project.with_takes(*takes).with_streams(*streams)


def _make_long_take(clip: Clip) -> Clip:
    """Returns a take of half a minute, made by playing a clip forwards and backwards."""
    turns, root = (np.concatenate([part, part[-2:0:-1]]) for part in (clip.turns, clip.root))
    times = round(HALF_MINUTE / clip.step)
    rounds = -(-times // len(turns))
    return replace(
        clip, turns=np.tile(turns, (rounds, 1, 1))[:times], root=np.tile(root, (rounds, 1))[:times]
    )


def _load_acting_cactus() -> Project:
    """Returns the shipped cactus, with its take."""
    project = cactus_project()
    return play_take(project, "cactus", next(iter(project.takes)))


def _measure_laps(link: EdgeClient) -> Iterator[Figure]:
    _run_until(
        link, lambda: (held := link.latest(CUES).get("chair")) is not None and held.state == "possessed"
    )
    link.take(POSE)
    _run_until(link, lambda ends=time.monotonic() + QUIET: time.monotonic() > ends)
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


def _lap(link: EdgeClient, mesh) -> tuple[float, float]:
    """Returns the milliseconds from an edit to its first pose, and the longest latency from sensor to pose
    during that time.
    """
    answers, seen, before = [], [], link.characters["chair"]
    began = time.perf_counter()
    link.stage.put(project_of_mesh(mesh, "chair"), "chair", then=answers.append)

    def shown() -> bool:
        seen.extend(link.take(POSE))
        return bool(seen) and seen[-1].character is not before

    _run_until(link, shown)
    took = time.perf_counter() - began
    _run_until(link, lambda: answers)
    assert answers == [Done()]
    return 1e3 * took, max(each.sensor_to_pose_ms for each in seen)


def _run_until(link: EdgeClient, done) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "it never came"
        link.poll()
        time.sleep(TURN)
