"""Tests of both programs as processes to the end of a recording: poses and images match the references.

``pytest tests/system --record-references`` (or ``make record-references``) stores new references.
"""

import functools
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import av
import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S, wait_until
from PIL import Image

from enliven import cli
from enliven.errors import EnlivenError
from enliven.recording import Recording
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert import message_to_bodies, message_to_pose
from enliven.wire.convert_characters import message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.streams import BodiesMessage, PoseMessage

REFERENCES = Path(__file__).parent / "references"
POSES, PICTURE = REFERENCES / "road.npz", REFERENCES / "road.png"
SHOWN = 4.0
"""Seconds of the recording that are filmed. Filming takes most of the time; only the edge runs to the end."""
WIDE, HIGH = 640, 360
"""Size of the film in pixels: a quarter of the default, and equal to the reference image."""
EVERY = 9
"""Every ninth frame is stored."""
JOINT_TOLERANCE, NODE_TOLERANCE, LINEAR_TOLERANCE = 0.05, 0.06, 0.25
"""Tolerances in metres, metres, and entries of the linear parts.

Rounding on another processor may flip one contact of the fit. The errors of a broken stage are far larger.
"""
PICTURE_TOLERANCE = 12.0
"""Maximum mean difference of 8-bit channels at a quarter of the size, after a blur. Antialiasing differs
between OpenGL drivers.
"""
APPEARS = 6
"""Frames within which a performer in the first frame is detected (a fifth of a second)."""

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def road(tmp_path_factory):
    """Returns the folder with film, contact sheet and take of one run of the main job."""
    folder = tmp_path_factory.mktemp("road")
    command = [sys.executable, "-m", "enliven", "run", "--film", "--out", str(folder)]
    command += ["--seconds", str(SHOWN), "--record", str(folder / "take.mcap"), "--size", f"{WIDE}x{HIGH}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Returns the fields of the edge's take of the whole recording, with the same options as in the main
    job.
    """
    take = tmp_path_factory.mktemp("whole") / "take.mcap"
    words = ["edge", "--possess-at", "1.5", "--speed", "0", "--port", "0", "--control-port", "0"]
    assert cli.run([*words, "--name", "whole", "--record", str(take)]) == 0
    return fields_of(take)


def fields_of(take: Path) -> dict[str, np.ndarray]:
    """Returns every ninth frame of a take without the first frame: times, joints, confidences, nodes, linear
    parts.
    """
    recording = Recording(take)
    (_, data), *_ = recording.messages("character")
    codec = PoseCodec(message_to_character(msgspec.msgpack.decode(data, type=CharacterMessage)))
    poses = [
        message_to_pose(msgspec.msgpack.decode(data, type=PoseMessage), codec)
        for _, data in recording.messages("pose")
    ]
    bodies = [
        message_to_bodies(msgspec.msgpack.decode(data, type=BodiesMessage))
        for _, data in recording.messages("bodies")
    ]
    assert len(poses) == len(bodies)
    assert all(len(present) == 1 for present in bodies[APPEARS:]), "the performer was lost"
    return {
        "frames": np.array(len(poses)),
        "time_ns": np.array([pose.time_ns for pose in poses[EVERY::EVERY]]),
        "joints": np.array([present[0].joints for present in bodies[EVERY::EVERY]], np.float32),
        "confidence": np.array([present[0].confidence for present in bodies[EVERY::EVERY]], np.float32),
        "positions": np.array([pose.positions for pose in poses[EVERY::EVERY]], np.float32),
        "linear": np.array([pose.linear for pose in poses[EVERY::EVERY]], np.float16),
    }


def test_poses_match_the_reference(road, whole, request):
    if request.config.getoption("--record-references"):
        np.savez_compressed(POSES, **whole)
        pytest.skip("stored the poses again")
    filmed = fields_of(road / "take.mcap")
    assert abs(int(filmed["frames"]) - SHOWN * 30) <= 1
    with np.load(POSES) as reference:
        assert set(whole) == set(reference.files)
        assert whole["frames"] == reference["frames"]
        for poses in (whole, filmed):
            as_stored(poses, {name: reference[name] for name in reference.files})


def as_stored(found: dict[str, np.ndarray], reference: dict[str, np.ndarray]) -> None:
    """Checks that every ninth frame equals the reference. The reference may be longer."""
    count = len(found["time_ns"])
    np.testing.assert_array_equal(found["time_ns"], reference["time_ns"][:count])
    for name, tolerance in (
        ("joints", JOINT_TOLERANCE),
        ("positions", NODE_TOLERANCE),
        ("linear", LINEAR_TOLERANCE),
    ):
        apart = np.abs(found[name].astype(float) - reference[name][:count].astype(float))
        assert np.percentile(apart, 99) < tolerance, name
    assert np.abs(found["confidence"] - reference["confidence"][:count]).mean() < 0.1


def test_tracked_joints_match_the_truth(whole):
    """The joints are compared with the truth in the shipped recording, not with an earlier result."""
    from enliven_edge.assets import CHAIR

    truth = {frame.time_ns: frame.bodies[0].joints for frame in Recording(CHAIR).truth()}
    true = np.array([truth[int(t)] for t in whole["time_ns"]])
    error = np.linalg.norm(whole["joints"] - true, axis=2)
    assert error.mean() < 0.06
    assert np.percentile(error, 90) < 0.12


def test_the_chair_walks(whole):
    """The chair follows the performer, lifts its legs one by one, and does not tear."""
    positions = whole["positions"]
    feet = positions[0, :, 1] < 0.25
    lifted = positions[:, feet, 1].max(0) - positions[0, feet, 1]
    assert (lifted > 0.12).sum() >= 2
    assert np.ptp(positions.mean(1)[:, 0]) > 0.2
    stretch = np.linalg.norm(whole["linear"].astype(float), axis=(2, 3))
    assert np.percentile(stretch, 99) < 3.0


def test_film_contains_every_frame(road):
    with av.open(str(road / "enliven.mp4")) as film:
        stream = film.streams.video[0]
        count = sum(1 for _ in film.decode(stream))
        assert (stream.codec_context.width, stream.codec_context.height) == (WIDE, HIGH)
    assert abs(count - SHOWN * 30) <= 6


def test_picture_matches_the_reference(road, request):
    """The contact sheet is blurred and compared channel by channel."""
    sheet = Image.open(road / "enliven.png").convert("RGB")
    small = sheet.resize((sheet.width // 4, sheet.height // 4), Image.Resampling.BOX)
    if request.config.getoption("--record-references"):
        small.save(PICTURE, optimize=True)
        pytest.skip("stored the picture again")
    reference = np.asarray(Image.open(PICTURE).convert("RGB"), float)
    assert np.asarray(small).shape == reference.shape
    assert np.abs(np.asarray(small, float) - reference).mean() < PICTURE_TOLERANCE
    assert np.asarray(small, float).std() > 10, "the picture is empty"


@pytest.mark.skipif(os.name == "nt", reason="process groups of POSIX")
def test_ctrl_c_leaves_no_orphan(tmp_path):
    started, children = started_run(tmp_path)
    os.killpg(started.pid, signal.SIGINT)
    output, _ = started.communicate(timeout=TIMEOUT_S)
    assert started.returncode == 130, output.decode()
    assert b"Traceback" not in output, output.decode()
    assert not any(is_alive(child) for child in children)


@pytest.mark.skipif(os.name == "nt", reason="process groups of POSIX")
@pytest.mark.parametrize("while_it", ["imports", "starts its programs"])
def test_ctrl_c_in_the_first_second_prints_no_traceback(tmp_path, while_it):
    """The import log shows when modules of enliven are imported."""
    command = [sys.executable, "-X", "importtime", "-m", "enliven", "run", "--film", "--out", str(tmp_path)]
    hearing = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with (tmp_path / "said.txt").open("w+") as output:
        started = subprocess.Popen(
            command, stdout=output, stderr=output, start_new_session=True, preexec_fn=hearing
        )
        if while_it == "imports":
            wait_until(lambda: "enliven.errors" in (tmp_path / "said.txt").read_text(), "an import")
        else:
            wait_until(lambda: children_of(started.pid), "a child")
        os.killpg(started.pid, signal.SIGINT)
        assert started.wait(timeout=TIMEOUT_S) == 130
    assert "Traceback" not in (tmp_path / "said.txt").read_text()


def test_ctrl_c_within_a_text_that_is_executed_ends_with_130(tmp_path):
    """Ctrl-C may arrive in ``exec``, for example while a dataclass is created. Python would then end by the
    signal, although the program catches it.
    """
    broken = "import enliven.cli, enliven.__main__ as start\n"
    broken += "enliven.cli.main = lambda: exec('raise KeyboardInterrupt')\nstart.main()"
    (tmp_path / "broken.py").write_text(broken)
    command = [sys.executable, "-m", "broken"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (130, "")


@pytest.mark.skipif(os.name == "nt", reason="a parent's end is seen on POSIX only")
@pytest.mark.slow
def test_children_of_a_killed_run_end_by_themselves(tmp_path):
    started, children = started_run(tmp_path)
    started.kill()
    wait_until(lambda: not any(is_alive(child) for child in children), "the end of both programs")
    started.communicate(timeout=TIMEOUT_S)


def holds_poses(take: Path) -> bool:
    """Returns True if an unfinished take has poses on disk."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return "pose" in Recording(take).info.topics
    except EnlivenError:
        return False


def started_run(folder: Path) -> tuple[subprocess.Popen, list[int]]:
    """Starts an endless run of the main job in its own process group, and waits until both programs work."""
    take = folder / "take.mcap"
    command = [sys.executable, "-m", "enliven", "run", "--film", "--out", str(folder), "--record", str(take)]
    command += ["--sensor", "synthetic", "--seconds", "3600", "--size", "160x90"]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "start_new_session": True}
    # Shells make background processes ignore Ctrl-C, and this process would inherit that.
    options["preexec_fn"] = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    started = subprocess.Popen(command, **options)
    # The edge waits for its viewer, so recorded poses show that both are running.
    wait_until(lambda: holds_poses(take), "a recorded take", patience=180)
    children = children_of(started.pid)
    assert len(children) == 2, "the programs did not start"
    return started, children


def is_alive(process: int) -> bool:
    """Returns True if a process exists and is not a zombie."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(process)], capture_output=True, text=True).stdout
    return bool(state.strip()) and not state.startswith("Z")


def children_of(parent: int) -> list[int]:
    """Returns the process ids with this parent (Linux; elsewhere by ps)."""
    listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True).stdout
    pairs = (line.split() for line in listed.splitlines())
    return [int(pid) for pid, ppid in pairs if int(ppid) == parent]
