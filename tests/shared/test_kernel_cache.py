"""Compiled kernels on disk: never stale, and neither damage nor a full disk stops a program."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CALLED = """
from enliven.kernels import njit

STEP = {step}


@njit(cache=True)
def called(x):
    return {called}
"""

CALLER = """
import sys

{limit}
from called import STEP, called
from enliven.kernels import njit


@njit(cache=True)
def kernel(x):
    return called(x) + STEP


if __name__ == "__main__":
    import caller

    print(caller.kernel(1.0), sum(caller.kernel.stats.cache_hits.values()))
"""

LIMIT = """
import resource, signal

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
"""


def written(folder: Path, called: str = "x * 2.0", step: float = 10.0, limit: str = "") -> None:
    (folder / "called.py").write_text(CALLED.format(called=called, step=step))
    (folder / "caller.py").write_text(CALLER.format(limit=limit))


def said(folder: Path, **environment: str) -> tuple[float, int]:
    """What the kernel returns in a process of its own, and how often its code came from the disk."""
    command = [sys.executable, "-B", "caller.py"]
    words = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"} | environment
    done = subprocess.run(command, cwd=folder, env=words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_machine_code_is_kept_until_something_in_it_changes(tmp_path):
    written(tmp_path)
    assert said(tmp_path) == (12.0, 0)
    assert said(tmp_path) == (12.0, 1), "it was kept"
    written(tmp_path, called="x * 3.0")
    assert said(tmp_path) == (13.0, 0), "what it calls, in another file, has changed"
    written(tmp_path, called="x * 3.0", step=20.0)
    assert said(tmp_path) == (23.0, 0), "a constant that it imports has changed"


def test_a_damaged_cache_is_written_anew(tmp_path):
    written(tmp_path)
    assert said(tmp_path) == (12.0, 0)
    for path in tmp_path.rglob("*.nbi"):
        path.write_bytes(path.read_bytes()[:20])
    assert said(tmp_path) == (12.0, 0), "as a power cut leaves it"
    for path in tmp_path.rglob("*.nbc"):
        path.write_bytes(b"no pickle")
    assert said(tmp_path) == (12.0, 0)
    assert said(tmp_path) == (12.0, 1)


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
def test_a_full_disk_and_folders_that_cannot_be_written_cost_a_compilation(tmp_path):
    written(tmp_path, limit=LIMIT)
    assert said(tmp_path) == (12.0, 0)
    assert not list(tmp_path.rglob("*.nb*")), "nothing could be kept"
    written(tmp_path)
    (tmp_path / "__pycache__").rmdir()
    (tmp_path / "__pycache__").write_text("in the way")
    assert said(tmp_path, XDG_CACHE_HOME=str(tmp_path / "called.py")) == (12.0, 0)
