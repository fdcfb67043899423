"""Tests of records of supervised programs: written, read, damaged and limited."""

from __future__ import annotations

from pathlib import Path

import pytest

from enliven.supervision.records import (
    MAX_RESTARTS,
    RestartRecord,
    ServiceRecord,
    append_restart,
    read_restarts,
    read_services,
    runtime_folder,
    write_service,
)


def test_states_are_read_as_written(tmp_path: Path) -> None:
    edge = ServiceRecord("edge floor", 17, 1000.0, 1010.0, "30 frames/s", {"fps": 30.0})
    window = ServiceRecord("window", 18, 1001.0)
    for record in (window, edge):
        write_service(record, tmp_path)
    assert read_services(tmp_path) == [edge, window]


def test_a_name_never_leaves_the_folder(tmp_path: Path) -> None:
    write_service(ServiceRecord("../../escaped", 1, 0.0), tmp_path / "runtime")
    assert [path.parent.name for path in tmp_path.rglob("*.json")] == ["services"]


def test_damaged_states_are_left_out(tmp_path: Path) -> None:
    write_service(ServiceRecord("window", 18, 1001.0), tmp_path)
    (tmp_path / "services" / "cut.json").write_bytes(b'{"name": "ed')
    (tmp_path / "services" / "other.json").write_bytes(b"[1, 2]")
    assert [record.name for record in read_services(tmp_path)] == ["window"]


def test_restarts_are_kept_in_order_and_limited(tmp_path: Path) -> None:
    assert read_restarts(tmp_path) == []
    for number in range(3):
        append_restart(RestartRecord("edge", float(number), "it was silent for 10 s"), tmp_path)
    assert [record.at_s for record in read_restarts(tmp_path)] == [0.0, 1.0, 2.0]
    history = tmp_path / "restarts.jsonl"
    history.write_bytes(history.read_bytes() * MAX_RESTARTS + b'{"name": "cut o')
    append_restart(RestartRecord("edge", 9.0, "x" * 10_000), tmp_path)
    restarts = read_restarts(tmp_path)
    assert len(restarts) == MAX_RESTARTS
    assert restarts[-1].at_s == 9.0
    assert len(restarts[-1].cause) < 1000


def test_the_runtime_folder_is_for_its_owner_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ENLIVEN_RUNTIME", str(tmp_path / "run"))
    assert runtime_folder() == tmp_path / "run"
    assert (tmp_path / "run").stat().st_mode & 0o077 == 0
