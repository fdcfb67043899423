"""Tests that the C++ sample of integrations/cpp reads the same live poses as a viewer in Python."""

from __future__ import annotations

import contextlib
import itertools
import shutil
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from patience import wait_until
from published_stage import PublishedStage

from enliven.document import Character, Pose
from enliven.wire import POSE, PoseCodec, free_ports
from enliven_viewer.link.edge_client import EdgeClient

HOUSE = Path(__file__).parents[2]
FOLDER = HOUSE / "integrations" / "cpp"
sys.path.insert(0, str(HOUSE / "scripts"))

import web_vectors  # noqa: E402

pytestmark = pytest.mark.slow
COMPILER = shutil.which("g++")
PACKAGES = "g++ libzmq3-dev cppzmq-dev libmsgpack-cxx-dev"
Numbers = dict[tuple[str, int], np.ndarray]
"""(J, 12) position and matrix of each transform, by the name of the character and the number of the pose."""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compiles the sample."""
    headers = "#define MSGPACK_NO_BOOST\n#include <msgpack.hpp>\n#include <zmq.hpp>\n"
    if COMPILER is None:
        pytest.skip(f"no C++ compiler: apt install {PACKAGES}")
    if compile_cpp("-fsyntax-only", "-x", "c++", "-", input=headers).returncode:
        pytest.skip(f"the headers of ZeroMQ or MessagePack are missing: apt install {PACKAGES}")
    path = tmp_path_factory.mktemp("cpp") / "read_poses"
    warnings = "-Wall", "-Wextra", "-Werror"
    result = compile_cpp(*warnings, "-ffp-contract=off", "-O1", "read_poses.cpp", "-o", str(path), "-lzmq")
    assert result.returncode == 0, result.stderr
    return path


def compile_cpp(*words: str, input: str | None = None) -> subprocess.CompletedProcess[str]:
    command = [str(COMPILER), "-std=c++17", *words]
    return subprocess.run(command, cwd=FOLDER, capture_output=True, text=True, input=input, timeout=300)


def make_scenes() -> dict[str, tuple[Character, list[Pose]]]:
    """Returns a character of each kind with three poses each. One character has joint names."""
    rng = np.random.default_rng(11)
    characters = [web_vectors.make_character(kind, rng) for kind in web_vectors.KINDS]
    names = tuple(f"joint {j}" for j in range(len(characters[1].pivots)))
    characters[1] = replace(characters[1], names=names)
    return {c.id: (c, list(web_vectors.make_poses(c, rng))) for c in characters}


@contextlib.contextmanager
def running(
    program: Path, ports: tuple[int, int], count: int, output: Path
) -> Iterator[subprocess.Popen[bytes]]:
    """Yields the sample, which writes ``count`` poses to a file and ends."""
    words = ["127.0.0.1", str(count), *map(str, ports)]
    with output.open("wb") as file, subprocess.Popen([program, *words], stdout=file) as process:
        try:
            yield process
        finally:
            process.kill()


def read_output(path: Path) -> tuple[Numbers, dict[str, list[str]]]:
    """Returns the printed numbers, and the names of each character's joints."""
    numbers, names = Numbers(), dict[str, list[str]]()
    lines = iter(path.read_text().splitlines())
    for line in lines:
        word, sequence, count, name = line.split(" ", 3)
        rows = [row.split(" ", 12) for row in itertools.islice(lines, int(count))]
        assert word == "pose"
        numbers[name, int(sequence)] = np.array([row[:12] for row in rows], float)
        names[name] = [row[12] for row in rows]
    return numbers, names


def last_complete_pose(path: Path) -> np.ndarray:
    """Returns the numbers of the newest complete pose. A pose is complete if another one follows it."""
    text = path.read_text()
    rows = text[: text.rindex("pose ")].rpartition("pose ")[2].splitlines()[1:]
    return np.array([row.split(" ")[:12] for row in rows], float)


def read_in_python(
    stage: PublishedStage, scenes: Mapping[str, Sequence[Pose]], is_done: Callable[[], bool]
) -> Numbers:
    """Returns the numbers that a viewer receives. Poses change until a condition is true."""
    numbers, turns = Numbers(), itertools.count()
    client = EdgeClient([stage.address], "python")

    def poll() -> bool:
        number = next(turns)
        stage.poses = {
            name: (stage.poses[name][0], poses[number // 10 % len(poses)]) for name, poses in scenes.items()
        }
        client.poll()
        for received in client.take(POSE):
            pose = received.pose
            rows = np.concatenate([pose.positions, pose.linear.reshape(-1, 9)], 1)
            numbers[pose.character, received.sequence] = rows
        return is_done()

    with contextlib.closing(client):
        wait_until(poll, "the end of the sample")
    return numbers


def test_sample_prints_the_numbers_of_a_viewer(program: Path, tmp_path: Path) -> None:
    scenes = make_scenes()
    first = {name: (character, poses[0]) for name, (character, poses) in scenes.items()}
    with (
        PublishedStage(f"cpp-{uuid.uuid4().hex[:8]}", first) as stage,
        running(program, stage.ports, 120, tmp_path / "poses") as process,
    ):
        poses = {name: poses for name, (_, poses) in scenes.items()}
        expected = read_in_python(stage, poses, lambda: process.poll() is not None)
        assert process.returncode == 0
    printed, names = read_output(tmp_path / "poses")
    assert len(printed) == 120
    common = printed.keys() & expected.keys()
    for key in common:
        scale = 1 + np.abs(expected[key]).max()
        np.testing.assert_allclose(printed[key], expected[key], rtol=0, atol=1e-6 * scale)
    for name, (character, _) in scenes.items():
        different = {expected[key].tobytes() for key in common if key[0] == name}
        assert len(different) == 3, "each pose was compared"
        assert names[name] == list(character.names or [""] * len(character.pivots))


def test_sample_waits_for_an_edge_and_survives_its_restart(program: Path, tmp_path: Path) -> None:
    output, ports = tmp_path / "poses", free_ports()
    with running(program, (ports[0], ports[1]), 10**6, output) as process:
        for character, poses in [*make_scenes().values()][:2]:
            # Both edges use the same revision number and character name, but the characters differ.
            shown = replace(character, id="actor"), replace(poses[2], character="actor")
            edge = PublishedStage(f"cpp-{uuid.uuid4().hex[:8]}", {"actor": shown}, ports=(ports[0], ports[1]))
            with edge:
                before = output.stat().st_size
                wait_until(lambda before=before: output.read_bytes()[before:].count(b"pose ") > 3, "a pose")
            codec = PoseCodec(shown[0])
            linear, positions = codec.decode(codec.encode(shown[1]).data)
            expected = np.concatenate([positions, linear.reshape(-1, 9)], 1)
            printed = last_complete_pose(output)
            np.testing.assert_allclose(printed, expected, rtol=1e-5, atol=1e-5)
        assert process.poll() is None


def test_sample_is_short() -> None:
    assert len((FOLDER / "read_poses.cpp").read_text().splitlines()) < 100
