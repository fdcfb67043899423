"""Tests of live outputs in the edge, in a replay and in a run, from the options to the receivers."""

import socket
from itertools import count, pairwise

import numpy as np
import pytest
from live_receivers import OscReceiver
from patience import wait_until
from posed_people import performer

import enliven.commands.run as run_command
from enliven import cli
from enliven.frames import BodyFrame
from enliven.health import HealthKind
from enliven.outputs.opening import open_outputs
from enliven.outputs.output_plan import plan_outputs
from enliven.outputs.settings import collect_output_settings
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.live_outputs import LiveOutputs
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

SHORT = ["--possess-at", "0.3", "--port", "0"]


@pytest.fixture(scope="module", autouse=True)
def compiled_outputs():
    """Stores the kernels of the outputs. Otherwise a process of outputs compiles them, while frames are
    skipped, and a short run ends before it sends anything.
    """
    addresses = ["vmc:127.0.0.1:9", "osc:127.0.0.1:9", "vrchat:127.0.0.1:9"]
    for plan in plan_outputs(collect_output_settings(addresses, {})):
        plan.open().close()


class Bodies(Sensor):
    """A sensor that returns bodies from memory."""

    name = "bodies"

    def __init__(self, frames) -> None:
        self._frames = iter(frames)

    def read(self, timeout=None):
        return next(self._frames, None)

    def close(self) -> None:
        pass


@pytest.mark.slow
def test_an_edge_sends_a_recording_to_several_programs(tmp_path):
    (tmp_path / "edge.toml").write_text('[outputs.lights]\nto = "osc:127.0.0.1:{port}"\nmap = "map.toml"\n')
    (tmp_path / "map.toml").write_text('others = false\n[addresses]\n"/enliven/event/*" = "/cue/*"\n')
    with OscReceiver() as vmc, OscReceiver() as osc:
        text = (tmp_path / "edge.toml").read_text().format(port=osc.port)
        (tmp_path / "edge.toml").write_text(text)
        source = ["--recording", str(find_shipped_recording()), "--seconds", "1", "--speed", "0"]
        outputs = ["--out", f"vmc:127.0.0.1:{vmc.port}", "--settings", str(tmp_path / "edge.toml")]
        assert cli.run(["edge", *source, *SHORT, *outputs]) == 0
        wait_until(lambda: ("/cue/possess", "chair") in osc.values, "the possession")
        wait_until(lambda: ("/VMC/Ext/Bone/Pos", "Hips") in vmc.values, "the bones of the performer")
        assert ("/VMC/Ext/Tra/Pos", "chair") in vmc.values
        assert osc.values["/cue/possess", "chair"] == (1,) and "/enliven/time" not in osc.values


@pytest.mark.slow
def test_replay_sends_outputs(monkeypatch):
    original = Edge.step
    with OscReceiver() as receiver:

        def step(self, frame):
            original(self, frame)
            if "/tracking/trackers/head/position" in receiver.values:
                self.stop()  # The rest of the recording would take longer and test nothing more.

        monkeypatch.setattr(Edge, "step", step)
        words = [
            "replay",
            str(find_shipped_recording()),
            "--fast",
            "--out",
            f"vrchat:127.0.0.1:{receiver.port}",
        ]
        assert cli.run([*words, *SHORT]) == 0
        assert receiver.values["/tracking/trackers/head/position"][1] > 1.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "vcm:127.0.0.1"], "Did you mean vmc?"),
        (["--out", "vmc:127.0.0.1:0"], "is not a valid port"),
        (["--out", "vmc:no-such-host.invalid"], "was not found"),
        (["--out", "vmc:127.0.0.1", "--out", "vmc:127.0.0.1"], "same output"),
        (["--out", "vmc:127.0.0.1/chair"], "no humanoid bones"),
    ],
)
def test_a_wrong_output_ends_the_edge_at_the_start(words, message, capsys):
    assert cli.run(["edge", "--recording", str(find_shipped_recording()), "--port", "0", *words]) == 3
    assert message in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.slow
def test_lost_packets_are_reported_in_the_heartbeat():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    frames = (BodyFrame([performer()], 10**9 + k * 33_000_000, "bodies", np.eye(4)) for k in count())
    with (
        LiveOutputs(open_outputs(collect_output_settings([f"vmc:127.0.0.1:{port}"], {}))) as outputs,
        Outlet(WireSettings(name="outputs", port=0, control_port=0), "bodies") as outlet,
    ):
        edge = Edge(Bodies(frames), Tracker(), Stage(), outlet, outputs=outputs)

        def reported():
            edge.step(next(frames))
            return [
                state for state in outlet.publisher.status.health if state.kind == HealthKind.OUTPUT_FAILS
            ]

        (state,) = wait_until(reported, "the health state")
    assert f"vmc:127.0.0.1:{port}" in state.what and "Start the receiving program" in state.remedy


def outputs_in(arguments) -> list[str]:
    """Returns the values of ``--out`` in a command line."""
    return [value for word, value in pairwise(arguments) if word == "--out"]


def test_a_run_separates_the_folder_of_the_film_from_outputs(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(run_command, "run_together", lambda processes: started.extend(processes) or 0)
    words = [
        "run",
        "--film",
        "--out",
        str(tmp_path / "film"),
        "--out",
        "vmc:127.0.0.1",
        "--out",
        "osc:10.0.0.5:7000",
    ]
    assert cli.run(words) == 0
    edge, viewer = (list(process.arguments) for process in started)
    assert outputs_in(edge) == ["vmc:127.0.0.1", "osc:10.0.0.5:7000"]
    assert str(tmp_path / "film" / "enliven.mp4") in viewer and "--out" not in viewer
    started.clear()
    assert cli.run(["run", "--window", "--out", "vmc:127.0.0.1"]) == 0
    edge, viewer = started
    assert outputs_in(edge.arguments) == outputs_in(edge.restart_arguments) == ["vmc:127.0.0.1"]
    assert "--out" not in viewer.arguments
    started.clear()
    monkeypatch.chdir(tmp_path)
    assert cli.run(["run", "--film", "--out", "C:film"]) == 0
    assert "--out" not in started[0].arguments, "a drive of Windows is not a protocol"
    assert cli.run(["run", "--film"]) == 0 and (tmp_path / "out").is_dir()
