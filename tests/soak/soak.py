"""Simulates a day of an exhibition with faults in less than an hour: `make soak MINUTES=5 SEED=1`.

A real edge tracks a synthetic crowd, a real window shows it, and enliven's supervisor restarts both. Sensor
faults, clock jumps, kills, a full disk, and hostile peers occur on a random schedule, which the seed
determines. The report is in out/soak.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from random import Random
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE)]
import soak_day  # noqa: E402
import soak_peers  # noqa: E402
import soak_report  # noqa: E402
import soak_sensor  # noqa: E402
from soak_crowd import draw_crowd  # noqa: E402
from soak_disk import TakeDisk  # noqa: E402
from soak_programs import Program, ProgramGroup  # noqa: E402

from enliven.kiosk.profile import CareSettings  # noqa: E402
from enliven.supervision.causes import describe_exit  # noqa: E402
from enliven.supervision.records import RUNTIME_VARIABLE  # noqa: E402
from enliven.wire import free_ports  # noqa: E402

OUT = Path("out/soak")
ROUND_S = 30.0
"""Seconds of the crowd's recording. It contains four visitors."""
START_S = 600.0
"""Timeout for the first frame, seconds. The first start on a machine compiles kernels."""
MAX_SILENCE_S = 180.0
"""Maximum time without a published frame, seconds.

The supervisor ends an edge with a hanging sensor after 10 s. The start of an edge takes 5 s, or more than a
minute on a machine with a load of 30.
"""
FULL_S = 8.0
"""Seconds for which the disk is full."""
FAULT_S = (0.5, 4.0)
"""Range of the duration of a sensor's fault, seconds."""
JUMP_S = 3600.0
"""Size of the jumps of the sensor's clock, forwards or backwards, seconds."""
VIEWER_SETTINGS = "[playback]\nminutes = 1.0\n"
"""Settings of the window. It keeps the last minute instead of ten minutes, so that its memory soon stops
growing.
"""
PART_MINUTES = "1.0"
"""Minutes per file of the take. As a single file, the take of the last edge process would fill the small
disk.
"""
QUIET_S = 2.0
"""Seconds without a frame after which the end of a soak is delayed until frames are published again."""
ENDS = (0, 130, -signal.SIGTERM)
"""Exit codes of a program that SIGTERM ends, in its loop or while it starts."""
TICK_S, SAMPLE_S, CLEAN_S = 0.02, 1.0, 60.0
"""Intervals: of reading, of measuring, and of removing old takes, seconds."""


class Soak:
    """The programs, their peers and the schedule.

    Args:
        minutes: length, minutes.
        seed: determines the schedule.
        folder: folder for logs, takes and the report.
        round_s: seconds of the crowd's recording.
    """

    def __init__(self, minutes: float, seed: int, folder: Path, round_s: float = ROUND_S) -> None:
        self.minutes, self.seed, self.folder = minutes, seed, folder
        self._dice = Random(seed)
        self._commands = folder / "commands"
        self._commands.write_text("")
        crowd = folder / f"crowd-{round_s:g}.mcap"
        if not crowd.exists():
            print("soak: drawing the crowd", flush=True)
            draw_crowd(crowd, round_s, seed=1)
        self.disk = TakeDisk(folder / "takes")
        ports = free_ports(3)
        self.ports, health_port = (ports[0], ports[1]), ports[2]
        edge = ["edge", "--sensor", "soak", "--set", f"crowd={crowd.resolve()}"]
        edge += ["--set", f"commands={self._commands.resolve()}", "--mesh", "chair", "--possess-at", "1"]
        edge += ["--record", str(self.disk.folder / "take-{number}.mcap"), "--part-minutes", PART_MINUTES]
        edge += ["--name", f"soak-{os.getpid()}"]
        edge += ["--port", str(self.ports[0]), "--control-port", str(self.ports[1])]
        name = f"edge soak-{os.getpid()}"
        view = ["view", "--edge", f"127.0.0.1:{self.ports[0]}", "--control-port", str(self.ports[1])]
        view += ["--fullscreen", "--no-hud", "--size", "320x180"]
        settings = folder / "viewer.toml"
        settings.write_text(VIEWER_SETTINGS)
        view += ["--settings", str(settings)]
        health = ["health", "--edge", f"127.0.0.1:{self.ports[0]}", "--port", str(health_port)]
        frozen_after_s = CareSettings().frozen_after
        self.edge = Program("edge", edge, name, frozen_after_s, ready=lambda: self._has_people)
        self.viewer = Program("viewer", view, "viewer")
        self.health_page = Program("health page", health, "health", frozen_after_s)
        self.programs = (self.edge, self.viewer, self.health_page)
        self.group = ProgramGroup(self.programs, folder)
        self.counts: dict[str, int] = {}
        self.events: list[dict[str, Any]] = []
        self._timers: list[tuple[float, Any]] = []

    def run(self) -> dict[str, Any]:
        """Runs to the end, and returns the report."""
        self.watch, self.guests = soak_peers.Watch(self.ports[0]), soak_peers.Guests(self.ports)
        self.started_s = time.time()
        self.group.start()
        begun = time.monotonic()
        try:
            while not self._has_people:
                self.watch.poll(0.0)
                self.group.poll()
                if time.monotonic() - begun > START_S or self.group.is_over:
                    raise SystemExit(f"soak: the edge did not start; its log is in {self.folder}")
                time.sleep(TICK_S)
            self._run_schedule()
        finally:
            exits = self.group.end()
            self.guests.close()
            self.watch.close()
            self.disk.close()
        return self._report(exits)

    @property
    def _has_people(self) -> bool:
        """Returns True if the edge has published people."""
        return bool(self.watch.counts.get("bodies"))

    def _run_schedule(self) -> None:
        self._start = time.monotonic()
        waiting = soak_day.schedule(self.minutes, self.seed)
        sampled = cleaned = 0.0
        end_s = 60.0 * self.minutes
        while (at_s := time.monotonic() - self._start) < end_s or (
            self.watch.silent_s > QUIET_S and at_s < end_s + MAX_SILENCE_S
        ):
            while waiting and waiting[0].at_s <= at_s:
                self._begin(waiting.pop(0).kind, at_s)
            for due, end in list(self._timers):
                if at_s >= due:
                    self._timers.remove((due, end))
                    end()
            self.watch.poll(at_s)
            self.guests.poll()
            if at_s - sampled >= SAMPLE_S:
                sampled = at_s
                self.group.poll()
                for program in self.programs:
                    program.sample(at_s, self.watch.counts["bodies"])
            if at_s - cleaned >= CLEAN_S:
                cleaned = at_s
                self.disk.remove_old_takes()
                print(f"soak: {at_s:.0f} s, {self.watch.counts}, {self.watch.visits} visits", flush=True)
            time.sleep(TICK_S)
        self.group.poll()

    def _begin(self, kind: str, at_s: float) -> None:
        """Causes an event."""
        detail = ""
        match kind:
            case "viewer connects":
                reads, stay_s = self._dice.random() < 0.67, self._dice.uniform(*soak_peers.STAY_S)
                self.guests.connect(stay_s, reads)
                detail = f"for {stay_s:.1f} s" + ("" if reads else ", never reads")
            case "character uploaded":
                self.guests.upload()
            case "possession":
                self.guests.possess()
            case "sensor fault":
                detail = soak_sensor.FAULTS[self.counts.get(kind, 0) % len(soak_sensor.FAULTS)]
                self._command(detail, self._dice.uniform(*FAULT_S))
            case "sensor hangs":
                self._command(soak_sensor.HANGS, FAULT_S[1])
                self.edge.expected_freezes += 1
            case "clock jump":
                jump = self._dice.choice((-JUMP_S, JUMP_S))
                detail = f"{jump:+g} s"
                self._command(soak_sensor.JUMP, jump)
            case "full disk":
                pid = self.edge.pid
                self.disk.fill(pid)
                self._timers.append((at_s + FULL_S, lambda: self.disk.free(pid)))
            case "hostile attack":
                self.guests.attack()
            case "edge killed":
                self.edge.kill()
            case "viewer killed":
                self.viewer.kill()
            case "health page killed":
                self.health_page.kill()
        self.counts[kind] = self.counts.get(kind, 0) + 1
        self.events.append({"at_s": round(at_s, 1), "kind": kind, "detail": detail})

    def _command(self, kind: str, seconds: float) -> None:
        with self._commands.open("a") as file:
            file.write(json.dumps({"kind": kind, "seconds": seconds}) + "\n")

    def _report(self, exits: Mapping[str, int]) -> dict[str, Any]:
        self.counts["visitor in view"] = self.watch.visits
        hours, limit = soak_day.simulated_hours(self.counts)
        seconds_per_day = 60.0 * soak_day.MINUTES_PER_DAY
        longest = max([self.watch.silent_s, *(length for _, length in self.watch.silences)])
        faults = [f"the {p.name} ended: {cause}" for p in self.programs for cause in p.unexpected_ends]
        faults += [f"the {p.name} never ran" for p in self.programs if not p.samples]
        faults += [
            f"the {name} did not end as it should: {describe_exit(code)}"
            for name, code in exits.items()
            if code not in ENDS
        ]
        faults += [
            f"the log of the {p.name} contains {len(p.errors)} errors" for p in self.programs if p.errors
        ]
        if longest > MAX_SILENCE_S:
            faults.append(f"no frame was published for {longest:.0f} s")
        return {
            "minutes": self.minutes,
            "seed": self.seed,
            "hours": round(hours, 3),
            "limited_by": limit,
            "day_hours": soak_day.DAY_HOURS,
            "per_day": soak_day.PER_DAY,
            "counts": self.counts,
            "published": self.watch.counts,
            "frame_hours": self.watch.counts.get("bodies", 0) / 30.0 / 3600.0,
            "longest_silence_s": round(longest, 2),
            "silences": [{"at_s": at, "length_s": length} for at, length in self.watch.silences],
            "disk": self.disk.kind,
            "requests": {
                "answered": self.guests.answered,
                "refused": dict(self.guests.refusals),
                "unanswered": self.guests.unanswered,
            },
            "programs": {
                p.name: soak_report.describe_program(p, seconds_per_day, self.started_s)
                for p in self.programs
                if p.samples
            },
            "faults": faults,
            "events": self.events,
        }


@contextlib.contextmanager
def display() -> Iterator[None]:
    """Provides a screen without a monitor by Xvfb, unless the caller has one.

    Raises:
        SystemExit: if there is neither.
    """
    if os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        raise SystemExit("soak: the window needs a display. Install Xvfb, or set DISPLAY.")
    reader, writer = os.pipe()
    command = ["Xvfb", "-displayfd", str(writer), "-screen", "0", "320x180x24"]
    server = subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with os.fdopen(reader) as answer:
            os.environ["DISPLAY"] = f":{answer.readline().strip()}"
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        server.terminate()
        server.wait()


@contextlib.contextmanager
def environment(folder: Path) -> Iterator[None]:
    """Returns environment variables: the soak's driver is installed, and the user's keys and settings are not
    used.
    """
    site = folder.resolve() / "site"
    soak_sensor.install(site)
    before = dict(os.environ)
    with tempfile.TemporaryDirectory() as home:
        paths = [str(site), *filter(None, [before.get("PYTHONPATH")])]
        os.environ["PYTHONPATH"] = os.pathsep.join(paths)
        os.environ |= dict.fromkeys(("XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_RUNTIME_DIR"), home)
        os.environ[RUNTIME_VARIABLE] = str(folder.resolve() / "runtime")
        try:
            yield
        finally:
            os.environ.clear()
            os.environ.update(before)


def soak(minutes: float, seed: int, folder: Path, round_s: float = ROUND_S) -> dict[str, Any]:
    """Runs a soak, writes its report, and returns it."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.log"):
        old.unlink()
    for old in ("runtime", "history"):
        shutil.rmtree(folder / old, ignore_errors=True)
    with environment(folder), display():
        report = Soak(minutes, seed, folder, round_s).run()
    soak_report.write_report(report, folder)
    return report


def main(arguments: list[str]) -> int:
    """Returns the exit code: 1 if a fault was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=soak_day.MINUTES_PER_DAY)
    parser.add_argument("--seed", type=int, default=time.time_ns() % 1_000_000)
    options = parser.parse_args(arguments)
    print(f"soak: {options.minutes:g} minutes, SEED={options.seed}", flush=True)
    report = soak(options.minutes, options.seed, OUT)
    print((OUT / "report.md").read_text().partition("\n## Restarts")[0])
    print(f"soak: the whole report is {OUT / 'report.md'}")
    return 1 if report["faults"] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
