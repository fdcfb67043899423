"""Tests of takes that run for weeks: splitting by duration and size, and keeping disk space free."""

import os
import time
import uuid
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest
import typer
from patience import wait_until
from typer.testing import CliRunner

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.health import HealthKind
from enliven.recording import Recorder, Recording
from enliven.wire import CharacterMessage, StageMessage
from enliven_edge.commands.record import record
from enliven_edge.network.outlet import Outlet
from enliven_edge.recording import parts
from enliven_edge.recording.disk_space import DiskSpaceGuard, list_recorded_parts, name_expression
from enliven_edge.recording.parts import PartedRecorder
from enliven_edge.recording.settings import RecordingSettings
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.tick import Tick

MESSAGE = ("topic", "kind", "", "", "bytes")
OLD_S = 3600.0


@pytest.fixture
def clock(monkeypatch):
    """A monotonic clock that tests set. File names still use the real wall clock."""
    now = [0.0]
    fake = SimpleNamespace(monotonic=lambda: now[0], strftime=time.strftime)
    monkeypatch.setattr(parts, "time", fake)
    return now


def topics(path: Path) -> dict[str, int]:
    return {name: topic.count for name, topic in Recording(path).info.topics.items()}


@pytest.mark.parametrize("pattern", ["take-{number}.mcap", "take-{time}.mcap", "take.mcap"])
def test_recording_is_split_by_duration_without_losing_messages(tmp_path, clock, pattern) -> None:
    begun, settings = [], RecordingSettings(part_minutes=10.0)
    with PartedRecorder(tmp_path / pattern, settings=settings) as recorder:
        recorder.on_part_started = begun.append
        recorder.add_metadata("place", {"room": "1"})
        for second in range(1500):
            clock[0] = float(second)
            recorder.write(*MESSAGE, b"x", second * 10**9)
        assert recorder.lost == 0 and recorder.failure is None
    assert begun == [False, False] and len(recorder.paths) == 3
    assert [topics(path)["topic"] for path in recorder.paths] == [600, 600, 300]
    assert all(Recording(path).info.metadata["place"] == {"room": "1"} for path in recorder.paths)
    expected = {
        "take-{number}.mcap": ["take-001.mcap", "take-002.mcap", "take-003.mcap"],
        "take.mcap": ["take.mcap", "take-part2.mcap", "take-part3.mcap"],
    }
    if pattern in expected:
        assert [path.name for path in recorder.paths] == expected[pattern]
    assert all(name_expression(tmp_path / pattern).fullmatch(path.name) for path in recorder.paths)


def test_recording_is_split_by_size(tmp_path, clock) -> None:
    with PartedRecorder(tmp_path / "take.mcap", settings=RecordingSettings(part_mb=0.2)) as recorder:
        for second in range(60):
            clock[0] = float(second)
            recorder.write(*MESSAGE, os.urandom(20_000), second * 10**9)
    assert len(recorder.paths) > 3
    assert all(path.stat().st_size < 500_000 for path in recorder.paths)
    assert sum(topics(path)["topic"] for path in recorder.paths) == 60


def test_part_that_cannot_be_started_is_continued(tmp_path, clock, monkeypatch) -> None:
    with PartedRecorder(tmp_path / "take.mcap", settings=RecordingSettings(part_minutes=1.0)) as recorder:
        recorder.write(*MESSAGE, b"x", 0)
        monkeypatch.setattr(parts, "MIN_FREE_BYTES", 1 << 62)
        clock[0] = 61.0
        recorder.write(*MESSAGE, b"x", 1)
        assert recorder.lost == 0 and len(recorder.paths) == 1
    assert topics(tmp_path / "take.mcap")["topic"] == 2


def test_every_part_of_a_take_begins_with_the_stage_and_its_characters(tmp_path, clock) -> None:
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    settings = RecordingSettings(part_minutes=1.0)
    with Outlet(wire, "x", record=tmp_path / "take-{number}.mcap", recording=settings) as outlet:
        outlet.introduce(create_actor("chair", nodes=16).character)
        for second in range(100):
            clock[0] = float(second)
            outlet.publish(Tick(BodyFrame([], second * 10**9, "x")))
        outlet.set_health([])
        kinds = {state.kind for state in outlet.publisher.status.health}
        assert not kinds & {HealthKind.TAKE_RESUMED, HealthKind.TAKE_ENDED}, "a planned part is no event"
    second_part = Recording(tmp_path / "take-002.mcap")
    begin, stage = next(iter(second_part.messages("stage")))
    assert msgspec.msgpack.decode(stage, type=StageMessage).characters[0].character == "chair"
    _, character = next(iter(second_part.messages("character")))
    assert msgspec.msgpack.decode(character, type=CharacterMessage).id == "chair"
    assert begin <= next(iter(second_part.messages("bodies")))[0]


def recorded(path: Path, age_s: float, size: int = 1000) -> Path:
    """Writes a recording that was last changed some time ago."""
    with Recorder(path) as recorder:
        recorder.write(*MESSAGE, os.urandom(size), 0)
    os.utime(path, (time.time() - age_s,) * 2)
    return path


def test_only_own_recordings_of_the_pattern_count_as_parts(tmp_path) -> None:
    own = [
        recorded(tmp_path / name, age * OLD_S)
        for age, name in (
            (4, "take-20261128-094500.mcap"),
            (3, "take-20261128-094500-2.mcap"),
            (2, "take-20261128-094500-part2.mcap"),
        )
    ]
    recorded(tmp_path / "take-best.mcap", OLD_S)
    recorded(tmp_path / "other-20261128-094500.mcap", OLD_S)
    (tmp_path / "take-20261128-094501.mcap").write_bytes(b"of another program")
    (tmp_path / "take-20261128-094502.mcap").write_bytes(
        own[0].read_bytes().replace(b"enliven ", b"foreign ")
    )
    (tmp_path / "take-20261128-094503.mcap").symlink_to(own[0])
    (tmp_path / "take-20261128-094504.mcap").mkdir()
    (tmp_path / "take-20261128-094505.mcap").write_bytes(b"")
    assert list_recorded_parts(tmp_path / "take-{time}.mcap") == own
    assert list_recorded_parts(tmp_path / "none" / "take-{time}.mcap") == []


def test_oldest_parts_are_deleted_until_there_is_room(tmp_path) -> None:
    pattern = tmp_path / "take-{number}.mcap"
    files = [recorded(tmp_path / f"take-{n:03}.mcap", (9 - n) * OLD_S) for n in range(1, 6)]
    fresh = recorded(tmp_path / "take-006.mcap", 0.0)
    (tmp_path / "diary.txt").write_text("of the user")

    others = [0]  # Bytes of other programs on the same disk.

    def free_bytes(folder: Path) -> int:
        return 100 * (10 - sum(path.exists() for path in files)) - others[0]

    guard = DiskSpaceGuard(pattern, 700.0, free_bytes)
    assert [path.exists() for path in files] == [False, False, True, True, True] and not guard.is_short
    others[0] = 1300
    guard.in_use = frozenset(files[4:])
    guard.check()
    assert [path.exists() for path in files] == [False] * 4 + [True]
    assert guard.is_short, "what is being written is never deleted, nor what another edge may write"
    assert fresh.exists() and (tmp_path / "diary.txt").exists()
    guard.close()


def test_take_pauses_on_a_nearly_full_disk_and_resumes(tmp_path, clock, monkeypatch) -> None:
    free = [10.0]
    monkeypatch.setattr("enliven_edge.recording.disk_space.CHECK_INTERVAL_S", 0.01)
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=int(free[0] * 1e9)))
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    settings = RecordingSettings(keep_free=2.0)
    with Outlet(wire, "x", record=tmp_path / "take.mcap", recording=settings) as outlet:

        def kinds() -> set[str]:
            clock[0] += 0.1
            outlet.publish(Tick(BodyFrame([], int(clock[0] * 1e9), "x")))
            outlet.set_health([])
            return {state.kind for state in outlet.publisher.status.health}

        assert not kinds() & {HealthKind.TAKE_ENDED, HealthKind.TAKE_RESUMED}
        free[0] = 1.5
        wait_until(lambda: HealthKind.TAKE_ENDED in kinds(), "the pause")
        (state,) = [s for s in outlet.publisher.status.health if s.kind == HealthKind.TAKE_ENDED]
        assert "less than 2 GB are free" in state.what
        free[0] = 3.0
        wait_until(lambda: HealthKind.TAKE_RESUMED in kinds(), "the next part")
        assert HealthKind.TAKE_ENDED not in kinds()
    assert topics(tmp_path / "take-part2.mcap")["bodies"] >= 1


def test_record_command_continues_in_new_files(tmp_path) -> None:
    """With parts of 0.6 s, 3 s of a synthetic camera fill several files, each of which is readable alone."""
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(record)
    words = "--sensor synthetic --set width=80 --seconds 3 --part-minutes 0.01 --keep-free 0 -o"
    result = CliRunner().invoke(app, [*words.split(), str(tmp_path / "long.mcap")])
    assert result.exit_code == 0, result.output
    parts = [Recording(path) for path in tmp_path.glob("long*.mcap")]
    assert len(parts) > 1 and all(list(part.frames()) for part in parts)


def test_record_command_refuses_a_negative_part(tmp_path) -> None:
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(record)
    result = CliRunner().invoke(app, ["--part-minutes", "-1", "-o", str(tmp_path / "long.mcap")])
    assert isinstance(result.exception, InputError) and "part_minutes is -1.0" in str(result.exception)
