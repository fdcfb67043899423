"""Tests of recording a take: a failed write ends the take or leaves a gap, and never stops the show."""

import subprocess
import sys
import textwrap
import time
import uuid

import msgspec
import pytest

from enliven.frames import BodyFrame
from enliven.health import HealthKind, Severity
from enliven.recording import Recording, RecordingWarning
from enliven.wire.characters import CharacterMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.recording.disk_sync import DiskSync
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.tick import Tick
from enliven_edge.tracking.tracker import Tracker

STEP = 33_333_333


@pytest.fixture(scope="module")
def character():
    return create_actor("chair", nodes=16).character


def made(path) -> Outlet:
    return Outlet(WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), "x", record=path)


def tell(outlet, time_ns: int) -> None:
    """Records a frame without people, and the health state after it."""
    outlet.publish(Tick(BodyFrame([], time_ns, "x")))
    outlet.set_health([])


def test_a_character_is_written_again_every_minute_and_at_the_end(tmp_path, character):
    start = 1_700_000_000 * 10**9
    with made(tmp_path / "take.mcap") as outlet:
        outlet.introduce(character)
        for second in range(0, 150, 5):
            tell(outlet, start + second * 10**9)
    copies = list(Recording(tmp_path / "take.mcap").messages("character"))
    assert [(t - start) // 10**9 if t else 0 for t, _ in copies] == [0, 60, 120, 145]
    read = [msgspec.msgpack.decode(data, type=CharacterMessage) for _, data in copies]
    assert all(copy == read[0] for copy in read)


def test_negative_clock_leaves_gaps_in_the_take_and_is_reported(tmp_path):
    """A sensor's clock starts at -1 s. Frames before 0 are not written, later ones are."""

    class Clock(Sensor):
        name = "x"

        def __init__(self):
            self._frames = [BodyFrame([], i * STEP - 10**9, "x") for i in range(60)]

        def read(self, timeout=None):
            return self._frames.pop(0) if self._frames else None

    with made(tmp_path / "take.mcap") as outlet:
        edge = Edge(Clock(), Tracker(), Stage([]), outlet)
        edge.run()
        (state,) = [s for s in outlet.publisher.status.health if s.kind == HealthKind.TAKE_GAPS]
    assert edge.frames == 60
    # There are 31 frames of bodies, and the stage messages that are written with the first frame.
    assert state.what.startswith("32 messages are not in the take") and "clock" in state.remedy
    times = [time_ns for time_ns, _ in Recording(tmp_path / "take.mcap").messages("bodies")]
    assert times == [i * STEP - 10**9 for i in range(31, 60)]


FULL = """
    import resource, signal, sys, uuid
    from pathlib import Path
    import numpy as np
    from enliven.person.body import Body
    from enliven.frames import BodyFrame
    from enliven_edge.network.outlet import Outlet
    from enliven_edge.recording import parts
    from enliven_edge.sensors.base import Sensor
    from enliven_edge.service import Edge
    from enliven_edge.settings import WireSettings
    from enliven_edge.stage.stage import Stage
    from enliven_edge.tracking.tracker import Tracker

    parts.FIRST_RETRY_S = 1e6
    if sys.argv[2] != "as it is":
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))

    class Crowd(Sensor):
        name, random, number = "x", np.random.default_rng(0), 0

        def read(self, timeout=None):
            self.number += 1
            bodies = [Body(i, self.random.normal(size=(20, 3)), np.ones(20)) for i in range(6)]
            return BodyFrame(bodies, self.number * 33_333_333, "x") if self.number <= 900 else None

    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "x", record=Path(sys.argv[1])) as outlet:
        edge = Edge(Crowd(), Tracker(), Stage([]), outlet)
        edge.run()
        ails = [(s.kind, int(s.severity), s.what) for s in outlet.publisher.status.health]
    print(edge.frames, ails)
"""


def performed(path, limit: str) -> str:
    """Returns the final output of a process that records 900 frames of six bodies with a file size limit."""
    command = [sys.executable, "-c", textwrap.dedent(FULL), str(path), limit]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def read_back(path) -> list[int]:
    """Returns the times of the bodies in a finished take."""
    with pytest.warns(RecordingWarning, match="cut off"):
        return [time_ns for time_ns, _ in Recording(path).messages("bodies")]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
@pytest.mark.parametrize("limit", [20_000, 300_000])
def test_a_file_that_may_not_grow_ends_the_take_not_the_show(tmp_path, limit):
    output = performed(tmp_path / "take.mcap", str(limit))
    assert output.startswith("900 ") and HealthKind.TAKE_ENDED in output and "File too large" in output
    assert f", {int(Severity.WARNING)}, " in output
    times = read_back(tmp_path / "take.mcap")
    assert times == [i * STEP for i in range(1, len(times) + 1)]
    size = (tmp_path / "take.mcap").stat().st_size
    assert len(times) > 4 and size > 0.4 * limit, "chunks are small at first"


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs tmpfs")
def test_a_full_disk_ends_the_take_not_the_show(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a disk of 256 kB can be mounted by root only")
    try:
        output = performed(disk / "take.mcap", "as it is")
        assert output.startswith("900 ") and "No space left on device" in output
        times = read_back(disk / "take.mcap")
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    assert len(times) > 50 and times == [i * STEP for i in range(1, len(times) + 1)]


def test_data_is_synced_to_disk_regularly_and_at_the_end(tmp_path):
    with (tmp_path / "a").open("wb") as file:
        disk = DiskSync(file.fileno(), every=0.01)
        deadline = time.monotonic() + 60.0
        while disk.count < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
        file.close()
        before = disk.count
        disk.close()
        disk.close()
    assert before >= 3 and disk.count > before
    disk.check()
