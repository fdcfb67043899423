"""Tests of scanning over the wire: an edge scans what its camera sees, and a late viewer receives the whole
scan.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scanning_edge import ScanningEdge

from enliven.errors import InputError
from enliven.samples.shipped import load_sample
from enliven.wire import SCAN, SCAN_PIECE, Refused, Scan, ScanMode
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box
from enliven_viewer.link.edge_client import EdgeClient

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "synthesis"))
from test_handheld import box_mesh

THING = box_mesh(Box((-0.2, 0.0, -0.15), (0.2, 0.5, 0.15)))
PATH = HandheldPath(target=(0.0, 0.2, 0.0), radius=1.2, height=(0.8, 1.0), turns=1.0, seconds=6.0)


@pytest.fixture(scope="module")
def frames():
    take = HandheldScan(THING, load_profile("kinect1"), PATH, width=320, colour=True)
    return [take.frame(index) for index in range(0, take.frames, 5)]


@pytest.fixture
def running():
    edge = ScanningEdge()
    yield edge
    edge.close()


def seen(viewer: EdgeClient, number: int = 1) -> set[str]:
    return {key for key, piece in viewer.latest(SCAN_PIECE).items() if piece.number == number and piece.seen}


@pytest.mark.slow
def test_scan_starts_grows_is_undone_and_becomes_a_character(running, frames) -> None:
    viewer = running.viewer()
    assert isinstance(running.ask(Scan("pause")), Refused), "no scan is running"
    running.ask(Scan("start", name="box", voxel=0.008))
    assert "a scan" in running.ask(Scan("start")).reason or "starting" in running.answers[-1].reason
    running.until(lambda: running.get_scan_message().phase == "scanning", "the beginning")
    running.feed_frames(frames[:6])
    running.until(lambda: seen(viewer) and running.get_scan_message().view, "a surface, and a way to go on")
    begun = running.get_scan_message().missing
    running.feed_frames(frames[6:22])
    running.until(lambda: len(seen(viewer)) > 4 and running.get_scan_message().missing < begun, "more of it")
    state = running.get_scan_message()
    eye = np.array(state.stage_from_camera).reshape(3, 4)[:, 3]
    assert 0.7 < eye[1] < 1.1 and 0.9 < np.hypot(eye[0], eye[2]) < 1.5, "it stands on the floor"
    assert state.undoable > 1.0 and state.way > 1.0 and 0.0 < state.missing < 1.0
    late = running.viewer()
    running.until(lambda: seen(late) >= seen(viewer), "all of it for who comes late")
    running.ask(Scan("pause"))
    running.until(lambda: running.get_scan_message().phase == "paused", "the pause")
    running.ask(Scan("undo"))
    running.until(lambda: running.get_scan_message().fused < state.fused, "the last seconds back")
    running.ask(Scan("go on"))
    running.until(lambda: running.get_scan_message().phase == "scanning", "more")
    running.feed_frames(frames[12:])
    running.ask(Scan("done"))
    assert isinstance(running.ask(Scan("go on")), Refused), "it is being made"
    running.until(lambda: "box" in viewer.characters and "box" in late.characters, "the character")
    running.until(lambda: running.get_scan_message().phase == "done", "the end")
    character = viewer.characters["box"]
    size = np.ptp(character.vertices, axis=0)
    assert (
        abs(size[1] - 0.5) < 0.03
        and character.colours is not None
        and running.get_scan_message().character == "box"
    )
    running.until(lambda: not running.edge.scans.is_active, "performers again")
    # Continuing the scan extends it.
    before = running.get_scan_message().fused
    running.ask(Scan("go on"))
    running.feed_frames(frames[-8:])
    running.ask(Scan("done"))
    running.until(
        lambda: running.get_scan_message().phase == "done" and viewer.characters["box"] is not character,
        "again",
    )
    assert running.get_scan_message().fused > before and list(running.stage.characters) == ["box"]


@pytest.mark.slow
def test_impossible_scan_gives_the_reason_and_cancelled_scan_is_gone(running, frames) -> None:
    viewer = running.viewer()
    running.ask(Scan("start", voxel=0.016))
    running.until(lambda: running.get_scan_message().phase == "scanning", "the beginning")
    for n in range(4):
        running.edge.step(replace(frames[0], time_ns=n * 1_000_000))
    running.until(lambda: running.get_scan_message().fused > 1, "images")
    running.ask(Scan("done"))
    running.until(lambda: running.get_scan_message().phase == "failed", "the refusal")
    assert (
        "moved only 0 cm" in running.get_scan_message().note
        and "around the object" in running.get_scan_message().remedy
    )
    running.ask(Scan("go on"))
    running.feed_frames(frames[1:8])
    running.until(lambda: seen(viewer), "a surface")
    running.ask(Scan("cancel"))
    running.until(lambda: running.get_scan_message().phase == "off", "the end of it")
    late = running.viewer()
    running.until(lambda: late.latest(SCAN), "what is told late")
    assert not late.latest(SCAN_PIECE) and not running.stage.characters
    with pytest.raises(InputError, match="no scan is running"):
        running.edge.carry_out(Scan("done"))


@pytest.mark.slow
def test_turning_object_is_scanned_in_fine_voxels(running, frames) -> None:
    viewer = running.viewer()
    running.ask(Scan("start", voxel=0.016, mode=ScanMode.TURNED))
    running.until(lambda: running.get_scan_message().phase == "scanning", "the beginning")
    running.feed_frames(frames[:4])
    running.until(lambda: seen(viewer), "a surface")
    piece = next(iter(viewer.latest(SCAN_PIECE).values()))
    assert piece.side * piece.step == pytest.approx(64 * 0.004), "it takes voxels of 4 mm by itself"
    running.ask(Scan("cancel"))


@pytest.mark.slow
def test_scanned_character_is_placed_next_to_the_others(frames) -> None:
    chair = create_mesh_actor(load_sample("chair"), "chair", 32, fit=False)
    running = ScanningEdge([chair])
    try:
        viewer = running.viewer()
        running.ask(Scan("start", voxel=0.016))
        running.until(lambda: running.get_scan_message().phase == "scanning", "the beginning")
        running.feed_frames(frames[:12])
        running.ask(Scan("done"))
        running.until(lambda: "scan" in viewer.characters, "the character")
        apart = viewer.characters["scan"].vertices[:, 0].min() - chair.character.vertices[:, 0].max()
        assert apart == pytest.approx(0.4, abs=1e-3)
    finally:
        running.close()
