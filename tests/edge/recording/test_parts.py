"""Tests that a recording resumes in a new file once there is space, and that each start uses a free file
name.
"""

import os
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest
from patience import wait_until

import enliven_edge.assets
from enliven.errors import InputError, ResourceError
from enliven.recording import Recording
from enliven.wire import free_ports
from enliven_edge.recording import parts
from enliven_edge.recording.parts import PartedRecorder, free_path

CHAIR = Path(enliven_edge.assets.__file__).with_name("chair.mcap")
SOURCE = Path(__file__).parents[2] / "helpers" / "fault_hook.c"
MESSAGE = ("topic", "kind", "", "", "bytes")


def poses(path: Path) -> int:
    """Returns the number of poses in a recording that may still grow, 0 if the file does not exist."""
    time.sleep(0.2)
    with warnings.catch_warnings(action="ignore"):
        return topics(path).get("pose", 0) if path.exists() and path.stat().st_size else 0


def topics(path: Path) -> dict[str, int]:
    return {name: topic.count for name, topic in Recording(path).info.topics.items()}


def test_placeholders_name_a_new_file_at_each_start(tmp_path) -> None:
    names = []
    for pattern in ["take-{number}.mcap"] * 3 + ["take-{time}.mcap"] * 2 + ["plain.mcap"]:
        path = free_path(tmp_path / pattern)
        path.touch()
        names.append(path.name)
    assert names[:3] == ["take-001.mcap", "take-002.mcap", "take-003.mcap"]
    assert len(set(names)) == 6 and names[-1] == "plain.mcap"
    assert time.strptime(names[3], "take-%Y%m%d-%H%M%S.mcap")
    assert free_path(tmp_path / "{time}-{number}.mcap").name.endswith("-001.mcap")
    with pytest.raises(InputError, match=r"placeholder \{date\}"):
        free_path(tmp_path / "take-{date}.mcap")


def test_a_link_to_nowhere_is_no_free_name(tmp_path) -> None:
    (tmp_path / "take-001.mcap").symlink_to(tmp_path / "elsewhere")
    assert free_path(tmp_path / "take-{number}.mcap").name == "take-002.mcap"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs tmpfs")
def test_a_full_disk_pauses_and_room_resumes(tmp_path, monkeypatch) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "none", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a small disk can be mounted by root only")
    now = [0.0]  # a clock that only the test advances, so that a delay of the machine causes no retry
    monkeypatch.setattr(parts, "time", SimpleNamespace(monotonic=lambda: now[0]))
    filler, begun = disk / "filler", []
    filler.write_bytes(bytes(600 << 10))
    try:
        with PartedRecorder(disk / "take.mcap") as recorder:
            recorder.on_part_started = lambda is_after_gap: begun.append(recorder.path.name)
            recorder.add_metadata("place", {"room": "1"})

            def write_until(done) -> None:
                deadline = time.monotonic() + 20.0
                while not done() and time.monotonic() < deadline:
                    recorder.write(*MESSAGE, os.urandom(4096), time.monotonic_ns())
                    time.sleep(0.002)

            write_until(lambda: recorder.failure is not None)
            assert "No space left" in str(recorder.failure) and begun == []
            before = recorder.lost
            recorder.write(*MESSAGE, b"lost", time.monotonic_ns())
            assert recorder.lost == before + 1, "a pause never raises"
            filler.unlink()
            now[0] += parts.FIRST_RETRY_S
            write_until(lambda: begun)
            assert begun == ["take-part2.mcap"] and recorder.failure is None
            recorder.write(*MESSAGE, b"kept", time.monotonic_ns())
        assert topics(disk / "take-part2.mcap")["topic"] >= 1
        assert Recording(disk / "take-part2.mcap").info.metadata["place"] == {"room": "1"}
        with pytest.warns(UserWarning, match="cut off"):
            assert topics(disk / "take.mcap")["topic"] > 10
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs tmpfs")
def test_a_start_with_a_full_disk_fails_or_waits_for_space(tmp_path, monkeypatch) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "none", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a small disk can be mounted by root only")
    now = [0.0]
    monkeypatch.setattr(parts, "time", SimpleNamespace(monotonic=lambda: now[0]))
    filler = disk / "filler"
    try:
        with pytest.raises(OSError, match="No space left"), filler.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        path = disk / "take.mcap"
        with pytest.raises(ResourceError, match="No space left"):
            PartedRecorder(path)
        with PartedRecorder(path, waits_for_space=True) as recorder:
            assert "No space left" in str(recorder.failure)
            recorder.write(*MESSAGE, b"lost", 1)
            filler.unlink()
            recorder.write(*MESSAGE, b"lost, too", 2)
            assert recorder.lost == 2, "it does not ask the disk for each message"
            now[0] += parts.FIRST_RETRY_S
            recorder.write(*MESSAGE, b"kept", 3)
            assert recorder.failure is None and recorder.lost == 2
        assert topics(recorder.path)["topic"] == 1
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.slow
def test_an_edge_records_again_when_there_is_room_and_after_a_restart(tmp_path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not sys.platform.startswith("linux") or compiler is None:
        pytest.skip("the hook needs Linux and a C compiler")
    hook, full = tmp_path / "hook.so", tmp_path / "full"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", hook, SOURCE, "-ldl"], check=True)
    port, control = (str(port) for port in free_ports()[:2])
    at = ("--port", port, "--control-port", control, "--name", f"parts-{port}")
    source = ("--recording", str(CHAIR), "--loop", "--record", str(tmp_path / "take-{number}.mcap"))
    command = [sys.executable, "-m", "enliven", "edge", *source, *at]
    faults = {"LD_PRELOAD": str(hook), "FAULT_FULL": str(full), "FAULT_WRITE": "/take-"}
    first, second = tmp_path / "take-001.mcap", tmp_path / "take-001-part2.mcap"
    with (tmp_path / "log").open("w") as log:
        edge = subprocess.Popen(command, env={**os.environ, **faults}, stderr=log)
        try:
            wait_until(lambda: poses(first) > 5, "the take", 300.0)
            full.touch()
            wait_until(lambda: "continues in a new file" in (tmp_path / "log").read_text(), "the pause")
            full.unlink()
            wait_until(lambda: poses(second) > 5, "the second part")
        finally:
            edge.terminate()
            code = edge.wait(30)
    assert code == 0, (tmp_path / "log").read_text()
    assert topics(second)["character"] >= 1
    again = subprocess.run([*command, "--seconds", "0.2"], capture_output=True, text=True, timeout=120)
    assert again.returncode == 0 and topics(tmp_path / "take-002.mcap")["bodies"] > 0, again.stderr
