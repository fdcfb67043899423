"""Tests that no program looks up a foreign host name, sends to a foreign address, or leaves telemetry
files.
"""

import contextlib
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from name_hook import TELEMETRY_HOST, NameHook
from patience import wait_until

import enliven_edge.assets
from enliven.commands.processes import is_listening
from enliven.wire import free_ports

CHAIR = Path(enliven_edge.assets.__file__).with_name("chair.mcap")
LONGEST_DELAY = 9.5
"""Time until the library's telemetry first looks up its host, seconds. Measured: 8.9 to 9.0."""
COMMAND_THAT_STAYS = (
    "import sys, time; from enliven.cli import run; run(sys.argv[2:]); time.sleep(float(sys.argv[1]))"
)
"""Runs a command and then keeps the process alive long enough for telemetry to report."""
LIBRARY = """
import sys, time
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
load_shipped_estimator()
time.sleep(float(sys.argv[1]))
"""
OLD_BEHAVIOUR = """
import signal, sys, time
import onnxruntime
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
time.sleep(300)
"""
"""Runs ONNX Runtime without enliven, and ends as enliven ends."""
LOOPBACK_ALONE = """
import fcntl, socket, struct, sys
from enliven.cli import run
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
    fcntl.ioctl(device, 0x8914, struct.pack("16sh14x", b"lo", 0x1 | 0x40))
sys.exit(run(sys.argv[1:]))
"""
"""Brings the loopback device up (SIOCSIFFLAGS: up and running), then runs a command."""
NETWORK = CHAIR.with_name("estimator.onnx")


def ended(process: subprocess.Popen[str]) -> str:
    """Waits for the end of a program and returns its output."""
    process.terminate()
    try:
        return process.communicate(timeout=20)[0]
    except subprocess.TimeoutExpired:
        process.kill()
        return process.communicate()[0]


def fenced(*words: str | Path) -> list[str | Path]:
    """Returns the command line of ``enliven`` with the given arguments, without network access if
    possible.
    """
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rn", "true"]).returncode:
        return [sys.executable, "-m", "enliven", *words]
    return ["unshare", "-rn", sys.executable, "-c", LOOPBACK_ALONE, *words]


@pytest.mark.slow
def test_no_program_looks_up_an_outside_name(tmp_path: Path, screen: str) -> None:
    """Runs every program at once under the hook, and also ONNX Runtime without enliven.

    ``enliven run`` starts ``enliven edge`` and ``enliven view``, which inherit the hook. If permitted, it
    runs in a network namespace with only a loopback device, as behind a firewall.
    """
    hook, old = NameHook(tmp_path / "ours"), NameHook(tmp_path / "old")
    with contextlib.ExitStack() as stack:

        def start(hook: NameHook, *words: str | Path) -> subprocess.Popen[str]:
            process = hook.start(*words, DISPLAY=screen, LIBGL_ALWAYS_SOFTWARE="1")
            stack.callback(ended, process)
            return process

        library = start(old, sys.executable, "-c", OLD_BEHAVIOUR, NETWORK)
        stays = (sys.executable, "-c", COMMAND_THAT_STAYS, str(LONGEST_DELAY + 1))
        short = [
            start(hook, *stays, "track", CHAIR, "-o", tmp_path / "bodies.mcap"),
            start(
                hook,
                *stays,
                "scan",
                "--person",
                "--recording",
                CHAIR,
                "--seconds",
                "1",
                "-o",
                tmp_path / "s.glb",
            ),
            start(hook, sys.executable, "-c", LIBRARY, str(LONGEST_DELAY + 1)),
        ]
        run = start(hook, *fenced("run", "--window", "--size", "160x120", "--recording", CHAIR))
        studio = start(hook, sys.executable, "-m", "enliven", "studio")
        for process in short:
            process.wait(300)
        wait_until(
            lambda: TELEMETRY_HOST in old.outside_names(), "the library's own behaviour under the hook"
        )
        assert run.poll() is None and studio.poll() is None, ended(run) + ended(studio)
        outputs = [ended(process) for process in (*short, run, studio)]
        assert library.poll() is None
    assert (tmp_path / "bodies.mcap").exists(), outputs
    assert old.telemetry_files(), "the library's own behaviour keeps a device id"
    assert hook.outside_names() == set(), outputs
    assert hook.telemetry_files() == [], outputs
    assert "127.0.0.1" in hook.log.read_text(), "the viewer of enliven run was under the hook"


@pytest.mark.slow
def test_the_edge_ends_at_sigterm_after_the_clock_has_jumped_before_1970(tmp_path: Path) -> None:
    """If the library's telemetry is enabled, a process may hang then, because its uploads wait for a later
    time.
    """
    hook = NameHook(tmp_path / "ours")
    port, control = (str(port) for port in free_ports()[:2])
    at = ("--port", port, "--control-port", control, "--name", "past")
    edge = hook.start(sys.executable, "-m", "enliven", "edge", "--recording", CHAIR, "--loop", *at)
    try:
        wait_until(lambda: is_listening("127.0.0.1", int(port)), "the edge", 300.0)
        hook.past.touch()
        time.sleep(LONGEST_DELAY + 1.0)
        edge.terminate()
        assert edge.wait(15) in (0, 130), "done, or interrupted while it prepares"
    finally:
        edge.kill()
        edge.wait()
