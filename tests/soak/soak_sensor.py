"""A third-party driver that repeats the crowd for ever, with faults on command.

It is installed as a separate package (see ``install``), because the edge loads drivers by their entry point.
Commands are lines of a file, which the soak appends: ``{"kind": "lost", "seconds": 3}``.
"""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import replace
from pathlib import Path

from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.sensors.base import Sensor

FAULTS = ("lost", "frozen", "another size", "focal length nan", "out of order")
"""Faults that a command can start. Each lasts for the seconds in the command."""
HANGS = "hangs"
"""The command for a read that hangs for :data:`HANG_S`. The supervisor then restarts the edge."""
JUMP = "clock jump"
"""The command that permanently shifts the sensor's clock by its seconds."""
HANG_S = 30.0
"""Duration of a hanging read, longer than the 10 s without progress that a supervisor allows, seconds."""

_frames: dict[str, list[DepthFrame]] = {}
_state = {"number": 0, "jump_ns": 0, "read_to": 0, "until": 0.0}
_fault = ""


class SoakSensor(Sensor):
    """Delivers the frames of a recording in a loop, ``pace`` per second, with increasing times.

    All devices of a process share their position in the loop and their faults, like one camera that is
    unplugged and plugged in again.
    """

    name = "soak"
    fps = 15.0

    def __init__(self, crowd: str, commands: str, pace: float = 30.0) -> None:
        self._commands, self._pace, self._due = Path(commands), pace, 0.0
        if crowd not in _frames:
            _frames[crowd] = list(Recording(crowd).frames())
            _state["read_to"] = self._commands.stat().st_size if self._commands.exists() else 0
        self._frames = _frames[crowd]
        self._step_ns = self._frames[1].time_ns - self._frames[0].time_ns
        self._obey()
        if _fault == "lost":
            raise OSError(19, "No such device")

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next frame, with the current fault."""
        now = time.monotonic()
        time.sleep(max(0.0, min(self._due - now, 1.0)))
        self._due = max(self._due, now) + 1.0 / self._pace
        self._obey()
        if _fault == "lost":
            raise OSError(19, "No such device")
        if _fault == HANGS:
            _state["until"] = 0.0
            time.sleep(HANG_S)
        if _fault != "frozen":
            _state["number"] += 1
        number = _state["number"]
        frame = self._frames[number % len(self._frames)]
        time_ns = 10**13 + number * self._step_ns + _state["jump_ns"]
        if _fault == "frozen":
            time_ns += int(1e9 * (now % 1000))
        if _fault == "out of order" and number % 3 == 0:
            time_ns -= 4 * self._step_ns
        frame = replace(frame, time_ns=time_ns, sensor=self.name)
        if _fault == "another size":
            return replace(frame, depth=frame.depth[::2, ::2].copy())
        if _fault == "focal length nan":
            return replace(frame, intrinsics=replace(frame.intrinsics, fx=float("nan")))
        return frame

    def close(self) -> None:
        """Does nothing: the next device continues."""

    def __enter__(self) -> SoakSensor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _obey(self) -> None:
        """Reads new commands, and ends a fault whose time is over."""
        global _fault
        if time.monotonic() > _state["until"]:
            _fault = ""
        if not self._commands.exists() or self._commands.stat().st_size <= _state["read_to"]:
            return
        with self._commands.open("rb") as file:
            file.seek(_state["read_to"])
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        _state["read_to"] += len(whole)
        for line in whole.splitlines():
            command = json.loads(line)
            if command["kind"] == JUMP:
                _state["jump_ns"] += int(1e9 * command["seconds"])
            else:
                _fault, _state["until"] = command["kind"], time.monotonic() + command["seconds"]


def install(site: Path) -> None:
    """Installs this driver as a package in a folder, which must be in the PYTHONPATH of the edge."""
    about = site / "soak_sensor-1.0.dist-info"
    about.mkdir(parents=True, exist_ok=True)
    shutil.copy(__file__, site)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: soak-sensor\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.sensors]\nsoak = soak_sensor:SoakSensor\n")
