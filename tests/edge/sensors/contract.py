"""The requirements that every live sensor fulfils, and the sensors under test. A new one is one line of
DRIVERS.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from garbled import GarbledOak, GarbledPlain, GarbledRealSense
from patience import TIMEOUT_S
from troubled import camera, picture

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors.base import Sensor, SensorFault
from enliven_edge.sensors.isolation.isolated import IsolatedOpener
from enliven_edge.sensors.reopening import open_reopening

FULL = os.environ.get("ENLIVEN_CONTRACT") == "full"
"""True to run the complete tests of every driver (make test-devices), False for a shorter version (make
test).
"""
FRAMES = 300 if FULL else 60
STEP = 11_111_111
"""Nanoseconds between two images at 90 per second, the cameras' fastest mode."""
CLOCK = 1_000
"""Maximum rounding of a library's clock in nanoseconds."""
SIZE, OTHER = (96, 64), (128, 72)
"""Image sizes in pixels, before and after the mode change."""
LONG = 1_200
"""Number of images in a recording that replaces a device: 13 s, longer than any test."""
PAUSE = 40
"""Number of images (0.44 s) for which a device is silent while its mode changes. A loss takes longer."""


@dataclass(frozen=True)
class Driver:
    """A driver that has to fulfil the requirements.

    Attributes:
        kind: its class. It runs in a helper process, with ``rehearse=`` in place of a device.
        garbled: the same driver with a library that sometimes delivers garbage, None if that cannot be
            simulated.
        needs: the required library, and the extra of enliven-edge that installs it.
    """

    name: str
    kind: str
    garbled: type | None = None
    needs: tuple[str, str] = ("", "")

    @property
    def rounds(self) -> int:
        """Returns how often the tests disconnect and reconnect the device."""
        return 5 if FULL else 2 if self.name == "plain" else 1

    def opener(self, take: Path, kind: type | None = None) -> IsolatedOpener:
        """Returns an opener for a recording, like the registry's."""
        module, _, name = self.kind.partition(":")
        kind = kind or getattr(importlib.import_module(module), name)
        return IsolatedOpener(self.name, kind, {"rehearse": str(take)})


DRIVERS = (
    Driver("plain", "garbled:Plain", GarbledPlain),
    Driver("oak", "enliven_edge.sensors.drivers.oak:OakSensor", GarbledOak, ("depthai", "oak")),
    Driver(
        "realsense",
        "enliven_edge.sensors.drivers.realsense:RealSenseSensor",
        GarbledRealSense,
        ("pyrealsense2", "realsense"),
    ),
    Driver("orbbec", "enliven_edge.sensors.drivers.orbbec:OrbbecSensor", needs=("pyorbbecsdk", "orbbec")),
    Driver("tof", "enliven_edge.sensors.drivers.tof:TofSensor"),
)
"""The drivers under test; "plain" is a user's own driver without any library."""


def usable(driver: Driver) -> Driver:
    """Returns the driver; skips the test with a reason if its library is missing."""
    library, extra = driver.needs
    if library and importlib.util.find_spec(library) is None:
        pytest.skip(f'{library} is not installed: pip install "./edge[{extra}]"')
    return driver


def numbered(number: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Returns a (height, width) uint16 depth image in millimetres that encodes its number."""
    depth = picture(number % 7, *size)
    depth[0, :2] = number % 1000, number // 1000
    return depth


def number_of(depth: np.ndarray) -> int:
    """Decodes the number of an image."""
    return int(depth[0, 0]) + 1000 * int(depth[0, 1])


def lens(size: tuple[int, int]):
    return camera(*size, 80.25 * size[0] / SIZE[0])


def recorded(path: Path, frames: int, change_at: int | None = None) -> Path:
    """Writes a recording of numbered images. After a pause at ``change_at`` their size changes."""
    with Recorder(path) as recorder:
        for number in range(frames):
            changed = change_at is not None and number >= change_at
            size, at = (OTHER, number + PAUSE) if changed else (SIZE, number)
            recorder.write_frame(DepthFrame(numbered(number, size), lens(size), at * STEP, "test"))
    return path


def helpers() -> list:
    """Returns the helper processes of the current process."""
    return [p for p in multiprocessing.active_children() if p.name.startswith("sensor")]


def helper_of(sensor: Sensor) -> int:
    """Returns the helper process of an open sensor."""
    return sensor._device._helper._process.pid


def next_frame(sensor: Sensor, errors: list[Exception] | None = None, most: float = TIMEOUT_S):
    """Returns the next frame, and skips timeouts and faults of the recording."""
    deadline = time.monotonic() + most
    while time.monotonic() < deadline:
        try:
            return sensor.read(0.1)
        except TimeoutError:
            continue
        except (SensorFault, InputError) as error:
            if errors is not None:
                errors.append(error)
    raise AssertionError("no frame came")


class Live:
    """A sensor that stays open on a recording, which may be exchanged, removed and restored."""

    def __init__(self, driver: Driver, take: Path, folder: Path) -> None:
        self.driver, self.take, self.path = driver, take, folder / "rehearsal.mcap"
        self._aside = folder / "aside.mcap"
        shutil.copy(take, self.path)
        self.sensor = open_reopening(driver.opener(self.path))
        self.last = next_frame(self.sensor)

    def frame(self, errors: list[Exception] | None = None) -> DepthFrame:
        """Returns the next frame, and checks that its time is later than the previous frame's."""
        frame = next_frame(self.sensor, errors)
        assert frame is not None, "a live sensor never ends"
        assert frame.time_ns > self.last.time_ns
        self.last = frame
        return frame

    def signal(self, number: int) -> None:
        """Sends a signal to the helper process. SIGSTOP simulates a hanging library call, SIGKILL a crash."""
        os.kill(helper_of(self.sensor), number)

    def awake(self) -> Live:
        """Returns the sensor with enough of its recording left. Reopens it if the recording has ended or was
        changed.
        """
        frame = next_frame(self.sensor, [])
        if frame is None or number_of(frame.depth) > LONG // 4 or frame.depth.shape[::-1] != SIZE:
            self.close()
            shutil.copy(self.take, self.path)
            self.sensor = open_reopening(self.driver.opener(self.path))
            frame = next_frame(self.sensor)
        self.last = frame
        return self

    def gone(self, gone: bool = True) -> None:
        """Unplugs the device, or plugs it in again."""
        here, there = (self.path, self._aside) if gone else (self._aside, self.path)
        here.rename(there)

    def lose(self) -> Exception:
        """Kills the helper process. Returns the reported error once the edge has noticed it."""
        self.signal(signal.SIGKILL)
        errors: list[Exception] = []
        self.until(lambda: errors, errors)
        return errors[0]

    def play(self, take: Path) -> None:
        """Switches to another recording, like a camera that was reconfigured while disconnected."""
        self.gone()
        self.lose()
        shutil.copy(take, self._aside)
        self.gone(False)
        self.frame()

    def until(self, done: Callable[[], object], errors: list[Exception]) -> None:
        """Reads until a condition holds."""
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, f"it never came to that: {errors}"
            try:
                self.last = self.sensor.read(0.1)
            except TimeoutError:
                continue
            except (SensorFault, InputError) as error:
                errors.append(error)

    def close(self) -> None:
        self.sensor.close()


def processor_seconds(pid: int) -> float:
    """Returns the processor time of another process in seconds, 0 if the system does not report it."""
    if not sys.platform.startswith("linux"):
        return 0.0
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
