"""Compiled kernels on disk: never stale, and neither damage nor a full disk stops a program."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from enliven import kernel_cache

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

READS = """
from enliven.kernels import njit


@njit(cache=True)
def kernel(pair):
    return {read}.a
"""

GIVES = """
from enliven.kernels import hold
from kernel import kernel
from pair import Pair

print(kernel({given}), sum(kernel.stats.cache_hits.values()))
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
    apart = {"XDG_CACHE_HOME": str(folder.parent / "cache")} | environment
    words = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"} | apart
    done = subprocess.run(command, cwd=folder, env=words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.fixture
def checkout(tmp_path) -> Path:
    """A folder with the two files, as one checkout has them; the user's caches are beside it."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    written(folder)
    return folder


def test_machine_code_is_kept_until_something_in_it_changes(checkout):
    assert said(checkout) == (12.0, 0)
    assert said(checkout) == (12.0, 1), "it was kept"
    written(checkout, called="x * 3.0")
    assert said(checkout) == (13.0, 0), "what it calls, in another file, has changed"
    written(checkout, called="x * 3.0", step=20.0)
    assert said(checkout) == (23.0, 0), "a constant that it imports has changed"
    written(checkout)
    assert said(checkout) == (12.0, 1), "it is again as it was at first, so nothing is compiled"


def test_another_checkout_finds_what_one_compiled_and_keeps_it(checkout):
    assert said(checkout) == (12.0, 0)
    other = checkout.with_name("other")
    other.mkdir()
    written(other)
    assert said(other) == (12.0, 1)
    shutil.rmtree(checkout.parent / "cache")
    assert said(other) == (12.0, 1), "it lies beside the source now"
    third = checkout.with_name("third")
    third.mkdir()
    written(third)
    assert said(third) == (12.0, 0), "no cache, nothing found"
    fourth = checkout.with_name("fourth")
    fourth.mkdir()
    written(fourth)
    assert said(fourth, NUMBA_CACHE_DIR=str(checkout.parent / "numba")) == (12.0, 0), "a folder was given"


def test_a_damaged_cache_is_written_anew(checkout):
    kept = checkout.parent
    assert said(checkout) == (12.0, 0)
    for path in kept.rglob("*.nbi"):
        path.write_bytes(path.read_bytes()[:20])
    assert said(checkout) == (12.0, 0), "as a power cut leaves it"
    for path in kept.rglob("*.nbc"):
        path.write_bytes(b"no pickle")
    assert said(checkout) == (12.0, 0)
    assert said(checkout) == (12.0, 1)


@pytest.mark.parametrize(
    ("read", "given"), [("pair", "Pair(1.0, 2.0)"), ("pair.values", "hold(Pair(1.0, 2.0))")]
)
def test_fields_of_a_named_tuple_that_change_their_places_make_other_code(tmp_path, read, given):
    """A kernel reads fields by their place, and its own file does not say which is where."""
    for fields, expected in (("a b", (1.0, 0)), ("b a", (2.0, 0)), ("a b", (1.0, 1))):
        (tmp_path / "pair.py").write_text(
            f"from collections import namedtuple\n\nPair = namedtuple('Pair', '{fields}')\n"
        )
        (tmp_path / "kernel.py").write_text(READS.format(read=read))
        (tmp_path / "caller.py").write_text(GIVES.format(given=given))
        assert said(tmp_path) == expected


def test_machine_code_that_no_checkout_asked_for_in_months_is_deleted(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    kernel_cache._folder.cache_clear()
    try:
        shelves = [kernel_cache._Shelf.of(name, "stamp") for name in ("old", "used", "new")]
        for shelf in shelves:
            shelf.make()
            shelf.save("key", "code")
        folder = tmp_path / "enliven" / "kernels"
        for name in ("old", "used"):
            os.utime(folder / f"{name}.nbi", (0.0, 0.0))
        assert shelves[1].load("key") == "code"
        kernel_cache._clear.cache_clear()
        shelves[2].make()
        assert sorted(path.name for path in folder.iterdir()) == [
            "new.1.nbc", "new.nbi", "used.1.nbc", "used.nbi",
        ]  # fmt: skip
    finally:
        kernel_cache._folder.cache_clear()


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
def test_a_full_disk_and_folders_that_cannot_be_written_cost_a_compilation(checkout):
    written(checkout, limit=LIMIT)
    assert said(checkout) == (12.0, 0)
    assert not list(checkout.parent.rglob("*.nb*")), "nothing could be kept"
    written(checkout)
    (checkout / "__pycache__").rmdir()
    (checkout / "__pycache__").write_text("in the way")
    assert said(checkout, XDG_CACHE_HOME=str(checkout / "called.py")) == (12.0, 0)
