"""Tests that our files are replaced atomically: complete, or unchanged."""

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.batch.plan import BatchPlan, plan_jobs
from enliven.document.example_settings import ExampleSettings
from enliven.errors import InputError, ResourceError
from enliven.files import read_file, replace_file, write_file
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project
from enliven.meshes.files import load_mesh
from enliven.settings import load_settings

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has other permissions")

contents = st.binary(max_size=50) | st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@given(st.lists(st.tuples(contents, st.sampled_from(["", "open", "fsync", "replace"])), max_size=6))
def test_file_is_replaced_atomically(tmp_path_factory, steps):
    """Whichever of its steps fails, and nothing else is left in its folder."""
    path = tmp_path_factory.mktemp("whole") / "new" / "a.toml"
    before = None
    for data, fails in steps:
        with pytest.MonkeyPatch.context() as patch:
            if fails == "open":
                patch.setattr(os, "open", full)
            elif fails:
                patch.setattr(os, fails, full)
            if not fails:
                write_file(path, data)
                before = data.encode() if isinstance(data, str) else data
            else:
                with pytest.raises(
                    ResourceError, match=r"cannot be written \(No space left.*another disk\.$"
                ):
                    write_file(path, data)
        left = list(path.parent.iterdir()) if path.parent.exists() else []
        assert left == ([] if before is None else [path])
        assert before is None or read_file(path) == before


def full(*_):
    raise OSError(28, "No space left on device")


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644, 0o664, 0o400, 0o755])
def test_saving_keeps_the_mode_and_a_new_file_gets_the_usual_one(tmp_path, mode):
    path, usual = tmp_path / "a.enliven", tmp_path / "new"
    path.write_bytes(b"before")
    path.chmod(mode)
    write_file(path, b"after")
    assert stat.S_IMODE(path.stat().st_mode) == mode and path.read_bytes() == b"after"
    write_file(usual, b"after")
    (tmp_path / "plain").touch()
    assert usual.stat().st_mode == (tmp_path / "plain").stat().st_mode


@posix
@pytest.mark.parametrize("relative", [True, False])
def test_saving_keeps_a_symbolic_link_and_the_mode_of_its_file(tmp_path, relative):
    (tmp_path / "disk").mkdir()
    real, near, link = tmp_path / "disk" / "real.enliven", tmp_path / "near", tmp_path / "link.enliven"
    real.write_bytes(b"before")
    real.chmod(0o600)
    near.symlink_to(Path("disk") / real.name if relative else real)
    link.symlink_to(near)
    write_file(link, b"after")
    assert link.is_symlink() and near.is_symlink() and link.readlink() == near
    assert real.read_bytes() == b"after" and stat.S_IMODE(real.stat().st_mode) == 0o600
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "disk",
        "link.enliven",
        "near",
        "real.enliven",
    ]


@posix
def test_a_link_to_nothing_is_followed_and_one_to_itself_is_refused(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "later")
    write_file(tmp_path / "link", b"x")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "later").read_bytes() == b"x"
    (tmp_path / "ring").symlink_to(tmp_path / "ring")
    with pytest.raises(ResourceError, match="cannot be written"):
        write_file(tmp_path / "ring", b"x")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs the rights of root")
def test_saving_keeps_the_owner(tmp_path):
    path = tmp_path / "a.enliven"
    path.write_bytes(b"before")
    os.chown(path, 1234, 1235)
    write_file(path, b"after")
    assert (path.stat().st_uid, path.stat().st_gid) == (1234, 1235) and path.read_bytes() == b"after"


SOMEBODY = """
import os
from pathlib import Path
from enliven.errors import InputError, ResourceError
from enliven.files import write_file
os.setgid(1235)
os.setuid(1235)
try:
    write_file(Path("a.enliven"), b"after, and longer than before")
except ResourceError as error:
    print(error.what)
"""


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs the rights of root")
@pytest.mark.parametrize("mode", [0o666, 0o644])
def test_a_file_of_another_user_keeps_its_owner_or_is_left_alone(tmp_path, mode):
    tmp_path.chmod(0o777)
    path = tmp_path / "a.enliven"
    path.write_bytes(b"before")
    path.chmod(mode)
    command = [sys.executable, "-c", SOMEBODY]  # in the folder, because parent folders are closed to others
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert not result.stderr and (path.stat().st_uid, stat.S_IMODE(path.stat().st_mode)) == (0, mode)
    if mode == 0o666:
        assert path.read_bytes() == b"after, and longer than before"
    else:
        assert path.read_bytes() == b"before" and "Permission denied" in result.stdout
    assert list(tmp_path.iterdir()) == [path]


@posix
def test_nobody_can_plant_the_file_that_is_written_first(tmp_path, monkeypatch):
    """A guessed name is skipped, both in the scheme of earlier versions and in the current one."""
    path, other = tmp_path / "a.enliven", tmp_path / "precious"
    other.write_bytes(b"precious")
    (tmp_path / ".a.enliven.part").symlink_to(other)
    names = iter(["guessed", "random"])
    monkeypatch.setattr("enliven.files.writing.secrets.token_hex", lambda _: next(names))
    (tmp_path / ".a.enliven.guessed.part").symlink_to(other)
    write_file(path, b"project")
    assert path.read_bytes() == b"project" and not path.is_symlink() and other.read_bytes() == b"precious"


@posix
def test_a_part_is_readable_by_nobody_else_while_a_private_file_is_written(tmp_path):
    path = tmp_path / "a.mcap"
    path.touch()
    path.chmod(0o600)
    with replace_file(path) as part:
        assert stat.S_IMODE(part.stat().st_mode) == 0o600 and part.parent == tmp_path
        part.write_bytes(b"new")
    assert path.read_bytes() == b"new" and list(tmp_path.iterdir()) == [path]


def test_failed_write_keeps_the_file_without_leftovers(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"before")
    with pytest.raises(KeyError), replace_file(path) as part:
        part.write_bytes(b"half")
        raise KeyError
    assert path.read_bytes() == b"before" and list(tmp_path.iterdir()) == [path]


def test_leftovers_of_killed_program_are_removed_after_a_day(tmp_path):
    old, fresh = tmp_path / ".a.toml.0123.part", tmp_path / ".a.toml.4567.part"
    for part in (old, fresh):
        part.touch()
    os.utime(old, (time.time() - 90_000,) * 2)
    write_file(tmp_path / "a.toml", "x")
    assert not old.exists() and fresh.exists()


@posix
def test_devices_and_folders_are_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_file(pipe, b"through")
    assert os.read(reader, 20) == b"through" and stat.S_ISFIFO(pipe.stat().st_mode)
    os.close(reader)
    for place in (tmp_path, pipe):
        with pytest.raises(ResourceError, match="cannot be written"), replace_file(place):
            pass


@pytest.mark.parametrize(
    "read",
    [
        lambda name: load_mesh(f"{name}.xyz"),
        lambda name: load_mesh(f"{name}.ply"),
        lambda name: read_gltf(Path(f"{name}.abc")),
        lambda name: read_project(Path(f"{name}.enliven")),
        lambda name: load_settings(ExampleSettings, Path(f"{name}.toml")),
        lambda name: plan_jobs(BatchPlan(motions=(f"{name}.bvh",), characters=(f"{name}.glb",))),
    ],
    ids=["unknown mesh", "mesh", "glTF", "project", "settings", "batch"],
)
def test_every_reader_refuses_a_name_that_is_too_long(read):
    with pytest.raises(InputError):
        read("x" * 300)
