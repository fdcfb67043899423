"""Tests of the reports of the kiosk's window: progress only if the image changes, and an image of the
screen.
"""

from __future__ import annotations

import logging
import socket

import numpy as np
import pytest
from PIL import Image

from enliven.errors import ResourceError
from enliven.kiosk.screen_lock import ScreenLock
from enliven.supervision.notify import Notifier, read_notification
from enliven.supervision.records import SCREEN_PICTURE_FILE, read_services
from enliven_viewer.kiosk.cue_sounds import CHORDS, CueSounds, make_sound
from enliven_viewer.kiosk.operator_report import OperatorReport


@pytest.fixture
def supervisor(tmp_path):
    """Returns a supervisor's socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


def received(supervisor) -> list[dict]:
    """Returns the notifications since the last call."""
    messages = []
    while True:
        try:
            messages.append(dict(read_notification(supervisor.recv(4096))))
        except BlockingIOError:
            return messages


def test_only_changed_pictures_are_progress(supervisor, tmp_path):
    report = OperatorReport(Notifier(str(tmp_path / "notify")), tmp_path)
    report.report_picture(1.0, "attract", "", lambda: b"first")
    assert "WATCHDOG" in received(supervisor)[-1]
    for k in range(10):
        report.report_picture(2.0 + k, "attract", "", lambda: b"first")
    assert received(supervisor) == [], "a frozen picture is no progress"


def test_state_and_problem_are_recorded_for_operators(tmp_path, caplog):
    report = OperatorReport(Notifier(""), tmp_path)
    with caplog.at_level(logging.WARNING):
        for k in range(20):
            report.report_picture(float(k), "attract", "the edge does not answer", lambda: b"x")
    record = read_services(tmp_path)[0]
    assert (record.name, record.status) == ("window", "the edge does not answer")
    assert record.figures["fps"] == pytest.approx(1.0, abs=0.6)
    assert [entry.message for entry in caplog.records] == ["the edge does not answer"]


def test_short_gap_is_not_logged(tmp_path, caplog):
    report = OperatorReport(Notifier(""), tmp_path)
    with caplog.at_level(logging.WARNING):
        for k in range(30):
            report.report_picture(0.1 * k, "attract", "gone" if 5 < k < 15 else "", lambda: b"x")
    assert not caplog.records


def test_picture_of_the_screen_is_small_and_written_every_ten_seconds(tmp_path):
    report, calls = OperatorReport(Notifier(""), tmp_path), []

    def pixels():
        calls.append(1)
        return np.full((1080, 1920, 3), 90, np.uint8)

    for k in range(25):
        report.write_picture_if_due(float(k), pixels)
    assert len(calls) == 3
    assert Image.open(tmp_path / SCREEN_PICTURE_FILE).size == (480, 270)


def test_missing_runtime_folder_does_not_stop_the_show(tmp_path):
    report = OperatorReport(Notifier(""), tmp_path / "file")
    (tmp_path / "file").write_text("in the way")
    report.write_picture_if_due(0.0, lambda: np.zeros((10, 10, 3), np.uint8))
    report.report_picture(0.0, "attract", "", lambda: b"x")


def test_second_kiosk_on_a_screen_is_refused(tmp_path):
    first = ScreenLock(0, tmp_path)
    with pytest.raises(ResourceError, match="another kiosk already uses screen 0"):
        ScreenLock(0, tmp_path)
    ScreenLock(1, tmp_path).close()
    first.close()
    ScreenLock(0, tmp_path).close()


@pytest.mark.parametrize("name", CHORDS)
def test_sound_is_audible_and_does_not_clip(name):
    samples = make_sound(name)
    assert 3000 < np.abs(samples).max() < 32767
    assert abs(int(samples[-1])) < 200


def test_sound_is_played_to_its_end_and_then_silence():
    sounds = CueSounds(False)
    sounds._sounds = {"noticed": make_sound("noticed")}
    sounds.play("noticed")
    blocks = []
    for _ in range(60):
        out = np.ones((1024, 1), np.int16)
        sounds.fill(out, 1024)
        blocks.append(out[:, 0].copy())
    played = np.concatenate(blocks)
    length = len(make_sound("noticed"))
    assert np.array_equal(played[:length], make_sound("noticed"))
    assert not played[length:].any()
    sounds.play("unknown")
