"""Tests that concurrent processes compile a kernel once, and that no process waits without end."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from enliven.kernel_cache import compile_lock
from enliven.kernel_cache.compile_lock import CompileLock

CALLER = """
import sys

from kernel import kernel

print("ready", flush=True)
sys.stdin.readline()
print(kernel(1.0), sum(kernel.stats.cache_hits.values()))
"""
KERNEL = """
from enliven.kernels import njit


@njit(cache=True)
def kernel(x):
    {slow_to_compile}
    return x
"""
HOLDER = """
import sys
from pathlib import Path

from enliven.kernel_cache.compile_lock import CompileLock

CompileLock().acquire(Path(sys.argv[1]), "a.kernel")
print("locked", flush=True)
sys.stdin.read()
"""


def start(code: str, *arguments: str, **options) -> subprocess.Popen[str]:
    """Starts Python code that prints a line when it is ready, and waits for the line."""
    command = [sys.executable, "-B", "-c", code, *arguments]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)
    assert process.stdout is not None and process.stdout.readline()
    return process


@contextmanager
def holder(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Starts a process that locks the kernel ``a.kernel`` of a folder."""
    process = start(HOLDER, str(folder))
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_one_of_several_processes_compiles_a_kernel(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    slow = "\n    ".join(f"x += {n}.0 if x > {n}.5 else x * {n}.25" for n in range(40))
    (tmp_path / "kernel.py").write_text(KERNEL.format(slow_to_compile=slow))
    callers = [start(CALLER, cwd=tmp_path) for _ in range(3)]
    for caller in callers:
        caller.stdin.write("\n")
        caller.stdin.flush()
    results = [caller.communicate(timeout=300)[0].split() for caller in callers]
    assert sorted(hits for _, hits in results) == ["0", "1", "1"]
    assert len({value for value, _ in results}) == 1
    assert len(list((tmp_path / "kernels").glob("*.kernel"))) == 1


def test_a_process_waits_for_its_kernel_only(tmp_path, monkeypatch):
    monkeypatch.setattr(compile_lock, "_MAX_WAIT_S", 0.05)
    lock = CompileLock()
    with holder(tmp_path) as process:
        lock.acquire(tmp_path, "b.kernel")
        assert lock.is_locked
        process.send_signal(signal.SIGSTOP)
        lock.acquire(tmp_path, "a.kernel")
        assert not lock.is_locked, "a suspended process is not waited for without end"
    lock.acquire(tmp_path, "a.kernel")
    assert lock.is_locked, "the lock of a killed process is free"
    lock.release()
    with holder(tmp_path):
        lock.acquire(tmp_path, "a.kernel")
        assert not lock.is_locked, "a released kernel can be locked by another process"


@pytest.mark.parametrize("name", ["file", "file/below"])
def test_a_folder_without_locks_stops_no_compilation(tmp_path, name):
    (tmp_path / "file").touch()
    lock = CompileLock()
    lock.acquire(tmp_path / name, "a.kernel")
    assert not lock.is_locked
    lock.release()
