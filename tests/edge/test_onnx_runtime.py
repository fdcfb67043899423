"""Tests that ONNX Runtime is loaded without telemetry, and that only its own telemetry files are removed."""

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from enliven_edge.onnx_runtime import remove_telemetry_files

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the files are those of Linux and macOS")
LOADED_BEFORE = (
    "import onnxruntime; "
    "from enliven_edge.tracking.estimator.estimator import load_shipped_estimator as s; s()"
)
DEVICE_ID = "0f2c6f1a-55d3-4f0e-9b0a-1d2e3f405162"


@pytest.fixture
def left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Creates the telemetry files of an older version in a home folder. Returns the folder. The session file
    is in ``tmp``.
    """
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    folder = tmp_path / "cache" / "Microsoft" / "DeveloperTools" / ".onnxruntime"
    folder.mkdir(parents=True)
    (folder / "deviceid").write_text(DEVICE_ID)
    with sqlite3.connect(folder / "onnxruntime.db") as queue:
        queue.execute("pragma journal_mode=wal")
        queue.execute("create table events (event)")
    queue.close()
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp" / ".ses").write_text(f"1795827400865\n{DEVICE_ID}\n")
    return folder


def test_leftovers_of_older_versions_are_removed(left: Path, tmp_path: Path) -> None:
    assert {path.name for path in remove_telemetry_files()} == {"deviceid", "onnxruntime.db", ".ses"}
    assert list((tmp_path / "cache").iterdir()) == [] == list((tmp_path / "tmp").iterdir())
    assert remove_telemetry_files() == []


def test_files_of_others_stay(left: Path, tmp_path: Path) -> None:
    other = left.parent / "deviceid"
    other.write_text(DEVICE_ID)
    (left / "notes.txt").write_text("mine")
    (tmp_path / "tmp" / ".ses").write_text("my session")
    remove_telemetry_files()
    assert other.exists() and (tmp_path / "tmp" / ".ses").exists()
    assert [path.name for path in left.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("name", ["deviceid", "onnxruntime.db"])
def test_a_file_with_another_content_stays(left: Path, name: str) -> None:
    (left / name).write_text("something else")
    remove_telemetry_files()
    assert (left / name).read_text() == "something else"


def test_links_are_not_followed(left: Path, tmp_path: Path) -> None:
    target = tmp_path / "precious"
    (left / "deviceid").rename(target)
    (left / "deviceid").symlink_to(target)
    (tmp_path / "tmp" / ".ses").unlink()
    (tmp_path / "tmp" / ".ses").symlink_to(target)
    remove_telemetry_files()
    assert target.exists() and (left / "deviceid").is_symlink()
    moved = tmp_path / "elsewhere"
    target.rename(left / "deviceid")
    left.rename(moved)
    left.symlink_to(moved)
    assert remove_telemetry_files() == [] and (moved / "deviceid").exists()


def test_a_pipe_in_place_of_a_file_does_not_block(left: Path) -> None:
    (left / "deviceid").unlink()
    os.mkfifo(left / "deviceid")
    remove_telemetry_files()
    assert (left / "deviceid").exists()


def test_a_queue_in_use_by_another_process_stays(left: Path) -> None:
    hold = "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('select * from events')"
    command = [sys.executable, "-c", f"{hold}; print('open', flush=True); sys.stdin.read()"]
    with subprocess.Popen(
        [*command, left / "onnxruntime.db"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"open\n"
        assert remove_telemetry_files() == []
        assert {"deviceid", "onnxruntime.db"} <= {path.name for path in left.iterdir()}
        process.communicate()
    assert remove_telemetry_files() != []


def test_the_library_loaded_before_enliven_is_warned_about(tmp_path: Path) -> None:
    own = {"HOME": str(tmp_path), "TMPDIR": str(tmp_path), "PATH": os.environ["PATH"]}
    own["NUMBA_DISABLE_JIT"] = "1"
    shown = subprocess.run(
        [sys.executable, "-c", LOADED_BEFORE], env=own, capture_output=True, text=True, timeout=120
    )
    assert shown.returncode == 0 and "ORT_DISABLE_TELEMETRY=1 before" in shown.stderr
