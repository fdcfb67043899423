"""Tests of this machine's cameras in the window: found by the edge's program, previewed, and started."""

from __future__ import annotations

import io
import json
import time

import pytest
from PIL import Image

from enliven_viewer.studio.features.perform.cameras import Camera, CameraSearch

PATIENCE_S = 120.0
"""Timeout in seconds for the edge's program to start, on a machine with ten times its normal load."""


def until(done) -> None:
    end = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < end, "the edge's program did not end"
        time.sleep(0.05)


def test_edge_lists_its_cameras_in_the_background() -> None:
    search = CameraSearch()
    assert search.cameras is None
    search.begin()
    assert search.is_searching, "the window does not wait"
    until(lambda: (search.poll(), search.cameras is not None)[1])
    assert not search.problem and not search.is_searching
    assert all(camera.title for camera in search.cameras or ())
    search.close()


@pytest.mark.slow
def test_preview_shows_the_cameras_image() -> None:
    search, made_up = CameraSearch(), Camera("A simulated person", "synthetic", {"width": "160"})
    search.take_test_image(made_up)
    assert search.tested_camera == made_up
    until(lambda: (search.poll(), search.tested_camera is None)[1])
    assert search.picture is not None and search.picture.ndim == 3 and search.picture.std() > 5
    assert search.test_result == (made_up, "Bright is near, dark is far.") and search.number == 1
    search.take_test_image(Camera("None", "replay", {"path": "nothing.mcap"}))
    until(lambda: (search.poll(), search.tested_camera is None)[1])
    assert (
        search.picture is None and search.test_result is not None and "nothing.mcap" in search.test_result[1]
    )
    search.close()


def test_a_camera_starts_by_its_words_unless_something_is_missing() -> None:
    camera = Camera("OAK-D S1", "oak", {"device": "S1"})
    assert camera.words == ("--sensor", "oak", "--set", "device=S1") and camera.can_start
    assert not Camera("Kinect", "", {}, "enliven has no driver for this camera", "Add one.").can_start
    assert not Camera("OAK", "oak", {}, "depthai is not installed", "Type: pip install").can_start


@pytest.mark.parametrize("answer", ["", "no JSON", json.dumps([{"name": 1}]), "[" * 5000])
def test_an_answer_that_is_no_list_is_no_crash(answer: str) -> None:
    search = CameraSearch()
    search.handle_search(answer, True)
    assert search.cameras == () and "enliven doctor" in search.problem


def test_unreadable_preview_picture_is_reported(tmp_path) -> None:
    search, path = CameraSearch(), tmp_path / "depth.png"
    path.write_bytes(b"no picture")
    search.handle_test(Camera("a", "tof"), "", path, False)
    assert (
        search.picture is None
        and search.test_result is not None
        and "could not be read" in search.test_result[1]
    )
    out = io.BytesIO()
    Image.new("RGB", (4, 3)).save(out, "PNG")
    path.write_bytes(out.getvalue())
    search.handle_test(Camera("a", "tof"), "", path, False)
    assert search.picture is not None and search.picture.shape == (3, 4, 3)
