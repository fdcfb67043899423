"""Tests of the `enliven import` and `enliven record` commands."""

import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import typer
from patience import TIMEOUT_S, wait_until
from PIL import Image
from typer.testing import CliRunner

from enliven.camera import Intrinsics
from enliven.errors import EnlivenError, InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder, Recording
from enliven_edge.commands.import_ import import_recording
from enliven_edge.commands.record import record
from enliven_edge.sensors.registry import sensor_options

app = typer.Typer(pretty_exceptions_enable=False)
app.command("import")(import_recording)
app.command("record")(record)


def run(*words) -> str:
    """Returns the command's output; raises its error."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(result.exception, EnlivenError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def folder(tmp_path):
    frames = tmp_path / "frames"
    frames.mkdir()
    rng = np.random.default_rng(0)
    for i in range(4):
        Image.fromarray(rng.integers(0, 5000, (240, 320), np.uint16)).save(frames / f"{i}.png")
    return frames


def test_import_reports_findings_and_assumptions(folder, tmp_path):
    output = run("import", folder, "-o", tmp_path / "take.mcap", "--fps", 10)
    assert "4 frames of 320x240 depth, 0.3 s, sensor kinect1 (plain-depth" in output
    assert "Note: the files contain no camera" in output
    recording = Recording(tmp_path / "take.mcap")
    assert [frame.time_ns for frame in recording.frames()] == [0, 10**8, 2 * 10**8, 3 * 10**8]
    assert recording.info.metadata["import"]["reader"] == "plain-depth"
    assert recording.info.complete


def test_import_mirrors_when_asked(folder, tmp_path):
    run("import", folder, "-o", tmp_path / "a.mcap")
    run("import", folder, "-o", tmp_path / "b.mcap", "--mirror", "--level", 19)
    for a, b in zip(
        Recording(tmp_path / "a.mcap").frames(), Recording(tmp_path / "b.mcap").frames(), strict=True
    ):
        assert np.array_equal(a.depth, b.depth[:, ::-1])


def test_failed_import_leaves_no_file_and_keeps_the_old_one(folder, tmp_path):
    output = tmp_path / "take.mcap"
    run("import", folder, "-o", output)
    before = output.read_bytes()
    with pytest.raises(InputError, match=r"exists already.*--overwrite"):
        run("import", folder, "-o", output)
    damaged = folder / "3.png"
    damaged.write_bytes(damaged.read_bytes()[:100])
    with pytest.raises(InputError, match="damaged"):
        run("import", folder, "-o", output, "--overwrite")
    assert output.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frames", "take.mcap"]
    damaged.unlink()
    run("import", folder, "-o", output, "--overwrite")
    assert Recording(output).info.topics["/depth"].count == 3


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "no input file is named"),
        (["{folder}"], "no output file is named"),
        (["nowhere", "-o", "{out}"], "nowhere: there is no such file"),
        (["{folder}", "-o", "{out}", "--reader", "plane-depth"], "Did you mean plain-depth"),
        (["{folder}", "-o", "{folder}/no/such/folder.mcap"], "no/such' does not exist"),
    ],
)
def test_import_errors_are_reported(folder, tmp_path, words, expected):
    words = [word.format(folder=folder, out=tmp_path / "out.mcap") for word in words]
    with pytest.raises(EnlivenError, match=expected):
        run("import", *words)
    assert [path.name for path in tmp_path.iterdir()] == ["frames"]


def test_import_lists_its_readers():
    output = run("import", "--list-readers")
    for name in ("opencv-depth", "multitrack", "flow-room"):
        assert name in output


def test_help_has_examples():
    for command in ("import", "record"):
        assert f"enliven {command}" in run(command, "--help")


def replayable(path, frames=30):
    camera = Intrinsics(32, 24, 26, 26, 16, 12)
    with Recorder(path) as recorder:
        for i in range(frames):
            depth = np.full((24, 32), i, np.uint16)
            recorder.write_frame(DepthFrame(depth, camera, i * 100_000_000, "test"))
    return path


def test_record_writes_what_the_sensor_delivers(tmp_path):
    source = replayable(tmp_path / "a.mcap")
    words = ["--sensor", "replay", "--set", f"path={source}", "--set", "speed=0"]
    assert "30 frames of test" in run("record", *words, "-o", tmp_path / "b.mcap")
    read = list(Recording(tmp_path / "b.mcap").frames())
    assert [int(frame.depth[0, 0]) for frame in read] == list(range(30))
    run("record", *words, "--seconds", 1, "-o", tmp_path / "c.mcap")
    assert len(list(Recording(tmp_path / "c.mcap").frames())) == 10
    with pytest.raises(InputError, match="exists already"):
        run("record", *words, "-o", tmp_path / "c.mcap")


def test_sensor_options_are_words():
    assert sensor_options(["speed=0", "loop=true", "path=a=b", "x=1.5"]) == {
        "speed": 0,
        "loop": True,
        "path": "a=b",
        "x": 1.5,
    }
    with pytest.raises(InputError, match="KEY=VALUE"):
        sensor_options(["speed"])


PROGRAM = """
    import sys
    import typer
    from enliven_edge.commands.record import record

    typer.run(record)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
def test_ctrl_c_finishes_the_file(tmp_path):
    with Recorder(tmp_path / "slow.mcap") as recorder:
        for i in range(1000):
            recorder.write_frame(BodyFrame([Body(0, np.zeros((J, 3)), np.ones(J))], i * 50_000_000, "slow"))
    output = tmp_path / "out.mcap"
    words = ["--sensor", "replay", "--set", f"path={tmp_path / 'slow.mcap'}", "-o", str(output)]
    program = [sys.executable, "-c", textwrap.dedent(PROGRAM), *words]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:

        def written() -> bool:
            return output.exists() and output.stat().st_size > 3000

        wait_until(lambda: written() or process.poll() is not None, "a recording")
        process.send_signal(signal.SIGINT)
        log_text = process.communicate(timeout=TIMEOUT_S)[0]
    assert process.returncode == 0, log_text
    assert "frames of slow" in log_text
    info = Recording(output).info
    assert info.complete
    assert 0 < info.topics["/bodies"].count < 1000
