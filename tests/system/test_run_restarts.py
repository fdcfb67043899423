"""Tests that the window of ``enliven run`` survives a crash of its edge, which is restarted. Closing it ends
both.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from live_receivers import OscReceiver
from patience import wait_until

import enliven_edge.assets
from enliven import cli
from enliven.commands.processes import Process, run_together
from enliven.errors import InputError
from enliven.recording import Recorder, Recording
from enliven.supervision import child as child_module
from enliven.supervision import schedule

CHAIR = Path(enliven_edge.assets.__file__).with_name("chair.mcap")


def child(parent: int, command: str) -> int | None:
    """Returns the process id of the child that runs an enliven command, None if there is none."""
    for number in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        words = Path(f"/proc/{number}/cmdline").read_bytes().split(b"\0")
        if b"enliven" in words and command.encode() in words:
            return int(number)
    return None


@pytest.fixture
def receiver() -> Iterator[OscReceiver]:
    with OscReceiver() as server:
        yield server


@pytest.mark.slow
def test_the_window_outlives_a_killed_edge_whose_successor_sends_to_the_same_output(
    tmp_path: Path, screen: str, receiver: OscReceiver
) -> None:
    log = (tmp_path / "log").open("w")
    words = ["run", "--window", "--size", "160x120", "--recording", str(CHAIR), "--possess-at", "0.2"]
    words += ["--record", str(tmp_path / "take.mcap"), "--out", f"osc:127.0.0.1:{receiver.port}"]
    own = {**os.environ, "DISPLAY": screen, "LIBGL_ALWAYS_SOFTWARE": "1"}
    run = subprocess.Popen([sys.executable, "-m", "enliven", *words], env=own, stderr=log)
    try:
        view = wait_until(lambda: child(run.pid, "view"), "the window", 300.0)
        edge = child(run.pid, "edge")
        assert edge is not None
        wait_until(lambda: "/enliven/performer/1/height" in receiver.values, "the output of the edge", 120.0)
        os.kill(edge, signal.SIGKILL)
        wait_until(lambda: child(run.pid, "edge") not in (None, edge), "a new edge")
        next_take = tmp_path / "take-restart001.mcap"
        wait_until(lambda: next_take.exists() and next_take.stat().st_size > 1000, "its take", 120.0)
        receiver.values.clear()  # All packets of the first edge have been read.
        wait_until(
            lambda: "/enliven/performer/1/height" in receiver.values, "the output of the new edge", 120.0
        )
        assert child(run.pid, "view") == view and run.poll() is None
        log_text = (tmp_path / "log").read_text()
        assert "the edge has ended: signal SIGKILL. The program starts again at once." in log_text
        new = child(run.pid, "edge")
        os.kill(view, signal.SIGTERM)
        assert run.wait(30) == 130, "the window's own exit code: it was interrupted"
        assert not Path(f"/proc/{new}").exists(), "closing the window ends the edge"
    finally:
        run.terminate()
        run.wait(30)
        log.close()
    assert Recording(tmp_path / "take-restart001.mcap").info.topics["character"].count >= 1


def scripted(monkeypatch, **scripts: str) -> list[str]:
    """Replaces each ``enliven`` command by a Python script. Returns the list of started commands."""
    started: list[str] = []

    def start(command, *_arguments, **_options):
        started.append(command[-1])
        return subprocess.Popen([sys.executable, "-S", "-c", scripts[command[-1]]])

    monkeypatch.setattr(child_module, "start_child", start)
    return started


def test_failing_program_is_started_again_with_growing_waits(monkeypatch, caplog) -> None:
    monkeypatch.setattr(schedule, "_SECOND_WAIT_S", 0.05)
    scripts = {"first": "raise SystemExit(4)", "again": "raise SystemExit(4)"}
    started = scripted(monkeypatch, **scripts, window="import time; time.sleep(2)")
    edge = Process("edge", ["first"], restart_arguments=["again"])
    assert run_together([edge, Process("viewer", ["window"], leads=True)]) == 0
    assert started[0] == "first" and started.count("again") >= 3, "its first arguments only once"
    messages = [record.getMessage() for record in caplog.records]
    assert messages[0] == "the edge has ended: exit code 4. The program starts again at once."
    assert messages[1].endswith("in 0.05 s.") and messages[2].endswith("in 0.1 s.")


def test_crash_of_a_window_is_no_interruption(monkeypatch, caplog) -> None:
    scripted(monkeypatch, window="import os; os.kill(os.getpid(), 11)")
    assert run_together([Process("viewer", ["window"], leads=True)]) == 1
    assert "the viewer has ended: signal SIGSEGV" in caplog.text


@pytest.mark.parametrize("again", [None, ["edge"]])
def test_edge_that_is_killed_while_it_starts_is_named(monkeypatch, caplog, again) -> None:
    started = scripted(monkeypatch, edge="import os; os.kill(os.getpid(), 9)", window="")
    edge = Process("edge", ["edge"], restart_arguments=again, ready=lambda: False)
    assert run_together([edge, Process("viewer", ["window"], leads=True)]) == 1
    assert "the edge has ended: signal SIGKILL." in caplog.text
    assert started == ["edge"], "the window waits for the edge"


@pytest.mark.parametrize("overwrite", [False, True])
def test_run_passes_the_permission_to_overwrite_a_take_to_its_edge(tmp_path, monkeypatch, overwrite) -> None:
    started: list[Process] = []
    monkeypatch.setattr("enliven.commands.run.run_together", lambda processes: started.extend(processes) or 0)
    words = ["run", "--film", "--out", str(tmp_path), "--record", str(tmp_path / "take.mcap")]
    assert cli.run([*words, *(["--overwrite"] if overwrite else [])]) == 0
    edge = next(process for process in started if process.name == "edge")
    assert ("--overwrite" in edge.arguments) is overwrite


def test_refusal_to_overwrite_names_an_option_that_the_command_has(tmp_path, capsys) -> None:
    take = tmp_path / "take.mcap"
    take.write_bytes(b"precious")
    with pytest.raises(InputError, match="--overwrite"):
        Recorder(take)
    assert take.read_bytes() == b"precious"
    for command in ("run", "edge", "record", "replay", "track", "import", "synthesize"):
        assert cli.run([command, "--help"]) == 0
        assert "--overwrite" in capsys.readouterr().out, command
