"""Tests of the supervisor with real processes: exits, freezes, back-off, records, and its own end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from patience import wait_until

from enliven.supervision import supervisor as supervisor_module
from enliven.supervision.child import Program
from enliven.supervision.records import read_restarts, read_services
from enliven.supervision.schedule import RestartBackoff
from enliven.supervision.supervisor import RecordFolders, Supervisor

REPORTS = """
import os, signal, socket, sys, time
def report(text):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as endpoint:
        endpoint.sendto(text.encode(), os.environ["NOTIFY_SOCKET"])
def note(path):
    with open(path, "a") as file:
        file.write(f"{os.getpid()}\\n")
"""
"""Beginning of each scripted program. It implements the protocol literally, to test the bytes."""
SHORT_S = 0.3
"""Time without progress after which a scripted program counts as frozen, seconds."""


def script(text: str) -> list[str]:
    return [sys.executable, "-S", "-c", REPORTS + text]


def fast_backoff() -> RestartBackoff:
    return RestartBackoff(max_wait_s=0.05)


@contextmanager
def supervised(folder: Path, *programs: Program) -> Iterator[Supervisor]:
    """Runs a supervisor in a thread and stops it afterwards."""
    supervisor = Supervisor(programs, RecordFolders(folder / "run", folder / "history"), backoff=fast_backoff)
    thread = threading.Thread(target=supervisor.run)
    thread.start()
    try:
        yield supervisor
    finally:
        supervisor.stop()
        thread.join(30)
    assert not thread.is_alive()


def starts(path: Path) -> list[int]:
    """Returns the process ids that a scripted program wrote at its starts."""
    return [int(line) for line in path.read_text().splitlines()] if path.exists() else []


def causes(folder: Path) -> list[str]:
    return [record.cause for record in read_restarts(folder / "history")]


def is_running(pid: int) -> bool:
    """Returns True if a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize(
    ("end", "cause"),
    [
        ("sys.exit(7)", "exit code 7"),
        ("pass", "exit code 0"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "signal SIGSEGV"),
    ],
)
def test_ended_program_is_started_again_and_the_cause_is_recorded(tmp_path, end, cause) -> None:
    log = tmp_path / "starts"
    with supervised(tmp_path, Program("edge", script(f"note({str(log)!r}); {end}"))):
        wait_until(lambda: len(starts(log)) >= 3, "three starts")
        wait_until(lambda: len(causes(tmp_path)) >= 2, "two causes")
    assert set(causes(tmp_path)) == {cause}
    assert len(set(starts(log))) == len(starts(log))


@pytest.mark.parametrize("ignores", ["", "signal.signal(signal.SIGTERM, signal.SIG_IGN);"])
def test_program_without_progress_is_restarted_even_if_it_ignores_the_signal(
    tmp_path, monkeypatch, ignores
) -> None:
    monkeypatch.setattr("enliven.supervision.child.FROZEN_GRACE_S", 0.2)
    monkeypatch.setattr("enliven.supervision.supervisor.TERMINATION_GRACE_S", 0.2)
    log = tmp_path / "starts"
    freezes = f"{ignores}note({str(log)!r}); report('READY=1'); time.sleep(600)"
    with supervised(tmp_path, Program("window", script(freezes), frozen_after_s=SHORT_S)):
        wait_until(lambda: len(starts(log)) >= 2, "a second start")
        first = starts(log)[0]
        assert not is_running(first)
    assert causes(tmp_path)[0] == "no progress for 0.3 s"


def test_stopped_process_is_killed_and_restarted(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("enliven.supervision.child.FROZEN_GRACE_S", 0.2)
    log = tmp_path / "starts"
    lively = f"report('READY=1'); note({str(log)!r})\nwhile True: report('WATCHDOG=1'); time.sleep(0.05)"
    with supervised(tmp_path, Program("edge", script(lively), frozen_after_s=SHORT_S)):
        wait_until(lambda: starts(log), "a start")
        os.kill(starts(log)[0], signal.SIGSTOP)
        wait_until(lambda: len(starts(log)) >= 2, "a second start")


def test_program_with_progress_is_left_alone(tmp_path) -> None:
    log = tmp_path / "starts"
    lively = f"note({str(log)!r}); report('READY=1\\nSTATUS=30 frames/s')\n"
    lively += "for number in range(30): report('WATCHDOG=1'); time.sleep(0.05)\n"
    lively += f"note({str(tmp_path / 'done')!r}); time.sleep(600)"
    with supervised(tmp_path, Program("edge", script(lively), frozen_after_s=1.0)):
        wait_until(lambda: starts(tmp_path / "done"), "1.5 s of progress")
        assert len(starts(log)) == 1
    assert causes(tmp_path) == []


def test_progress_before_ready_does_not_count(tmp_path) -> None:
    log = tmp_path / "starts"
    never_ready = f"note({str(log)!r})\nwhile True: report('WATCHDOG=1'); time.sleep(0.05)"
    program = Program("edge", script(never_ready), frozen_after_s=SHORT_S, start_timeout_s=0.5)
    with supervised(tmp_path, program):
        wait_until(lambda: len(starts(log)) >= 2, "a second start")
    assert causes(tmp_path)[0].startswith("not ready after 0")


def test_start_is_extended_on_request(tmp_path) -> None:
    log = tmp_path / "starts"
    slow = f"note({str(log)!r}); report('EXTEND_TIMEOUT_USEC=60000000'); time.sleep(1.0)\n"
    slow += f"report('READY=1'); note({str(tmp_path / 'ready')!r}); time.sleep(600)"
    program = Program("edge", script(slow), frozen_after_s=60.0, start_timeout_s=0.5)
    with supervised(tmp_path, program):
        wait_until(lambda: starts(tmp_path / "ready"), "a ready program")
        assert len(starts(log)) == 1


def test_states_are_recorded(tmp_path) -> None:
    busy = "report('READY=1\\nSTATUS=30 frames/s'); time.sleep(600)"
    with supervised(tmp_path, Program("edge floor", script(busy), frozen_after_s=60.0)):
        wait_until(lambda: any(s.progress_s for s in read_services(tmp_path / "run")), "progress")
        record = read_services(tmp_path / "run")[0]
        assert is_running(record.pid)
    assert (record.name, record.status) == ("edge floor", "30 frames/s")
    assert record.started_s <= record.progress_s <= record.started_s + 60.0
    assert 1.0 < record.figures["rss_mb"] < 1000.0


def test_first_progress_is_recorded_at_once(tmp_path, monkeypatch) -> None:
    # The next periodic record would be written a day later.
    monkeypatch.setattr(supervisor_module, "_RECORD_INTERVAL_S", 86400.0)
    busy = "time.sleep(0.2); report('READY=1'); time.sleep(600)"
    with supervised(tmp_path, Program("edge", script(busy), frozen_after_s=60.0)):
        wait_until(lambda: any(s.progress_s for s in read_services(tmp_path / "run")), "the first progress")


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="needs Linux")
def test_end_of_a_program_is_noticed_without_waiting_for_the_next_check(tmp_path, monkeypatch) -> None:
    """This includes the end of the restarted program. The interval between two checks is longer than this
    test's timeout.
    """
    monkeypatch.setattr(supervisor_module, "POLL_INTERVAL_S", 3600.0)
    ended = Program("edge", script("sys.exit(3)"), restart="failure")
    backoff = RestartBackoff(max_wait_s=0.0)
    supervisor = Supervisor(
        [ended], RecordFolders(tmp_path / "run", tmp_path / "history"), backoff=lambda: backoff
    )
    thread = threading.Thread(target=supervisor.run, daemon=True)
    thread.start()
    wait_until(lambda: len(causes(tmp_path)) >= 2)
    supervisor.stop()
    thread.join(60)
    assert not thread.is_alive(), "the next end wakes the supervisor, which then stops"


def test_state_that_a_program_writes_itself_is_kept(tmp_path) -> None:
    own = f"""
import os, sys, time
sys.path[:0] = {sys.path!r}
from pathlib import Path
from enliven.supervision.records import ServiceRecord, write_service
for number in range(10**9):
    record = ServiceRecord("edge", os.getpid(), 1.0, float(number), "own")
    write_service(record, Path({str(tmp_path / "run")!r}))
    time.sleep(0.3)
"""
    with supervised(tmp_path, Program("edge", script(own))):
        wait_until(
            lambda: any(s.progress_s > 15 for s in read_services(tmp_path / "run")), "4.5 s of own states"
        )
        statuses = {read_services(tmp_path / "run")[0].status for _ in range(1)}
    assert statuses == {"own"}


def test_program_is_not_watched_if_its_socket_cannot_be_made(tmp_path, monkeypatch, caplog) -> None:
    long_folder = tmp_path / ("a" * 120)
    long_folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(long_folder))
    log = tmp_path / "starts"
    ends = f"note({str(log)!r}); time.sleep(0.6)"
    program = Program("edge", script(ends), frozen_after_s=SHORT_S, start_timeout_s=SHORT_S)
    with supervised(tmp_path, program):
        wait_until(lambda: causes(tmp_path), "its end")
    assert causes(tmp_path)[0] == "exit code 0"
    assert "frozen programs cannot be detected" in caplog.text


def test_missing_program_is_tried_again_and_named(tmp_path) -> None:
    with supervised(tmp_path, Program("window", [str(tmp_path / "nowhere")])):
        wait_until(lambda: len(causes(tmp_path)) >= 3, "three tries")
    assert causes(tmp_path)[0] == "the program cannot be started (No such file or directory)"


def test_full_disk_does_not_end_the_supervision(tmp_path, caplog) -> None:
    log = tmp_path / "starts"
    (tmp_path / "history").write_text("a file where the folder should be")
    with supervised(tmp_path, Program("edge", script(f"note({str(log)!r})"))):
        wait_until(lambda: len(starts(log)) >= 5, "five starts")
    unwritable = [record for record in caplog.records if "cannot be recorded" in record.getMessage()]
    assert len(unwritable) == 1, "logged once, not for each restart"


def test_programs_end_with_the_run(tmp_path) -> None:
    log = tmp_path / "starts"
    ends = "signal.signal(signal.SIGTERM, lambda *_: (note({0!r}), sys.exit(0)))\n"
    ends = ends.format(str(tmp_path / "cleanly")) + f"note({str(log)!r})\nwhile True: time.sleep(0.01)"
    with supervised(tmp_path, Program("one", script(ends)), Program("two", script(ends))):
        wait_until(lambda: len(starts(log)) == 2, "two programs")
    assert sorted(starts(tmp_path / "cleanly")) == sorted(starts(log))
    assert causes(tmp_path) == []


def test_exit_codes_of_programs_that_the_supervisor_ends(tmp_path, monkeypatch) -> None:
    """One program exits with its own code on the signal, one is terminated by it, and one has to be
    killed.
    """
    monkeypatch.setattr(supervisor_module, "TERMINATION_GRACE_S", 2.0)
    log = tmp_path / "starts"
    forms = {
        "edge": "signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))",
        "window": "pass",
        "page": "signal.signal(signal.SIGTERM, signal.SIG_IGN)",
    }
    programs = [
        Program(name, script(f"{form}; note({str(log)!r}); time.sleep(600)")) for name, form in forms.items()
    ]
    with supervised(tmp_path, *programs) as supervisor:
        wait_until(lambda: len(starts(log)) == 3, "three starts")
    assert supervisor.exit_codes == {"edge": 130, "window": -signal.SIGTERM, "page": -signal.SIGKILL}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_children_end_with_a_supervisor_that_is_ended_or_killed(tmp_path, number) -> None:
    log = tmp_path / "starts"
    frozen = (
        "import signal, sys, time\nfrom enliven.supervision.lifetime import end_with_parent as end\nend()\n"
    )
    frozen += f"open({str(log)!r}, 'w').write(str(__import__('os').getpid()))\n"
    frozen += "time.sleep(600)"
    own = f"""
from enliven.supervision import supervisor as supervisor_module
from enliven.supervision.child import Program
from enliven.supervision.supervisor import Supervisor
raise SystemExit(Supervisor([Program("edge", [{sys.executable!r}, "-c", {frozen!r}])]).run())
"""
    run = subprocess.Popen([sys.executable, "-c", own])
    try:
        wait_until(lambda: starts(log), "a child")
        run.send_signal(number)
        assert run.wait(30) == (-9 if number == signal.SIGKILL else 130)
        wait_until(lambda: not is_running(starts(log)[0]), "the end of the child")
    finally:
        run.kill()
        run.wait()


def test_flood_of_reports_delays_no_other_program(tmp_path) -> None:
    log = tmp_path / "starts"
    flood = "while True: report('WATCHDOG=1')"
    with supervised(
        tmp_path,
        Program("flood", script(flood), frozen_after_s=60.0),
        Program("edge", script(f"note({str(log)!r})")),
    ):
        wait_until(lambda: len(starts(log)) >= 4, "four starts")


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.0, 59.0), min_size=1, max_size=30))
def test_waits_double_without_end_while_a_program_fails(runs_s) -> None:
    backoff = RestartBackoff()
    waits = [backoff.wait_after(run_s) for run_s in runs_s]
    assert waits == [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, *[30.0] * 30][: len(waits)]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.0, 59.0), max_size=10), st.floats(60.0, 1e7))
def test_stable_run_makes_the_next_restart_immediate(runs_s, stable_s) -> None:
    backoff = RestartBackoff()
    for run_s in runs_s:
        backoff.wait_after(run_s)
    assert [backoff.wait_after(stable_s), backoff.wait_after(0.0)] == [0.0, 1.0]
