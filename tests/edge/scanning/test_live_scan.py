"""Tests of scanning in the background: a viewer's request takes effect at once, however busy the scan is."""

import copy
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from box_scans import take_of

from enliven.camera import LEVEL_WORLD_FROM_CAMERA
from enliven.errors import InputError
from enliven.samples.shipped import load_sample
from enliven.scanning import Scanner, ScanSettings, VolumeSettings
from enliven.wire import Scan, ScanMessage
from enliven_edge.scanning import scan_placement
from enliven_edge.scanning.live_scan import LiveScan
from enliven_edge.scanning.scan_placement import ScanPlacement
from enliven_edge.scanning.scan_view import create_scan_view
from enliven_synthesis.sensor.handheld import HandheldPath

PATIENCE = 60.0
"""Timeout in seconds, enough for any machine."""


def phases(scan):
    return [message.phase for message in scan.messages() if isinstance(message, ScanMessage)]


@pytest.fixture
def busy(monkeypatch):
    """Blocks a scan in its surface step. Returns the event that reports this, and the event that ends it."""
    looks, free = threading.Event(), threading.Event()

    def update(place, scanner):
        looks.set()
        assert free.wait(PATIENCE)

    monkeypatch.setattr(ScanPlacement, "update", update)
    scan = LiveScan(1, Scan("start", name="box", voxel=0.016), lambda mesh, name, ends: name)
    scan.start()
    yield scan, looks, free
    free.set()
    scan.end()
    scan.join(PATIENCE)
    assert not scan.is_alive()


def test_pause_takes_effect_and_is_reported_while_scan_is_busy(busy):
    scan, looks, free = busy
    take = take_of()
    scan.offer_image(take.frame(0))
    assert looks.wait(PATIENCE)
    scan.messages()
    scan.queue_order(Scan("pause"))
    (paused,) = scan.messages()
    assert scan.phase == paused.phase == "paused"
    scan.offer_image(take.frame(2))
    free.set()
    threading.Event().wait(0.3)
    later = [message for message in scan.messages() if isinstance(message, ScanMessage)]
    assert later and {message.fused for message in later} == {paused.fused}, "no image is added after it"
    assert scan.phase == "paused"


def test_last_of_several_commands_wins(busy):
    scan, looks, free = busy
    assert looks.wait(PATIENCE)
    for word in ("pause", "go on", "pause", "pause", "go on"):
        scan.queue_order(Scan(word))
    assert phases(scan)[-4:] == ["paused", "scanning", "paused", "scanning"]
    free.set()
    threading.Event().wait(0.3)
    assert scan.phase == "scanning"
    with pytest.raises(InputError, match="there is nothing to undo"):
        scan.queue_order(Scan("undo"))


def test_done_is_refused_and_the_scan_can_continue(busy):
    scan, _, free = busy
    free.set()
    scan.queue_order(Scan("done"))
    messages, end = list[ScanMessage](), threading.Event()
    for _ in range(round(PATIENCE / 0.05)):
        messages += [message for message in scan.messages() if isinstance(message, ScanMessage)]
        if messages and messages[-1].phase == "failed":
            break
        end.wait(0.05)
    assert messages[-1].phase == "failed" and "no frame shows enough depth" in messages[-1].note
    scan.queue_order(Scan("go on"))
    assert scan.phase == "scanning"
    messages = [message for message in scan.messages() if isinstance(message, ScanMessage)]
    assert messages[-1].phase == "scanning" and messages[-1].note == messages[-1].remedy == ""


@pytest.mark.slow
def test_a_box_of_the_stage_cuts_out_what_it_holds():
    scan = LiveScan(1, Scan("start", name="box", voxel=0.016), lambda mesh, name, ends: mesh)
    scan.start()
    take = take_of()
    messages = list[ScanMessage]()

    def until(done):
        for _ in range(round(PATIENCE / 0.02)):
            messages.extend(message for message in scan.messages() if isinstance(message, ScanMessage))
            if messages and done(messages[-1]):
                return
            threading.Event().wait(0.02)
        raise AssertionError(messages[-1])

    try:
        for index in range(0, 60, 4):
            while not scan.offer_image(take.frame(index), waits=True):
                pass
        until(lambda said: said.fused == 15 and said.view)
        scan.queue_order(Scan("pause"))
        place = np.array(messages[-1].stage_from_scan).reshape(3, 4)
        # The box is 0.5 m high and stands around the origin of the synthetic world, as seen by the first
        # camera.
        world = take.pose(0) @ np.linalg.inv(LEVEL_WORLD_FROM_CAMERA)
        at = place[:, :3] @ (np.linalg.inv(world) @ [0.0, 0.25, 0.0, 1.0])[:3] + place[:, 3]
        assert abs(at[1] - 0.25) < 0.02, "the floor is y = 0 on the stage"
        wide = np.array([0.4, 0.0, 0.4])
        corners = [float(x) for x in (*((at - wide) * [1, 0, 1]), *(at + wide))]
        scan.queue_order(Scan("done", box=corners, stage_from_scan=messages[-1].stage_from_scan))
        until(lambda said: said.phase == "done")
        mesh = scan.actor
        assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(0.25, abs=0.025), "its lower half"
        assert 0.3 < np.ptp(mesh.vertices[:, 0]) < 0.6
    finally:
        scan.end()


@pytest.mark.slow
def test_the_placement_stays_when_nearly_all_images_are_undone(monkeypatch):
    monkeypatch.setattr(scan_placement, "_SEARCH_INTERVAL_S", 0.0)
    path = HandheldPath(target=(0.0, 0.45, 0.0), radius=1.3, height=(0.7, 1.3), turns=1.0, seconds=8.0)
    take = take_of(load_sample("chair"), path, width=320)
    scanner, place = Scanner(ScanSettings(volume=VolumeSettings(voxel=0.01))), ScanPlacement()
    scanner.add(take.frame(0))
    first = copy.deepcopy(scanner)
    for index in range(5, 60, 5):
        scanner.add(take.frame(index))
    place.update(create_scan_view(scanner))
    stage_from_scan = place.stage_from_scan.copy()
    place.update(create_scan_view(first))
    turn, height = place.stage_from_scan[:3, :3], place.stage_from_scan[1, 3]
    assert np.array_equal(turn, stage_from_scan[:3, :3]) and height == stage_from_scan[1, 3], (
        "the floor is still known"
    )
    alone = ScanPlacement()
    alone.update(create_scan_view(first))
    assert abs(alone.stage_from_scan[1, 3] - stage_from_scan[1, 3]) > 0.05, (
        "one image does not show the floor"
    )
