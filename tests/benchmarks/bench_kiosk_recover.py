"""Measures a kiosk's cold start, and its recovery after each program was killed. Needs Xvfb or a display.

The kiosk has two shipped characters, and a rigged horse if the public models exist (ENLIVEN_DATA). After the
first start, all are in the store of prepared characters, as in an installation.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from data_needs import DATA, RIGS
from figure import Figure

from enliven.supervision.records import ServiceRecord, read_services
from enliven.wire import free_ports

_TIMEOUT_S = 900.0
"""Timeout for a program, seconds. The first start compiles kernels."""
_SETTLE_S = 3.0
"""Wait between two kills, seconds, so that all programs are running again."""
_PROGRAMS = ("edge", "window", "health")
"""Names of the programs of a kiosk with one edge."""
PROFILE = """
[edges.edge]
arguments = ["--loop"]
port = {0}
[health]
port = {1}
[screen]
size = "1280x720"
[characters.chair]
[characters.lamp]
mesh = "lamp"
"""
HORSE = """
[characters.horse]
mesh = "{0}"
"""


def figures() -> Iterator[Figure]:
    """Yields the time until all programs show progress: kiosk.cold_start_s and kiosk.recover_s."""
    with tempfile.TemporaryDirectory() as name, _display() as display:
        folder = Path(name)
        # The first start compiles kernels and prepares characters. It is not measured.
        with _kiosk(folder, display) as kiosk:
            _wait_for_progress(kiosk, folder, {})
        with _kiosk(folder, display) as kiosk:
            yield Figure("kiosk.cold_start_s", _wait_for_progress(kiosk, folder, {}), "s")
            taken = {program: _kill(kiosk, folder, program) for program in _PROGRAMS}
            print("recovery:", ", ".join(f"{program} {seconds:.1f} s" for program, seconds in taken.items()))
            yield Figure("kiosk.recover_s", max(taken.values()), "s")


def _kill(kiosk: subprocess.Popen[bytes], folder: Path, program: str) -> float:
    """Kills a program. Returns the seconds until its successor shows progress."""
    time.sleep(_SETTLE_S)
    before = {record.name: record.pid for record in read_services(folder / "run")}
    os.kill(before[program], signal.SIGKILL)
    return _wait_for_progress(kiosk, folder, {program: before[program]})


def _wait_for_progress(kiosk: subprocess.Popen[bytes], folder: Path, ended: dict[str, int]) -> float:
    """Returns the seconds until all programs show progress, in processes other than the ended ones."""
    began = time.monotonic()

    def has_progress(record: ServiceRecord) -> bool:
        return record.progress_s > 0 and record.pid != 0 and record.pid != ended.get(record.name)

    def is_complete() -> bool:
        records = {record.name: record for record in read_services(folder / "run")}
        return all(name in records and has_progress(records[name]) for name in _PROGRAMS)

    while not is_complete():
        if kiosk.poll() is not None or time.monotonic() - began > _TIMEOUT_S:
            raise SystemExit(f"a program of the kiosk shows no progress: {(folder / 'log').read_text()}")
        time.sleep(0.02)
    return time.monotonic() - began


@contextmanager
def _kiosk(folder: Path, display: str) -> Iterator[subprocess.Popen[bytes]]:
    """Runs a kiosk in its own folders, without the records of an earlier run."""
    shutil.rmtree(folder / "run", ignore_errors=True)
    profile = folder / "foyer.toml"
    edge_port = free_ports()[0]
    while (health_port := free_ports()[0]) in (edge_port, edge_port + 1):  # the second one is for requests
        pass
    horse = "" if RIGS.is_missing else HORSE.format(DATA / RIGS.folder / "quaternius" / "Horse.glb")
    profile.write_text(PROFILE.format(edge_port, health_port) + horse)
    own = {**os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
    own |= {"ENLIVEN_RUNTIME": str(folder / "run"), "XDG_STATE_HOME": str(folder / "state")}
    own["ENLIVEN_CHARACTERS"] = str(folder / "characters")
    command = [sys.executable, "-m", "enliven", "kiosk", str(profile)]
    with (folder / "log").open("wb") as log, subprocess.Popen(command, env=own, stderr=log) as running:
        try:
            yield running
        finally:
            running.terminate()


@contextmanager
def _display() -> Iterator[str]:
    """Yields the existing display, or that of an X server that runs until the context ends."""
    if os.environ.get("DISPLAY"):
        yield os.environ["DISPLAY"]
        return
    server = shutil.which("Xvfb")
    if server is None:
        raise SystemExit("the kiosk needs a display, or Xvfb")
    command = [server, "-displayfd", "1", "-screen", "0", "1280x720x24"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as running:
        assert running.stdout is not None
        yield f":{running.stdout.readline().strip()}"
        running.terminate()
