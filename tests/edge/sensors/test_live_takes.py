"""Tests that a recorded live sensor is replayed identically: frames, device conditions, health and losses."""

import importlib.util
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from contract import next_frame
from hypothesis import given, settings
from hypothesis import strategies as st
from isolated_sensors import none_left, opener  # noqa: F401 (a fixture)
from troubled import STEP, camera, picture

from enliven import cli
from enliven.errors import EnlivenError, InputError
from enliven.frames import DepthFrame
from enliven.health import HealthKind
from enliven.recording import Recorder, Recording
from enliven_edge.commands.record import record_stream
from enliven_edge.sensors.base import Condition, Sensor, SensorFault
from enliven_edge.sensors.drivers.oak import OakSensor
from enliven_edge.sensors.drivers.realsense import RealSenseSensor
from enliven_edge.sensors.event_log import CONDITION_TOPIC, EVENTS_TOPIC, EventLog
from enliven_edge.sensors.replay import ReplaySensor
from enliven_edge.tracking.health.health import HealthMonitor

LIBRARIES = {"oak": "depthai", "realsense": "pyrealsense2"}
finite = st.floats(-200, 200)
conditions = st.builds(
    Condition,
    link=st.sampled_from(["", "USB 2", "USB 3", "PoE"]),
    slow_link=st.booleans(),
    temperature=st.none() | finite,
    hot=st.none() | st.just(90.0),
    gravity=st.none() | st.tuples(finite, finite, finite),
    calibrated=st.booleans(),
)


@dataclass(frozen=True)
class Step:
    """One read of the scripted sensor: a frame (after some lost ones), or an error."""

    lost_before: int = 0
    condition: Condition | None = None
    error: str = ""
    grey: bool = False


steps = st.lists(
    st.one_of(
        st.builds(Step, lost_before=st.sampled_from([0, 0, 0, 1, 7]), condition=st.none() | conditions),
        st.builds(Step, error=st.sampled_from(["lost", "bad frame"])),
    ),
    min_size=1,
    max_size=12,
)


SLOPE = 5
"""Grey value difference between neighbouring pixels."""


def shades(number: int) -> np.ndarray:
    """Returns (24, 32, 3) uint8 colour gradients that depend on a number."""
    across, down = np.meshgrid(np.arange(32), np.arange(24))
    return np.stack([SLOPE * across, SLOPE * down, np.full_like(down, number % 250)], -1).astype(np.uint8)


class Scripted(Sensor):
    """A sensor that does one step per read. A device condition holds until a step with another one."""

    name, fps = "scripted", 30.0

    def __init__(self, script: list[Step], coloured: bool = False) -> None:
        self._script, self._coloured = iter(script), coloured
        self._number = self._read = 0
        self._condition: Condition | None = None

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        step = next(self._script, None)
        if step is None:
            return None
        self._read += 1
        if step.error == "lost":
            raise SensorFault(f"the cable is out ({self._read})", where=self.name, remedy="Plug it in.")
        if step.error:
            raise InputError("half an image", where=self.name)
        self._condition = step.condition or self._condition
        self._number += 1 + step.lost_before
        depth = picture(self._number, 32, 24)
        depth[10:14, 10:20] = 0
        colour = shades(self._number) if self._coloured and not step.grey else None
        lens = camera(32, 24, 30.0)
        return DepthFrame(depth, lens, self._number * STEP, self.name, colour, sequence=self._number)

    def condition(self) -> Condition | None:
        return self._condition


def lived(sensor) -> list[tuple]:
    """Returns all output of a sensor, with the states of an edge's health monitor."""
    health, events = HealthMonitor(fps=30.0), []
    while True:
        try:
            frame = sensor.read(1.0)
        except (SensorFault, InputError) as error:
            health.record_read_error(error)
            events.append((type(error), error.what, error.where, error.remedy, health.states))
            continue
        if frame is None:
            return events
        health.admit(frame)
        condition = sensor.condition()
        health.check_device(condition, np.eye(4), floor_known=True)
        image = (
            frame.depth.tobytes(),
            frame.intrinsics,
            None if frame.colour is None else frame.colour.tobytes(),
        )
        events.append((frame.time_ns, frame.sequence, frame.sensor, image, condition, health.states))


def recorded(path: Path, sensor) -> ReplaySensor:
    with Recorder(path, overwrite=True) as recorder:
        for _ in record_stream(sensor, recorder, threading.Event()):
            pass
    return ReplaySensor(path, speed=0.0)


@given(script=steps.filter(lambda each: any(not step.error for step in each)), coloured=st.booleans())
@settings(deadline=None, max_examples=40)
def test_whatever_a_sensor_goes_through_its_recording_goes_through(tmp_path_factory, script, coloured):
    path = tmp_path_factory.getbasetemp() / "lived.mcap"
    with recorded(path, Scripted(script, coloured)) as replayed:
        assert replayed.name == "scripted"
        assert lived(replayed) == lived(Scripted(script, coloured))
    # A reader that does not know the two topics reads the frames alone.
    frames = [frame for frame in Recording(path).frames() if isinstance(frame, DepthFrame)]
    assert len(frames) == sum(not step.error for step in script)


def test_replayed_loss_is_reported_at_the_same_frames_and_loops(tmp_path):
    hot = Condition("USB 2", True, 95.0, 90.0)
    script = [Step(condition=hot), *[Step()] * 20, Step(error="lost"), *[Step()] * 160]
    with recorded(tmp_path / "a.mcap", Scripted(script)) as replayed:
        states = [{state.kind for state in each[-1]} for each in lived(replayed)]
    assert [HealthKind.SENSOR_LOST in each for each in states].index(True) == 21
    assert HealthKind.SLOW_LINK in states[0] and HealthKind.HOT in states[-1]
    with ReplaySensor(tmp_path / "a.mcap", speed=0.0, loop=True) as looped:
        events = [next_said(looped) for _ in range(2 * len(script))]
    assert [type(each) for each in events].count(SensorFault) == 2
    times = [each.time_ns for each in events if isinstance(each, DepthFrame)]
    assert times == sorted(set(times)) and len(times) == 2 * (len(script) - 1)


def next_said(sensor):
    try:
        return sensor.read()
    except EnlivenError as error:
        return error


def test_the_topics_are_open_to_other_programs_and_say_when_it_was_back(tmp_path):
    script = [Step(condition=Condition("PoE")), Step(error="lost"), Step(), Step()]
    recorded(tmp_path / "a.mcap", Scripted(script)).close()
    recording = Recording(tmp_path / "a.mcap")
    assert recording.info.topics[EVENTS_TOPIC].message_encoding == "json"
    events = [(time_ns // STEP, data) for time_ns, data in recording.messages(EVENTS_TOPIC)]
    assert [number for number, _ in events] == [1, 2]
    assert b'"kind":"lost"' in events[0][1] and b'"kind":"back"' in events[1][1]
    assert [time_ns // STEP for time_ns, _ in recording.messages(CONDITION_TOPIC)] == [1], "once, as it stays"


def test_inspect_reports_gaps_temperature_and_losses(tmp_path, capsys):
    hot = Condition("USB 2", True, 93.4, 105.0)
    script = [Step(condition=Condition("USB 3", temperature=41.2, hot=105.0)), Step(2), Step(7, hot)]
    script += [Step(error="lost"), Step(error="lost"), Step(30), Step(error="bad frame"), Step()]
    recorded(tmp_path / "a.mcap", Scripted(script)).close()
    assert cli.run(["inspect", str(tmp_path / "a.mcap")]) == 0
    lines = [line.strip().split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    facts = {name: value.strip() for name, value in lines if name != "at"}
    assert facts["frames"] == "5 in 1.4 s of scripted" and facts["link"] == "USB 3, USB 2"
    assert facts["missing"] == "9 images in 2 gaps; the longest gap is 7 images at 0.37 s", (
        "not what passed while it was lost"
    )
    assert facts["temperature"] == "41 to 93 degrees; the sensor switches off at 105"
    assert (
        facts["lost"] == "1 times, for 1.0 s in total" and facts["unusable"] == "1 frames, which were skipped"
    )
    assert ["at", "0.37 s: the cable is out (4)"] in lines
    film = tmp_path / "a.mp4"
    assert cli.run(["inspect", str(tmp_path / "a.mcap"), "-o", str(film)]) == 0
    assert film.stat().st_size > 1000 and "9 images in 2 gaps" in capsys.readouterr().out


def test_damaged_sensor_reports_never_cost_a_frame(tmp_path):
    """Messages next to the frames are damaged, and the device reports NaN."""
    frame = Scripted([Step()]).read()
    with Recorder(tmp_path / "a.mcap") as recorder:
        EventLog(recorder).write_frame(
            frame, Condition(temperature=float("nan"), gravity=(float("nan"), 0.0, 0.0))
        )
        for topic in (CONDITION_TOPIC, EVENTS_TOPIC):
            recorder.write(topic, "x", "", "", "json", b'{"kind": 7, "link": [', frame.time_ns, "scripted")
        recorder.write_frame(replace(frame, time_ns=frame.time_ns + STEP))
    with ReplaySensor(tmp_path / "a.mcap", speed=0.0) as replayed:
        assert [replayed.read() is not None for _ in range(3)] == [True, True, False]


def test_an_older_recording_says_nothing_of_its_device(tmp_path):
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.write_frame(DepthFrame(picture(0), camera(), 0, "old"))
    with ReplaySensor(tmp_path / "a.mcap", speed=0.0) as replayed:
        assert replayed.read().sequence is None and replayed.condition() is None


def test_every_frame_waits_for_a_slow_reader(tmp_path):
    """There are more frames than fit in memory. The driver then waits, and no frame is lost or replaced."""
    with opener(tmp_path, pace=0.002, every_frame=True)() as sensor:
        next_frame(sensor)
        time.sleep(0.5)
        frames = [next_frame(sensor) for _ in range(100)]
    assert [frame.sequence for frame in frames] == list(range(2, 102))
    assert all(frame.depth[0, 0] == frame.sequence for frame in frames)


def test_images_that_wait_stay_when_larger_ones_need_other_memory(tmp_path):
    with opener(tmp_path, mishap="always another size", after=12, every_frame=True)() as sensor:
        next_frame(sensor)
        time.sleep(0.3)
        frames = [next_frame(sensor) for _ in range(20)]
    assert [int(frame.depth[0, 0]) for frame in frames] == list(range(2, 22))
    assert [frame.depth.shape for frame in frames] == [(48, 64)] * 10 + [(72, 96)] * 10


@pytest.mark.slow
@pytest.mark.parametrize("driver", LIBRARIES)
def test_a_driver_on_its_real_library_is_recorded_and_replayed_frame_for_frame(driver, tmp_path):
    """A recording with gaps is used as the device. Frames, numbers and conditions are the same.

    Depth is bit-identical. The RealSense library maps colour onto depth, with an error of at most one pixel.
    """
    needed(driver)
    cold, hot = Condition("USB 3", False, 41.0, 90.0, (0.0, 9.8, 0.1)), Condition("USB 2", True, 93.0, 90.0)
    script = [Step(error="bad frame"), Step(error="lost"), Step(condition=cold), *[Step()] * 30]
    script += [Step(4, hot), *[Step()] * 26, Step(grey=True), Step(1)]
    # The recording is silent for four seconds. A driver that counts one second as a loss would restart for
    # ever.
    script += [Step(error="lost"), Step(120), Step()]
    take, copied = tmp_path / "take.mcap", tmp_path / "made.mcap"
    recorded(take, Scripted(script, coloured=True)).close()
    words = ["--sensor", driver, "--set", f"rehearse={take}", "--set", "colour=true"]
    # The first recording ends by itself. A recording that restarts for ever is ended like this.
    assert cli.run(["record", *words, "--seconds", "12", "-o", str(copied)]) == 0
    with ReplaySensor(take, speed=0.0) as first, ReplaySensor(copied, speed=0.0) as second:
        assert [type(next_said(first)) for _ in range(2)] == [InputError, SensorFault]
        colour = None
        for step in script[2:]:
            a = next_said(first)
            if step.error:
                continue
            b = second.read()
            assert (b.sequence, b.time_ns) == (a.sequence, a.time_ns)
            np.testing.assert_array_equal(a.depth, b.depth)
            # A camera always delivers colour. If the recording has none, the previous image is repeated.
            colour = colour if a.colour is None else a.colour
            judge_colour(driver, colour, b)
        assert second.read() is None, "and no loss of its own"
        # The helper process reads the device condition once per second.
        assert second.condition() in (cold, hot)


def needed(driver: str) -> None:
    """Skips the test if a driver's library is not installed."""
    if importlib.util.find_spec(LIBRARIES[driver]) is None:
        pytest.skip(f'{LIBRARIES[driver]} is not installed: pip install "./edge[{driver}]"')


def judge_colour(driver: str, expected: np.ndarray, frame: DepthFrame) -> None:
    """Checks that a driver's colour image has the right time and is aligned with the depth."""
    if driver == "oak":
        np.testing.assert_array_equal(frame.colour, expected)
        return
    is_known = frame.depth > 0
    differences = np.abs(frame.colour.astype(int) - expected)[is_known]
    assert differences.max() <= SLOPE and differences[..., 2].max() == 0
    assert (frame.colour[~is_known] == 0).all(), (
        "where there is no depth it is not known which colour that is"
    )


@pytest.mark.parametrize("driver", LIBRARIES)
def test_a_recording_without_colour_is_no_rehearsal_of_colour(driver, tmp_path):
    needed(driver)
    recorded(tmp_path / "grey.mcap", Scripted([Step()])).close()
    kind = {"oak": OakSensor, "realsense": RealSenseSensor}[driver]
    with pytest.raises(InputError, match=r"no colour images\. Rehearse without colour=true"):
        kind(rehearse=str(tmp_path / "grey.mcap"), colour=True)


def test_each_depth_gets_the_colour_of_its_moment_or_none(tmp_path):
    """With the RealSense library, a colour image without depth is skipped, and an early one waits for its
    depth.
    """
    needed("realsense")
    recorded(tmp_path / "a.mcap", Scripted([Step()] * 8, coloured=True)).close()
    with ReplaySensor(tmp_path / "a.mcap", speed=0.0) as replayed:
        frames = [replayed.read() for _ in range(8)]
    sensor = RealSenseSensor(rehearse=str(tmp_path / "a.mcap"), colour=True)
    try:
        hands, eye, seen = sensor._sent_colour, sensor._colour, {}
        for colours, depth in (((0, 1, 2), 2), ((), 3), ((5,), 4), ((), 5), ((6, 7), 7)):
            for number in colours:
                hands.send(frames[number], number)
            sensor._sent_colour = None
            sensor._send(frames[depth], depth)
            there, image = sensor._images.try_wait_for_frame(10_000)
            assert there
            colour = eye.align_to(image.as_depth_frame())
            seen[depth] = None if colour is None else int(colour[0, 0, 2])
    finally:
        sensor.close()
    assert seen == {2: 3, 3: None, 4: None, 5: 6, 7: 8}, "the shade of frame n is n + 1"
