"""Tests of scanning in the studio's real window. A real edge replays a camera carried around a chair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window

from enliven.recording import Recorder
from enliven.samples.shipped import load_sample
from enliven.wire import ScanMessage
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.studio.features.scan.advice import choose_advice
from enliven_viewer.studio.features.scan.overlay import make_scan_marks
from enliven_viewer.studio.viewport.overlay import Fill
from enliven_viewer.studio.viewport.picking import Lens

SESSION = Path(__file__).parents[1] / "scan_session.py"
PATH = HandheldPath(target=(0.0, 0.45, 0.0), radius=1.3, height=(0.7, 1.3), turns=1.0, seconds=8.0)


@pytest.fixture(scope="module")
def carried(tmp_path_factory):
    path = tmp_path_factory.mktemp("scan") / "carried.mcap"
    take = HandheldScan(load_sample("chair"), load_profile("kinect1"), PATH, width=320, colour=True)
    with Recorder(path) as recorder:
        for index in range(0, take.frames, 5):
            recorder.write_frame(take.frame(index))
    return path


@pytest.mark.slow
def test_a_chair_is_scanned_undone_kept_and_added_to(carried: Path, tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), str(carried), seconds=600.0)
    assert report["done"], report.get("missing", report)
    assert report["lacks"].startswith("No stage is connected")
    assert report["size"] == "room"
    assert report["grown"][1] > 1.3 * report["grown"][0] > 0
    assert report["words"].startswith(("Walk", "Hold it", "Good"))
    assert report["undone"][1] < report["undone"][0]
    (low, high), (lower, dragged) = np.array(report["dragged"])
    assert report["view kept"], report["dragged"]
    assert 0.5 * high[1] < dragged[1] < high[1] - 0.05, "the top came down, and was taken again there"
    assert (lower == low).all() and (dragged[[0, 2]] == high[[0, 2]]).all()
    faces, (wide, tall, deep) = report["scanned"]
    # The scan has centimetre voxels, covers at most a third of a round, and only the inside of the box.
    assert 1000 < faces <= 50_000
    assert (np.array([wide, tall, deep]) < dragged - lower + 0.02).all() and tall > 0.6 * dragged[1]
    assert report["chosen"] == ["scan", "scan scan", True], "one edit, chosen, with its colours"
    assert len(report["places"]) == 1, "no button moves as advice comes and goes"
    assert report["undone edit"] == []
    assert report["again"] == [["scan"], True], "the same character, of more pictures"


def message(**given: object) -> ScanMessage:
    """Returns a scan's message with a camera at +z, 1.3 m away, that looks at the centre."""
    camera = [1.0, 0, 0, 0.0, 0, -1.0, 0, 0.8, 0, 0, -1.0, 1.3]
    usual: dict[str, object] = {"number": 1, "phase": "scanning", "tracking": "scanning"}
    return ScanMessage(**{**usual, "stage_from_camera": camera, **given})


def view(angle: float, up: float = 0.8) -> list[float]:
    return [1.3 * np.sin(angle), up, 1.3 * np.cos(angle), 0.0, 0.4, 0.0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"view": view(1.0)}, "Walk on to the right"),
        ({"view": view(-1.0, 1.4)}, "Walk on to the left, and hold the camera higher"),
        ({"view": view(3.0)}, "Walk round to the other side"),
        ({"view": view(0.1, 0.3)}, "Hold the camera lower"),
        ({"view": []}, "All sides are scanned: press Done"),
        ({"tracking": "lost", "view": view(1.0)}, "Lost: go back to where you were before"),
        ({"tracking": "empty"}, "The camera sees nothing: go nearer"),
        ({"phase": "paused"}, "Paused"),
        ({"phase": "failed", "note": "nothing stands there"}, "nothing stands there"),
        ({"full": True}, "The scan is full: nothing new is added. Press Done"),
        ({"phase": "done"}, ""),
        ({"thing": "carried", "tracking": "lost"}, "Object lifted or lost: put it down, and go round it"),
        ({"thing": "settling", "seconds": 1.2}, "Looking for the object, 1 s: walk round it slowly"),
        (
            {"thing": "sought", "seconds": 4.0},
            "Not found yet: walk on, and show a side that was scanned before",
        ),
        ({"thing": "found", "seconds": 1.5, "view": view(1.0)}, "Found again in 1.5 s: go round the object"),
        (
            {"thing": "person", "tracking": "empty"},
            "Stand 1 to 3 m in front of the camera, with your whole body in view",
        ),
        ({"thing": "person", "missing": 0.75}, "Turn slowly on the spot: 25 % is scanned"),
        ({"thing": "person", "tracking": "lost"}, "Turn back a little, then continue more slowly"),
        ({"thing": "person", "missing": 0.0}, "All sides are scanned: stand still"),
        ({"stage_from_camera": [], "view": view(1.0)}, "Point the camera at the object"),
    ],
)
def test_scan_state_gives_its_advice(given: dict[str, object], words: str) -> None:
    assert choose_advice(message(**given)).text == words


def test_the_arrow_leads_from_the_camera_to_where_it_is_wanted() -> None:
    camera = OrbitCamera()
    camera.frame((np.array([-1.5, 0.0, -1.5]), np.array([1.5, 1.5, 1.5])), 1.6, at_once=True)
    lens = Lens(camera.view(1.6), (800.0, 500.0))
    marks = make_scan_marks(message(view=view(1.2)), lens)
    assert any(isinstance(mark, Fill) for mark in marks), "the head of the arrow"
    lost = make_scan_marks(message(view=view(1.2), tracking="lost"), lens)
    assert 0 < len(lost) < len(marks) and not any(isinstance(mark, Fill) for mark in lost)
    assert make_scan_marks(message(phase="done"), lens) == ()
