"""Tests of a third-party sensor with every possible camera fault, in the real programs."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from patience import wait_until

from enliven.recording import Recording
from enliven.wire.ports import free_ports
from enliven_edge.sensors.attached_cameras import list_attached
from enliven_viewer.link.edge_client import EdgeClient

sys.path.insert(0, str(Path(__file__).parent.parent / "edge" / "sensors"))
from troubled import picture

pytestmark = pytest.mark.system

DRIVER = Path(__file__).parent.parent / "edge" / "sensors" / "troubled.py"
PATIENCE = 300.0
"""Timeout in seconds for a program to start and end on a loaded machine."""
FAULTS = "OSError,another size,focal length nan,negative time,RuntimeError,wrong type,endless time,no frame"


@pytest.fixture
def installed(tmp_path) -> dict[str, str]:
    """Returns environment variables for a Python in which the driver is installed as a package."""
    site = tmp_path / "site"
    about = site / "troubled-1.0.dist-info"
    about.mkdir(parents=True)
    shutil.copy(DRIVER, site)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: troubled\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[enliven.sensors]\ntroubled = troubled:Troubled\n")
    return {**os.environ, "PYTHONPATH": str(site)}


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "enliven", *arguments]


def edge(name: str, *arguments: str) -> list[str]:
    ports = ["--port", "0", "--control-port", "0", "--name", name]
    return command("edge", "--sensor", "troubled", *ports, *arguments)


@pytest.mark.slow
def test_edge_survives_and_reports_every_fault(tmp_path, installed):
    options = ["--set", "frames=120", "--set", f"faults={FAULTS}", "--set", "every=10", "--set", "pace=0.01"]
    asked = edge("outlives", *options, "--record", str(tmp_path / "take.mcap"))
    done = subprocess.run(asked, env=installed, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    output = " ".join(done.stderr.split())
    assert "120 frames" in output
    for sentence in ("failed: [Errno 19] No such device", "80x60 pixels instead of 64x48", "focal length"):
        assert sentence in output
    assert len(list(Recording(tmp_path / "take.mcap").messages("bodies"))) == 120


@pytest.mark.slow
def test_once_option_ends_the_program_at_first_fault(installed):
    options = ["--set", "faults=OSError", "--set", "frames=1000000", "--set", "pace=0.01"]
    done = subprocess.run(
        edge("once", *options, "--once"), env=installed, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 4, done.stderr
    assert "Traceback" not in done.stderr
    assert "No such device" in done.stderr and "without --once" in " ".join(done.stderr.split())


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGTERM")
@pytest.mark.slow
def test_a_read_that_never_returns_is_ended_by_sigterm_and_the_take_is_whole(tmp_path, installed):
    take, log = tmp_path / "take.mcap", tmp_path / "log"
    options = ["--set", "faults=hangs", "--set", "every=30", "--set", "frames=100", "--record", str(take)]
    with log.open("w") as error_file:
        running = subprocess.Popen(edge("hangs", *options), env=installed, stderr=error_file, text=True)
        try:
            deadline = int(PATIENCE / 0.1)
            while "has sent no frame" not in " ".join(log.read_text().split()) and deadline > 0:
                deadline -= 1
                assert running.poll() is None, log.read_text()
                with pytest.raises(subprocess.TimeoutExpired):
                    running.wait(0.1)
            running.send_signal(signal.SIGTERM)
            assert running.wait(60.0) == 0, log.read_text()
        finally:
            running.kill()
            running.wait()
    assert "30 frames" in log.read_text() and "Traceback" not in log.read_text()
    recording = Recording(take)
    assert recording.info.complete and len(list(recording.messages("bodies"))) == 30


@pytest.mark.slow
def test_recording_continues_over_every_sensor_fault(tmp_path, installed):
    options = ["--set", "frames=60", "--set", f"faults={FAULTS}"]
    asked = command("record", "--sensor", "troubled", *options, "-o", str(tmp_path / "a.mcap"))
    done = subprocess.run(asked, env=installed, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    frames = list(Recording(tmp_path / "a.mcap").frames())
    assert [frame.depth[0, 0] for frame in frames if frame.depth.shape == (48, 64)][-1] == picture(59)[0, 0]
    assert len(frames) == 62, "60, the one of another size, and -5 ns of a device that counts anew"


MISSING = "an OAK is not connected"
PLUG = (
    f"{MISSING}. Plug the camera into a USB 3 port, check with enliven doctor that it is connected, "
    "and type: "
)
NO_LIBRARY = "depthai is not installed"
INSTALL = f'{NO_LIBRARY}. Type: pip install "enliven-edge[oak]"'
"""Error of the first camera command in docs/tour.md if no camera is connected or its library is missing."""


@pytest.fixture
def no_camera():
    """Skips the test if such a camera is connected, since the doctor would report it."""
    if any(camera.kind.sensor == "oak" for camera in list_attached()):
        pytest.skip("there is one")


@pytest.mark.slow
def test_run_without_its_camera_gives_advice_and_command(no_camera):
    asked = command("run", "--sensor", "oak", "--window")
    done = subprocess.run(asked, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 4, done.stderr
    output = " ".join(done.stderr.split())
    assert f"{PLUG}enliven run --sensor oak" in output or INSTALL in output
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGTERM")
@pytest.mark.slow
def test_edge_started_before_its_camera_waits_and_informs_viewers(no_camera, tmp_path):
    port, control = free_ports()
    ports = ["--port", str(port), "--control-port", str(control), "--name", "kiosk"]
    with (tmp_path / "log").open("w+") as log:
        asked = command("edge", "--sensor", "oak", "--wait-for-sensor", *ports)
        running = subprocess.Popen(asked, stderr=log, text=True)
        try:
            with contextlib.closing(EdgeClient([f"127.0.0.1:{port}:{control}"])) as link:

                def told() -> bool:
                    link.poll()
                    assert running.poll() is None
                    wrong = link.status.health if link.status else []
                    return any(
                        f"{MISSING}. {state.remedy}".startswith(PLUG) or NO_LIBRARY in state.what
                        for state in wrong
                    )

                wait_until(told, "what is wrong")
            running.send_signal(signal.SIGTERM)
            assert running.wait(60.0) == 0
        finally:
            running.kill()
            running.wait()
        log.seek(0)
        assert "Traceback" not in log.read()
