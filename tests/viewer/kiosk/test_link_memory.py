"""Tests the memory of the kiosk's link during a long run in lock-step with a real edge."""

from __future__ import annotations

import gc

import pytest
from kiosk_visitors import RATE_HZ, StagedKiosk, SyntheticVisitor

from enliven.kiosk.profile import KioskCharacter, KioskEdge, KioskProfile
from enliven.wire import CameraMessage
from enliven_viewer.kiosk.stage_link import KioskLink
from enliven_viewer.link.edge_client import EdgeClient

MAX_HISTORY_S = 6.0
"""Longest history that a kiosk may store, seconds."""
FRAMES = 600
"""Number of frames in each half of the run: 20 s, more than three times the longest history."""
MAX_LINK_FRAMES = 20_000
"""Number of frames after which a message counts as lost. Each frame takes 2 ms or more."""
IMAGE = CameraMessage([1.0, 0.0, 0.0, 0.0] * 3, [0.9, 0.9, 0.6, 0.5], 96, 72, bytes(range(96)) * 72)
"""A camera preview of the size that edges send."""


class Run:
    """A kiosk's link to an edge with a visitor and camera previews, advanced by the test."""

    def __init__(self, stage: StagedKiosk) -> None:
        self.stage = stage
        profile = KioskProfile(
            edges={"floor": KioskEdge()}, characters={"chair": KioskCharacter("chair", "chair")}
        )
        clients = [EdgeClient([stage.endpoint])]
        self.link = KioskLink(profile, None, clients, clock=lambda: stage.now)
        self.timeline = self.link._edges[0].live.document.timeline
        self.connection = clients[0].edges[0]
        stage.sensor.visitors = [SyntheticVisitor(1, (0.0, 0.0))]
        self.longest_s, self.most_unread_bytes = 0.0, 0

    def advance(self, frames: int) -> None:
        """Runs until the link has received everything that is sent within the next ``frames`` frames."""
        end_ns = round((self.stage.now + frames / RATE_HZ) * 1e9)
        for _ in range(frames + MAX_LINK_FRAMES):
            self.stage.step()
            self.stage.outlet.send(IMAGE, round(self.stage.now * 1e9))
            self.link.advance(1 / RATE_HZ)
            self.longest_s = max(self.longest_s, (self.timeline.end_ns - self.timeline.start_ns) * 1e-9)
            self.most_unread_bytes = max(
                self.most_unread_bytes, sum(each.bytes for each in self.connection.values.inbox.values())
            )
            if self.timeline.end_ns >= end_ns:
                return
        raise TimeoutError(f"the link has received {self.timeline.end_ns} ns of {end_ns} ns")


@pytest.fixture
def run():
    stage = StagedKiosk(("chair", "chair"), name="kiosk-memory")
    run = Run(stage)
    yield run
    run.link.close()
    stage.close()


@pytest.mark.slow
def test_a_kiosk_stores_some_seconds_and_no_camera_images(run):
    run.advance(FRAMES)
    gc.collect()
    before = len(gc.get_objects())
    run.advance(FRAMES)
    gc.collect()
    grown = len(gc.get_objects()) - before
    latest = {name: len(values) for name, values in run.connection.values.latest.items()}
    assert latest["camera"] == 1 and latest["pose"] == 1, "both have arrived"
    assert MAX_HISTORY_S - 1.0 < run.longest_s <= MAX_HISTORY_S + 1.0 / RATE_HZ
    assert len(run.timeline) <= MAX_HISTORY_S * RATE_HZ + 1
    # Physics, voice and the camera send only their newest state, so one message of each may wait.
    assert run.most_unread_bytes < 2 * len(IMAGE.nearness)
    assert grown < FRAMES // 4, "less than one object for each frame"
