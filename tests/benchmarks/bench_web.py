"""Measures the web page: the time from an edge's sending to the decoded pose in Chromium, and the bytes of a
frame.

An edge publishes 4 characters and 2 performers at 30 frames per second. The page is in headless Chromium on
the same machine, which draws small images with the processor. The delay therefore includes waiting for the
image in progress.
"""

from __future__ import annotations

import functools
import statistics
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from browser import MISSING_REASON, open_browser
from figure import Figure
from published_stage import INTERVAL_S, PublishedStage
from websockets.sync.client import connect

from enliven.document import Character, Pose, SkinWeights
from enliven.person import Body
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.samples.shipped import load_sample
from enliven_viewer.web.access import load_access
from enliven_viewer.web.server import WebServer

CHARACTERS, NODES = 4, 128
FRAMES = 150
PATIENCE_S = 120.0
"""Timeout of the measurement, seconds."""


def figures() -> Iterator[Figure]:
    """Yields ``web.bytes_per_frame``, and ``web.latency_ms`` if Chromium is installed."""
    stop = threading.Event()
    with PublishedStage(
        "bench-web", {name: make_pose(name, 0) for name in list_names()}, make_people(0)
    ) as stage:
        mover = threading.Thread(target=move, args=(stage, stop))
        mover.start()
        server = WebServer(stage.address, load_access("127.0.0.1"))
        thread = threading.Thread(target=server.run)
        thread.start()
        try:
            yield Figure("web.bytes_per_frame", measure_bytes(server, stage), "B")
            if not MISSING_REASON:
                yield Figure("web.latency_ms", measure_latency(server), "ms")
        finally:
            server.stop()
            stop.set()
            thread.join()
            mover.join()


def list_names() -> list[str]:
    """Returns the names of the characters."""
    return [f"chair {number}" for number in range(CHARACTERS)]


@functools.cache
def make_character(name: str) -> Character:
    """Returns a chair with a deformation graph."""
    mesh, rng = load_sample("chair"), np.random.default_rng(1)
    vertices = mesh.vertices.astype(np.float32)
    pivots = vertices[np.sort(rng.choice(len(vertices), NODES, replace=False))]
    distance = np.linalg.norm(vertices[:, None] - pivots, axis=2)
    nearest = np.argsort(distance, axis=1)[:, :4].astype(np.uint16)
    weights = 1 / (np.take_along_axis(distance, nearest.astype(int), 1) + 0.05)
    skin = SkinWeights(nearest, (weights / weights.sum(1, keepdims=True)).astype(np.float32))
    edges = np.argwhere(np.triu(np.linalg.norm(pivots[:, None] - pivots, axis=2) < 0.12, 1)).astype(np.int32)
    return Character(name, vertices, mesh.faces, skin, pivots, edges, "graph", mesh.colours)


def make_pose(name: str, frame: int) -> tuple[Character, Pose]:
    """Returns a character and its pose in a frame, smoothly bent and rotated as by a performer."""
    character = make_character(name)
    phase = 2 * np.pi * frame / 60 + compute_phase(name)
    pivots = character.pivots.astype(np.float64)
    bend = np.stack(
        [0.4 * np.sin(phase) * pivots[:, 1], 0.2 * np.cos(phase) + 0 * pivots[:, 0], 0 * pivots[:, 0]], 1
    )
    turns = to_matrix(from_rotation_vector(bend))
    positions = np.einsum("jab,jb->ja", turns, pivots) + np.array([0.5 * compute_phase(name), 0.0, 0.0])
    return character, Pose(name, frame, turns.astype(np.float32), positions.astype(np.float32))


def compute_phase(name: str) -> float:
    """Returns a different number for each character, the same in every run."""
    return float(list_names().index(name))


def make_people(frame: int) -> tuple[Body, ...]:
    """Returns two people with moving joints."""
    rng = np.random.default_rng(2)
    joints = rng.uniform(-0.8, 0.8, (20, 3)) + np.array([0.0, 1.0, 0.0])
    moved = joints + 0.1 * np.sin(2 * np.pi * frame / 60 + joints)
    return Body(1, moved, np.ones(20)), Body(2, moved + np.array([1.0, 0.0, 0.0]), np.ones(20))


def move(stage: PublishedStage, stop: threading.Event) -> None:
    """Changes the poses of the stage until ``stop`` is set."""
    frame = 0
    while not stop.wait(INTERVAL_S):
        frame += 1
        stage.poses = {name: make_pose(name, frame) for name in list_names()}
        stage.bodies = make_people(frame)


def measure_bytes(server: WebServer, stage: PublishedStage) -> float:
    """Returns the mean bytes per frame, without characters, for one page that answers at once."""
    with connect(f"ws://127.0.0.1:{server.port}/live", max_size=None) as page:
        poses = size = 0
        deadline = time.monotonic() + PATIENCE_S
        while poses < FRAMES * CHARACTERS and time.monotonic() < deadline:
            data = page.recv(timeout=PATIENCE_S)
            if isinstance(data, str):
                continue
            number, batch = msgspec.msgpack.decode(data)
            page.send(str(number))
            count = sum(message.startswith(b"pose\0") for message in batch)
            if count and not any(message.startswith(b"character\0") for message in batch):
                size += len(data)
                poses += count
    return size * CHARACTERS / poses


def measure_latency(server: WebServer) -> float:
    """Returns the median milliseconds from sending a pose to its decoded transforms in the page."""
    with tempfile.TemporaryDirectory() as folder, open_browser(Path(folder)) as browser:
        page = browser.open()
        page.resize(160, 90)
        page.call("Page.navigate", url=server.link)
        page.wait_for("window.enliven?.live?.statistics.poses > 20")
        page.run("enliven.live.statistics.delays.length = 0")
        page.wait_for("enliven.live.statistics.delays.length >= 200")
        return statistics.median(page.run("enliven.live.statistics.delays"))
