"""Tests that a running recording is not lost: slow presses end it, and closing the window keeps it."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window
from swaying import swaying

from enliven.formats.project.file import read_project, write_project
from enliven.wire import BODIES
from enliven_viewer.link.received_data import ReceivedBodies
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.project_store import ProjectStore
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_recording_session.py"
STEP = 33_333_333


@pytest.mark.slow
def test_slow_presses_work_and_a_closed_window_loses_nothing(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"], report
    assert report["record"] == "counting" and report["cancel"] == "idle", (
        "0.3 s on what changes with each beat"
    )
    assert report["stop"] == ["idle", ["chair"]], "0.3 s on what shows the running time"
    assert report["play"] is False and report["again"] == [True, True]
    quiet, *others = report["places"]
    assert all(quiet) and all(other == quiet for other in others), "nothing moves as texts come and go"
    assert report["lines"][0] == report["lines"][1] == report["lines"][2], "a character keeps its line"
    left, top, wide, high = report["inside"]
    for place in quiet[:2]:
        assert left <= place[0] and place[2] <= left + wide and top <= place[1] and place[3] <= top + high
    assert report["moved"] is True
    assert report["title"] == "*clean - enliven", "a clean project with a recording has something to save"
    assert report["asks"] == ["unsaved", "recording"] and report["goes on"] == ["", "recording"]
    takes = list(read_project(tmp_path / "clean.enliven").bodies)
    assert takes == ["take 1", "take 2"], "the running one was saved with the rest"


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Returns a saved project with a running recording of one second."""
    opened = Workspace.new(Editor(), tmp_path / "recovery")
    opened.store.save(tmp_path / "work.enliven")
    recording = opened.state(PerformSession).recording
    recording.recorder.record(BODIES, frame(0))
    recording.recorder.begin("take 1")
    recording.phase = "recording"
    perform(opened, 30)
    return opened


def frame(number: int) -> ReceivedBodies:
    return ReceivedBodies("edge", number * STEP, 0, (swaying(1, number),))


def perform(workspace: Workspace, until: int) -> None:
    recorder = workspace.recording.recorder
    begun = recorder.copy_unfinished()
    for number in range(len(begun.frames) if begun else 0, until):
        recorder.record(BODIES, frame(number))


def seconds(path: Path) -> float:
    """Returns the length of the performer's take in a project file in seconds, 0 if there is none."""
    return max(
        (take.duration for name, take in read_project(path).takes.items() if "take 1" in name), default=0
    )


@pytest.mark.parametrize("wish", ["quit", "new"])
def test_a_clean_project_asks_while_it_records(workspace: Workspace, tmp_path: Path, wish: str) -> None:
    assert workspace.store.dirty and workspace.store.title.startswith("*")
    workspace.actions.do(f"file.{wish}")
    assert workspace.asking == "unsaved" and not workspace.ended
    workspace.cancel()
    assert workspace.recording.phase == "recording", "it went on meanwhile"
    workspace.actions.do(f"file.{wish}")
    workspace.continue_waiting_command(discard=False)
    assert seconds(tmp_path / "work.enliven") > 0.9
    assert workspace.recording.phase == "idle"
    assert workspace.ended if wish == "quit" else workspace.store.path is None


def test_opening_another_project_asks_while_it_records(workspace: Workspace, tmp_path: Path) -> None:
    write_project(tmp_path / "other.enliven", workspace.editor.project)
    workspace.open(tmp_path / "other.enliven")
    assert workspace.asking == "unsaved"
    workspace.continue_waiting_command(discard=False)
    assert workspace.store.name == "other" and seconds(tmp_path / "work.enliven") > 0.9


def test_discarding_drops_the_recording_and_nothing_else(workspace: Workspace, tmp_path: Path) -> None:
    before = (tmp_path / "work.enliven").read_bytes()
    workspace.quit()
    workspace.continue_waiting_command(discard=True)
    assert workspace.ended and not workspace.recording.recorder.recording
    assert (tmp_path / "work.enliven").read_bytes() == before


def test_saving_during_a_recording_stores_the_take_so_far(workspace: Workspace, tmp_path) -> None:
    workspace.save_or_ask()
    first = seconds(tmp_path / "work.enliven")
    assert first > 0.9 and workspace.recording.phase == "recording" and workspace.store.dirty
    perform(workspace, 60)
    workspace.save_or_ask()
    assert seconds(tmp_path / "work.enliven") > first + 0.9
    workspace.recording.stop()
    assert workspace.store.dirty
    workspace.save_or_ask()
    assert not workspace.store.dirty and seconds(tmp_path / "work.enliven") > 1.9
    assert [name for name in workspace.editor.project.takes if "take 1" in name] == ["take 1"]


def test_a_recording_that_is_given_up_after_it_was_saved_can_be_saved_away(workspace, tmp_path: Path) -> None:
    workspace.save_or_ask()
    workspace.recording.discard()
    assert workspace.store.dirty, "the file has what the window no longer has"
    workspace.save_or_ask()
    assert not workspace.store.dirty and not seconds(tmp_path / "work.enliven")


def test_running_recordings_are_written_for_recovery(workspace: Workspace, tmp_path: Path) -> None:
    store = workspace.store
    store.autosave(store.saved_at + 60.0)
    store.settle()
    (kept,) = (tmp_path / "recovery").glob("recovery-*.enliven")
    assert seconds(kept) > 0.9
    perform(workspace, 90)
    store.autosave(store.saved_at + 600.0)
    store.settle()
    assert seconds(kept) > 2.8, "again and again while it runs"
    after = ProjectStore(Editor(), tmp_path / "recovery")
    moved = kept.rename(tmp_path / "recovery" / "recovery-999999999.enliven")
    after.recover(moved)
    assert any("take 1" in name for name in after.editor.project.takes)


def test_a_recovery_file_is_written_before_anything_has_moved(workspace: Workspace, tmp_path: Path) -> None:
    """An empty recording is no risk for the project or the window."""
    recorder = workspace.recording.recorder
    recorder.end()
    recorder.handle_restart()
    recorder.begin("take 1")
    workspace.store.autosave_now()
    (kept,) = (tmp_path / "recovery").glob("recovery-*.enliven")
    assert read_project(kept).takes.keys() == workspace.editor.project.takes.keys()
    assert not workspace.editor.toasts.shown or not workspace.editor.toasts.shown[-1].is_error


def test_written_take_does_not_change_while_recording_continues(workspace: Workspace) -> None:
    change, took = workspace.recording.make_unfinished_edit(), []
    assert change is not None
    thread = threading.Thread(target=lambda: took.append(change(workspace.editor.project)))
    perform(workspace, 200)
    thread.start()
    thread.join()
    (take,) = (each for name, each in took[0].takes.items() if "take 1" in name)
    assert np.isclose(take.duration, 29 / 30, atol=0.05)
