"""Tests of compiled kernels on disk: never outdated, shared by checkouts, and robust to damage and a full
disk.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

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


def write_checkout(folder: Path, called: str = "x * 2.0", step: float = 10.0, limit: str = "") -> None:
    (folder / "called.py").write_text(CALLED.format(called=called, step=step))
    (folder / "caller.py").write_text(CALLER.format(limit=limit))


def run_caller(folder: Path, **environment: str) -> tuple[float, int]:
    """Returns the kernel's value in a separate process, and the number of times that its code was read from
    the disk.
    """
    command = [sys.executable, "-B", "caller.py"]
    own = {"XDG_CACHE_HOME": str(folder.parent / "cache")} | environment
    words = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"} | own
    done = subprocess.run(command, cwd=folder, env=words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.fixture
def checkout(tmp_path) -> Path:
    """Returns a folder with two source files, as in a checkout. The user's cache folder is next to it."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    write_checkout(folder)
    return folder


def kernels_of(checkout: Path) -> list[Path]:
    """Returns the files in the user's cache folder."""
    return sorted((checkout.parent / "cache" / "enliven" / "kernels").glob("*.kernel"))


@pytest.mark.slow
def test_machine_code_is_kept_until_its_code_changes(checkout):
    assert run_caller(checkout) == (12.0, 0)
    assert run_caller(checkout) == (12.0, 1), "it was kept"
    write_checkout(checkout, called="x * 3.0")
    assert run_caller(checkout) == (13.0, 0), "a kernel that it calls, in another file, has changed"
    write_checkout(checkout, called="x * 3.0", step=20.0)
    assert run_caller(checkout) == (23.0, 0), "a constant that it imports has changed"
    write_checkout(checkout)
    assert run_caller(checkout) == (12.0, 1), "the code of the first run is back, so nothing is compiled"


def test_words_and_moved_lines_compile_nothing(checkout):
    assert run_caller(checkout) == (12.0, 0)
    for path in checkout.glob("*.py"):
        text = path.read_text().replace("(x):\n", '(x):\n    """A docstring."""\n    # A comment.\n')
        path.write_text('"""Words of the module."""\n\n\n' + text)
    assert "A comment." in (checkout / "called.py").read_text()
    assert run_caller(checkout) == (12.0, 1)


@pytest.mark.slow
def test_another_checkout_finds_compiled_kernels(checkout):
    assert run_caller(checkout) == (12.0, 0)
    other = checkout.with_name("other")
    other.mkdir()
    write_checkout(other)
    assert run_caller(other) == (12.0, 1)
    given = checkout.parent / "given"
    assert run_caller(other, NUMBA_CACHE_DIR=str(given)) == (12.0, 0), "a named folder is the only one"
    assert len(list(given.glob("*.kernel"))) == len(kernels_of(checkout)) == 1, (
        "a callee is part of its kernel"
    )
    shutil.rmtree(checkout.parent / "cache")
    assert run_caller(other) == (12.0, 0), "nothing is kept anywhere else"
    assert not list(checkout.rglob("*.n*"))


@pytest.mark.slow
def test_kernels_of_an_installed_release_are_found_first(checkout):
    assert run_caller(checkout) == (12.0, 0)
    shipped = checkout.parent / "site" / "enliven_kernels"
    shutil.copytree(kernels_of(checkout)[0].parent, shipped / "kernels")
    (shipped / "__init__.py").touch()
    shutil.rmtree(checkout.parent / "cache")
    assert run_caller(checkout, PYTHONPATH=str(shipped.parent)) == (12.0, 1)
    assert not kernels_of(checkout), "nothing was compiled, so nothing was written"
    write_checkout(checkout, called="x * 3.0")
    assert run_caller(checkout, PYTHONPATH=str(shipped.parent)) == (13.0, 0), "the release has other code"


@pytest.mark.slow
def test_a_damaged_file_is_compiled_again(checkout):
    assert run_caller(checkout) == (12.0, 0)
    for path in kernels_of(checkout):
        path.write_bytes(path.read_bytes()[:-20])
    assert run_caller(checkout) == (12.0, 0), "a power cut leaves such files"
    for path in kernels_of(checkout):
        damaged = bytearray(path.read_bytes())
        damaged[len(damaged) // 2] ^= 1
        path.write_bytes(damaged)
    assert run_caller(checkout) == (12.0, 0), "one wrong bit is found, and not run as machine code"
    for path in kernels_of(checkout):
        path.write_bytes(b"no pickle")
    assert run_caller(checkout) == (12.0, 0)
    assert run_caller(checkout) == (12.0, 1)


@pytest.mark.parametrize(
    ("read", "given"), [("pair", "Pair(1.0, 2.0)"), ("pair.values", "hold(Pair(1.0, 2.0))")]
)
@pytest.mark.slow
def test_fields_that_change_places_in_a_named_tuple_are_other_code(tmp_path, read, given):
    """A kernel reads fields by position, and its own file does not name their order."""
    for fields, expected in (("a b", (1.0, 0)), ("b a", (2.0, 0)), ("a b", (1.0, 1))):
        (tmp_path / "pair.py").write_text(
            f"from collections import namedtuple\n\nPair = namedtuple('Pair', '{fields}')\n"
        )
        (tmp_path / "kernel.py").write_text(READS.format(read=read))
        (tmp_path / "caller.py").write_text(GIVES.format(given=given))
        assert run_caller(tmp_path) == expected


def load_store() -> ModuleType:
    """Returns the module ``store`` as a new process loads it."""
    spec = importlib.util.find_spec("enliven.kernel_cache.store")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_files_that_no_start_asked_for_in_months_are_deleted(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    first = load_store()
    for name in ("old.kernel", "used.kernel", "of_0.1.nbi"):
        first.save_kernel(name, "code")
        os.utime(tmp_path / name, (0.0, 0.0))
    second = load_store()
    assert second.load_kernel("used.kernel") == "code"
    second.save_kernel("new.kernel", "code")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.kernel", "used.kernel"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
def test_a_full_disk_and_folders_that_cannot_be_written_cost_a_compilation(checkout):
    write_checkout(checkout, limit=LIMIT)
    assert run_caller(checkout) == (12.0, 0)
    kept = [path.name for path in (checkout.parent / "cache" / "enliven" / "kernels").iterdir()]
    assert kept == ["compile.lock"], "nothing but the empty lock file could be kept"
    write_checkout(checkout)
    assert run_caller(checkout, XDG_CACHE_HOME=str(checkout / "called.py")) == (12.0, 0)
