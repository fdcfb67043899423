"""Tests that a failing memory card, a lost network drive and a full disk are reported with path and
advice.
"""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import enliven_edge.assets
from enliven.errors import InputError, ResourceError
from enliven.files import open_file, read_file
from enliven.recording import Recording, RecordingWarning, recover

CHAIR = Path(enliven_edge.assets.__file__).with_name("chair.mcap")
SOURCE = Path(__file__).parents[1] / "helpers" / "fault_hook.c"


@pytest.fixture(scope="session")
def hook(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not sys.platform.startswith("linux") or compiler is None:
        pytest.skip("the hook needs Linux and a C compiler")
    library = tmp_path_factory.mktemp("hook") / "fault_hook.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, SOURCE, "-ldl"], check=True)
    return library


def run(hook: Path, path: Path, number: int, first: int, *words: str | Path) -> tuple[int, str]:
    """Runs enliven while reads of a file fail from byte ``first`` on. Returns the exit code and the
    messages.
    """
    faults = {"FAULT_READ": path.name, "FAULT_FROM": str(first), "FAULT_ERRNO": str(number)}
    command = [sys.executable, "-m", "enliven", *map(str, words)]
    shown = subprocess.run(
        command,
        env={**os.environ, **faults, "LD_PRELOAD": str(hook)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    return shown.returncode, shown.stdout + shown.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("take.mcap", ["track", "FILE", "-o", "OUT.mcap"]),
        ("take.mcap", ["edge", "--recording", "FILE", "--port", "0", "--speed", "0", "--name", "faults"]),
        ("take.mcap", ["import", "FILE", "-o", "OUT.mcap"]),
        ("shape.obj", ["graph", "FILE", "-o", "OUT.png"]),
        ("shape.glb", ["graph", "FILE", "-o", "OUT.png"]),
        ("walk.bvh", ["import", "FILE", "-o", "OUT.mcap"]),
        ("image.png", ["track", "FILE", "-o", "OUT.mcap"]),
    ],
)
def test_a_device_that_fails_is_named(hook, tmp_path, name, words) -> None:
    number, advice = (errno.ESTALE, "network drive") if name == "shape.obj" else (errno.EIO, "may be failing")
    path = tmp_path / name
    shutil.copyfile(CHAIR, path)
    first = path.stat().st_size // 2 if name == "take.mcap" else 0
    filled = [word.replace("FILE", str(path)).replace("OUT", str(tmp_path / "out")) for word in words]
    code, output = run(hook, path, number, first, *filled)
    assert code == 4, output
    assert name in output and advice in output and os.strerror(number) in output
    assert "fault of enliven" not in output and "Error:" not in output


def test_readable_part_of_a_failing_card_is_recovered(hook, tmp_path) -> None:
    path, saved = tmp_path / "take.mcap", tmp_path / "saved.mcap"
    shutil.copyfile(CHAIR, path)
    code, output = run(hook, path, errno.EIO, path.stat().st_size // 2, "recover", path, "-o", saved)
    assert code == 0, output
    whole, kept = (
        sum(topic.count for topic in Recording(file).info.topics.values()) for file in (CHAIR, saved)
    )
    assert 0.2 * whole < kept < 0.7 * whole


def test_recovery_finds_chunks_across_blocks(tmp_path, monkeypatch) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(CHAIR.read_bytes()[:-100])
    with pytest.warns(RecordingWarning):
        count = sum(topic.count for topic in Recording(path).info.topics.values())
    monkeypatch.setattr("enliven.recording.recovery._BLOCK_BYTES", 1009)
    assert sum(recover(path, tmp_path / "saved.mcap").kept.values()) == count


def test_reads_name_the_file_and_not_its_descriptor(tmp_path) -> None:
    (tmp_path / "a.txt").write_text("text")
    with open_file(tmp_path / "a.txt") as file:
        assert file.name == str(tmp_path / "a.txt") and file.read() == b"text"


def test_error_of_a_decompression_bomb_names_the_file(monkeypatch) -> None:
    """The error names the file, not its descriptor ("3")."""
    monkeypatch.setattr("enliven.recording.chunks._MAX_COMPRESSION_RATIO", 0)
    monkeypatch.setattr("enliven.recording.chunks._MIN_CHUNK_BYTE_LIMIT", 10)
    with pytest.raises(InputError, match=rf"^{CHAIR}, byte \d+: a part of \d+ bytes states"):
        list(Recording(CHAIR).frames())


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file with a real input/output error")
def test_a_real_input_output_error_is_reported() -> None:
    with pytest.raises(ResourceError, match=r"/proc/self/mem: .*Input/output error.*may be failing"):
        Recording("/proc/self/mem")


def test_a_file_that_may_not_be_read_gives_advice(tmp_path, monkeypatch) -> None:
    def refuse(*_):
        raise PermissionError(errno.EACCES, "Permission denied")

    (tmp_path / "mesh.obj").write_text("v 0 0 0")
    monkeypatch.setattr("enliven.files.reading.os.open", refuse)
    with pytest.raises(InputError, match=r"mesh\.obj: .*Permission denied.*permissions"):
        read_file(tmp_path / "mesh.obj")
