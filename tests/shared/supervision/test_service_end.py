"""Tests of the causes that systemd reports when a service ends, and of kernel counters."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from enliven.supervision.causes import OUT_OF_MEMORY_CAUSE, count_memory_kills
from enliven.supervision.records import read_restarts
from enliven.supervision.service_end import cause_from_systemd, service_from_arguments


@pytest.mark.parametrize(
    ("result", "status", "cause"),
    [
        ("success", "0", ""),
        ("", "", ""),
        ("exit-code", "4", "exit code 4"),
        ("exit-code", "137", "signal SIGKILL"),
        ("signal", "SEGV", "signal SIGSEGV"),
        ("core-dump", "ABRT", "signal SIGABRT"),
        ("watchdog", "TERM", "no progress for too long"),
        ("oom-kill", "KILL", OUT_OF_MEMORY_CAUSE),
        ("a-new-word", "1", "a-new-word"),
    ],
)
def test_cause_of_systemd_is_a_sentence(result: str, status: str, cause: str) -> None:
    assert cause_from_systemd({"SERVICE_RESULT": result, "EXIT_STATUS": status}) == cause


@pytest.mark.parametrize(
    ("words", "name"),
    [(["edge", "edge"], "edge"), (["edge", "stairs"], "edge stairs"), (["window"], "window")],
)
def test_service_has_the_name_of_its_record(words: list[str], name: str) -> None:
    assert service_from_arguments(words) == name


def test_end_of_a_service_is_recorded(tmp_path: Path) -> None:
    variables = {
        **os.environ,
        "XDG_STATE_HOME": str(tmp_path),
        "SERVICE_RESULT": "signal",
        "EXIT_STATUS": "KILL",
    }
    words = [sys.executable, "-m", "enliven.supervision.service_end", "edge", "stairs"]
    subprocess.run(words, env=variables, check=True)
    records = [(each.name, each.cause) for each in read_restarts(tmp_path / "enliven")]
    assert records == [("edge stairs", "signal SIGKILL")]


def test_kills_for_lack_of_memory_are_counted(tmp_path: Path) -> None:
    (tmp_path / "vmstat").write_text("nr_free_pages 17\noom_kill 3\n")
    (tmp_path / "self").mkdir()
    (tmp_path / "self" / "cgroup").write_text("1:name=systemd:/\n0::/system.slice/a.service\n")
    group = tmp_path / "groups" / "system.slice" / "a.service"
    group.mkdir(parents=True)
    (group / "memory.events").write_text("low 0\noom 4\noom_kill 2\noom_group_kill 0\n")
    assert count_memory_kills(tmp_path, tmp_path / "groups") == 5
    assert count_memory_kills(tmp_path / "nowhere", tmp_path) == 0
