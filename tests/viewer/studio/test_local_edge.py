"""Tests that the window shows start-up errors of an edge on this machine."""

import time

import pytest
from patience import TIMEOUT_S

from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.files import add_sample


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--sensor", "webcam", "--set", "device=/dev/video99"), "/dev/video99: the camera was not found"),
        (("--sensor", "kinekt"), "kinekt"),
    ],
)
def test_local_camera_start_error_is_shown(tmp_path, words, said):
    editor = Editor()
    perform = PerformSession(editor, tmp_path)
    perform.connect_local(*words)
    assert not perform.known_addresses, "its address is another one the next time"
    deadline = time.monotonic() + TIMEOUT_S
    while perform.live is not None:
        assert time.monotonic() < deadline, "the edge never ended"
        perform.advance(0.01)
        time.sleep(0.02)
    (toast,) = (toast for toast in editor.toasts.shown if toast.is_error)
    assert said in toast.text and toast.remedy and "enliven:" not in toast.text


def test_characters_of_a_local_stage_move_to_the_next_stage(tmp_path):
    editor = Editor()
    perform = PerformSession(editor, tmp_path)
    perform.connect_local("--sensor", "kinekt")
    add_sample(editor, "chair")
    perform.staged.sender.mark_sent("chair", editor.project.character("chair"))
    assert not perform.staged.waiting
    perform.disconnect()
    assert perform.staged.waiting == ("chair",)
    perform.disconnect()
    assert perform.staged.waiting == ("chair",), "leaving again changes nothing"
