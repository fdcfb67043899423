"""Tests of drivers in helper processes: after any failure, the edge gets frames again or ends in time."""

import time
from pathlib import Path

import numpy as np
import pytest
from contract import next_frame
from isolated_sensors import none_left, opener  # noqa: F401 (a fixture)
from patience import wait_until

from enliven.errors import ResourceError
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.isolation.slots import MIN_FREE_SLOTS, SLOTS, FrameSlots
from enliven_edge.sensors.reopening import open_reopening


def test_frames_come_whole_and_in_order(tmp_path, capfd):
    with opener(tmp_path)() as sensor:
        frames = [next_frame(sensor) for _ in range(40)]
        condition = None
        while condition is None:
            next_frame(sensor)
            condition = sensor.condition()
    numbers = [int(frame.depth[0, 0]) for frame in frames]
    assert numbers == sorted(set(numbers)) and numbers[0] == 1
    for frame in frames:
        number = int(frame.depth[0, 0])
        assert frame.sequence == number and (frame.colour == number % 256).all()
        assert frame.intrinsics.width == 64 and frame.sensor == "wild"
    assert condition.link == "USB 2" and condition.slow_link and condition.gravity == (0.0, 9.8, 0.1)
    assert "banner" not in capfd.readouterr().out


def test_frames_that_are_kept_do_not_change(tmp_path):
    """There are more frames than slots, and new ones keep arriving."""
    with opener(tmp_path, pace=0.001)() as sensor:
        kept = [next_frame(sensor) for _ in range(3 * SLOTS)]
        copies = [frame.depth.copy() for frame in kept]
        for _ in range(3 * SLOTS):
            next_frame(sensor)
    for frame, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(frame.depth, copy)
        with pytest.raises(ValueError, match="read-only"):
            frame.depth[0, 0] = 1


def test_a_pause_does_not_become_a_lag(tmp_path):
    """After the pause, three queued images are delivered, and then current ones."""
    with opener(tmp_path, pace=0.02)() as sensor:
        next_frame(sensor)
        time.sleep(0.8)
        late = [int(next_frame(sensor).depth[0, 0]) for _ in range(4)]
    assert late[3] - late[2] > 10 and late[2] - late[0] == 2


@pytest.mark.parametrize(
    ("mishap", "said"),
    [("crashes", "crashed"), ("exits", "ended"), ("hangs", "no image"), ("goes silent", "no image")],
)
def test_any_library_failure_is_continued_by_another_process(tmp_path, mishap, said):
    with open_reopening(opener(tmp_path, mishap=mishap)) as sensor:
        errors: list[Exception] = []
        frames = [next_frame(sensor, errors) for _ in range(20)]
    assert len(errors) == 1 and said in str(errors[0]) and isinstance(errors[0], SensorFault)
    assert len(list(tmp_path.glob("device-*"))) == 2
    times = [frame.time_ns for frame in frames]
    assert times == sorted(set(times)), "the clock goes on rising over processes"
    assert (tmp_path / "asked-for-any").exists() and (tmp_path / "asked-for-wild").exists()


def test_end_of_stream_is_passed_on(tmp_path):
    with opener(tmp_path, mishap="ends")() as sensor:
        frames = []
        while (frame := next_frame(sensor)) is not None:
            frames.append(frame)
        assert len(frames) == 4 and sensor.read(0.1) is None


def test_driver_that_does_not_close_is_killed(tmp_path):
    sensor = opener(tmp_path, mishap="does not close", after=1000)()
    next_frame(sensor)
    sensor.close()
    sensor.close()
    assert sensor.read(0.1) is None


def test_library_crash_during_opening_is_reported(tmp_path):
    with pytest.raises(ResourceError, match="crashed"):
        open_reopening(opener(tmp_path, mishap="crashes at open"))


def test_missing_device_is_reported(tmp_path):
    (tmp_path / "gone").touch()
    with pytest.raises(ResourceError, match=r"no device\. Plug it in"):
        open_reopening(opener(tmp_path))


def ended(pid: int) -> bool:
    """Returns True if a process has ended; zombies count as ended, since a container may have no init."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_the_helper_ends_with_an_edge_that_was_killed(tmp_path):
    """The pipe closes with the edge. The shared memory has no name, so nothing is left over."""
    import subprocess
    import sys

    code = (
        "import sys; sys.path.insert(0, sys.argv[2])\n"
        "from wild import Wild\n"
        "from enliven_edge.sensors.isolation.isolated import IsolatedOpener\n"
        "if __name__ == '__main__':\n"
        "    sensor = IsolatedOpener('wild', Wild, {'folder': sys.argv[1]})()\n"
        "    sensor.read()\n"
        "    print('up', flush=True)\n"
        "    while True: sensor.read()\n"
    )
    script = tmp_path / "edge.py"
    script.write_text(code)
    before = set(Path("/dev/shm").glob("psm_*")) if Path("/dev/shm").is_dir() else set()
    edge = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), str(Path(__file__).parents[1])], stdout=subprocess.PIPE
    )
    assert edge.stdout.readline() == b"up\n"
    (device,) = tmp_path.glob("device-*")
    helper = int(device.name.split("-")[1])
    edge.kill()
    edge.wait()
    wait_until(lambda: ended(helper), "the end of the helper")
    assert set(Path("/dev/shm").glob("psm_*")) <= before


def test_the_reader_copies_where_slots_run_short():
    slots = FrameSlots.make(2 * 6 * 4)
    slots.forget()
    depth = np.arange(24, dtype=np.uint16).reshape(4, 6)
    views = []
    for number in range(SLOTS + 3):
        slot = slots.write(depth + np.uint16(number), None)
        assert slot is not None, "the writer always finds one"
        views.append(slots.read(slot, (4, 6), None)[0])
    assert slots.free >= MIN_FREE_SLOTS - 1
    for number, view in enumerate(views):
        np.testing.assert_array_equal(view, depth + number)
    del view, views
    assert slots.free == SLOTS
