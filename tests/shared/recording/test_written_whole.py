"""Tests of films, images and recordings: a failed write keeps the old file, a good one keeps mode and
link.
"""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enliven.camera import Intrinsics
from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.files import write_picture
from enliven.film.writer import FilmWriter
from enliven.frames import DepthFrame
from enliven.recording import Recorder, Recording

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="limits and modes are Unix's")
PICTURE = np.random.default_rng(1).integers(0, 255, (240, 320, 3), np.uint8)


def write_film(path: Path) -> None:
    with FilmWriter(path, None, 25.0, 8.0) as film:
        for shift in range(12):
            film.add(np.roll(PICTURE, 7 * shift, 1))


def write_png(path: Path) -> None:
    write_picture(path, Image.fromarray(PICTURE))


def record(path: Path) -> None:
    lens = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
    with Recorder(path, overwrite=True) as recorder:
        for frame in range(5):
            recorder.write_frame(DepthFrame(np.full((48, 64), 900, np.uint16), lens, frame * 10**8, "tof"))


WRITERS = {"a.mp4": write_film, "a.png": write_png, "a.mcap": record}


def bounded(size: int, act: Callable[[], None]) -> type[BaseException] | None:
    """Runs a function in a child process with a maximum file size. Returns its exit code."""
    import resource
    import signal

    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        code = 1
        try:
            act()
            code = 0
        except EnlivenError:
            code = 7
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return {0: None, 7: EnlivenError}.get(code, Exception)


@pytest.mark.parametrize("name", list(WRITERS))
def test_full_disk_keeps_the_existing_file(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"before" * 5000)
    assert bounded(40, lambda: WRITERS[name](path)) is EnlivenError
    assert path.read_bytes() == b"before" * 5000
    assert os.listdir(tmp_path) == [name], "nothing unfinished is left"


@pytest.mark.parametrize("name", list(WRITERS))
def test_mode_and_link_are_kept(name: str, tmp_path: Path) -> None:
    real, path = tmp_path / f"real-{name}", tmp_path / name
    real.write_bytes(b"before")
    real.chmod(0o640)
    path.symlink_to(real.name)
    WRITERS[name](path)
    assert path.is_symlink() and real.read_bytes()[:6] != b"before"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert sorted(os.listdir(tmp_path)) == sorted([name, real.name])
    if name == "a.mcap":
        assert len(list(Recording(path).frames())) == 5


def test_an_error_while_filming_leaves_the_older_film(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(b"before")
    with pytest.raises(InputError), FilmWriter(path, None, 25.0, 8.0) as film:
        film.add(PICTURE)
        raise InputError("bad", where="pose")
    assert path.read_bytes() == b"before"
    with FilmWriter(path, None, 25.0, 8.0):
        pass  # no image
    assert path.read_bytes() == b"before" and os.listdir(tmp_path) == ["a.mp4"]


def test_ctrl_c_completes_a_film(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with pytest.raises(KeyboardInterrupt), FilmWriter(path, None, 25.0, 8.0) as film:
        film.add(PICTURE)
        raise KeyboardInterrupt
    assert path.read_bytes()[4:8] == b"ftyp"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    for name, write in WRITERS.items():
        with pytest.raises((ResourceError, InputError)) as caught:
            write(tmp_path / "file" / name)
        assert str(tmp_path / "file") in caught.value.where


def test_an_unknown_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be written to \.xyz files"):
        write_picture(tmp_path / "a.xyz", Image.fromarray(PICTURE))
