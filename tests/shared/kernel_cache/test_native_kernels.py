"""Tests that programs compile native code in the background, and that their next session uses it if it is
complete.
"""

import json
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import llvmlite.binding
import pytest

from enliven.kernel_cache import native_compiler, native_schedule, native_set, store
from enliven.kernel_cache.native_set import NativeSet
from enliven.kernel_cache.program import PROGRAM_VARIABLE
from enliven.kernel_cache.target import processor_levels

KERNELS = """
from enliven.kernels import njit


@njit(cache=True)
def double(x):
    return 2.0 * x


@njit(cache=True)
def triple(x):
    return 3.0 * x
"""
PROGRAM = """
import sys

from enliven.kernel_cache.program import name_program
from enliven.kernel_cache import native_schedule

name_program("stage")
native_schedule.QUIET_S = 0.1
import numba
import kernels

for name in sys.argv[1:]:
    kernel = getattr(kernels, name)
    print(kernel(2.0), sum(kernel.stats.cache_hits.values()))
print(numba.config.CPU_NAME, flush=True)
sys.stdin.read()
"""
AVX512 = {"avx2": True, "avx512f": True, "avx512vl": True}
PATIENCE_S = 300.0
"""Timeout of a compilation at lowest priority on a busy machine, seconds."""
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Sets an empty kernel folder for this process and its child processes."""
    path = tmp_path / "store"
    path.mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(path))
    store.user_folder.cache_clear()
    yield path
    store.user_folder.cache_clear()


class Stage:
    """A program that calls kernels and runs until the test ends it."""

    def __init__(self, place: Path, *kernels: str, mode: str = "on") -> None:
        (place / "kernels.py").write_text(KERNELS)
        (place / "stage.py").write_text(PROGRAM)
        paths = [str(place), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "ENLIVEN_NATIVE_KERNELS": mode, "PYTHONPATH": os.pathsep.join(paths)}
        self._process = subprocess.Popen(
            [sys.executable, str(place / "stage.py"), *kernels],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.lines = [self._process.stdout.readline().strip() for _ in (*kernels, "processor")]

    def end(self) -> None:
        self._process.communicate(timeout=PATIENCE_S)


def wait_for_complete_set() -> NativeSet:
    deadline = time.monotonic() + PATIENCE_S
    while not (stored := NativeSet.load("stage")).is_complete:
        assert time.monotonic() < deadline, stored
        time.sleep(0.1)
    return stored


@pytest.mark.slow
@pytest.mark.skipif(not processor_levels(), reason="this processor has no named level")
def test_next_session_uses_native_code(folder, tmp_path):
    native = llvmlite.binding.get_host_cpu_name()
    portable = Stage(tmp_path, "double", "triple", mode="off")
    portable.end()
    assert portable.lines[:2] == ["4.0 0", "6.0 0"]
    assert portable.lines[2] == processor_levels()[0]
    assert len(list(folder.glob("*.kernel"))) == 2, "nothing was compiled in the background"

    first = Stage(tmp_path, "double")
    assert first.lines == ["4.0 1", portable.lines[2]], "the first session uses portable code"
    assert len(wait_for_complete_set().kernels) == 1
    first.end()

    second = Stage(tmp_path, "double", "triple")
    assert second.lines == ["4.0 1", "6.0 1", native], "a kernel without native code is not compiled"
    deadline = time.monotonic() + PATIENCE_S
    while len(NativeSet.load("stage").kernels) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    assert len(wait_for_complete_set().kernels) == 2
    second.end()
    assert len(list(folder.glob("*.kernel"))) == 4


def test_set_is_complete_until_a_file_is_missing(folder):
    NativeSet("stage", ("a.kernel", "b.kernel"), failed=("b.kernel",)).save()
    assert not NativeSet.load("stage").is_complete
    (folder / "a.kernel").touch()
    assert NativeSet.load("stage").is_complete, "the portable code of b is used"
    assert native_set.list_stored_sets() == [NativeSet.load("stage")]
    assert not NativeSet.load("view").is_complete
    NativeSet("stage", ("a.kernel", "b.kernel"), missing=("b.kernel",)).save()
    assert not NativeSet.load("stage").is_complete
    assert "1 of 2" in str(NativeSet.load("stage"))


@pytest.mark.parametrize("text", ["", "{", "[]", '{"kernels": 3}', "\ufffd"])
def test_damaged_state_counts_as_empty(folder, text):
    NativeSet("stage", ("a.kernel",)).save()
    (path,) = folder.glob("native-*.json")
    path.write_text(text, encoding="utf-8")
    assert NativeSet.load("stage") == NativeSet("stage")


def test_other_version_of_enliven_starts_without_native_code(folder, monkeypatch):
    NativeSet("stage", ("a.kernel",)).save()
    monkeypatch.setattr(native_set, "__version__", "99.0")
    assert NativeSet.load("stage") == NativeSet("stage")


@pytest.mark.parametrize(
    ("features", "environment", "expected"),
    [
        (AVX512, {}, True),
        (AVX512, {"CI": "true"}, False),
        (AVX512, {"ENLIVEN_NATIVE_KERNELS": "off"}, False),
        ({"avx2": True}, {}, False),
        ({"avx2": True}, {"ENLIVEN_NATIVE_KERNELS": "on", "CI": "true"}, True),
        (AVX512, {PROGRAM_VARIABLE: ""}, False),
    ],
)
def test_processor_and_environment_decide(folder, monkeypatch, features, environment, expected):
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: features)
    for name in ("CI", "ENLIVEN_NATIVE_KERNELS"):
        monkeypatch.delenv(name, raising=False)
    for name, value in ({PROGRAM_VARIABLE: "stage"} | environment).items():
        monkeypatch.setenv(name, value)
    assert native_set.uses_native_code() is expected


def test_kernels_that_cannot_be_compiled_do_not_stop_the_others(folder, monkeypatch):
    compiled = []

    def compile_or_fail(name, *location):
        compiled.append(name)
        (folder / name).touch()
        return name != "b.kernel"

    wanted = {name: ("module", "kernel", b"") for name in ("a.kernel", "b.kernel", "c.kernel")}
    monkeypatch.setattr(native_compiler, "compile_kernel", compile_or_fail)
    assert native_compiler.compile_missing("stage", wanted, folder) == 0
    assert native_compiler.compile_missing("stage", wanted, folder) == 0
    assert compiled == ["a.kernel", "b.kernel", "c.kernel"], "none is compiled twice"
    stored = NativeSet.load("stage")
    assert stored.is_complete and stored.failed == ("b.kernel",)


def test_unknown_module_and_other_code_cannot_be_compiled():
    types = pickle.dumps(())
    assert not native_compiler.compile_kernel("a.kernel", "no_such_module", "kernel", types)
    assert not native_compiler.compile_kernel("a.kernel", "enliven.kernels", "quantile", types)
    assert not native_compiler.compile_kernel("a.kernel", "enliven.kernels", "no_such_kernel", types)


def test_full_disk_ends_the_compilation(folder, monkeypatch):
    wanted = {name: ("module", "kernel", b"") for name in ("a.kernel", "b.kernel")}
    monkeypatch.setattr(native_compiler, "compile_kernel", lambda *kernel: True)
    assert native_compiler.compile_missing("stage", wanted, folder) == 0
    assert NativeSet.load("stage").missing == ("a.kernel", "b.kernel")


def test_nothing_is_compiled_on_battery(folder, tmp_path, monkeypatch):
    supplies = tmp_path / "supplies"
    (supplies / "AC").mkdir(parents=True)
    (supplies / "BAT0").mkdir()
    (supplies / "BAT0" / "status").write_text("Discharging\n")
    monkeypatch.setattr(native_schedule, "_POWER_SUPPLY_FOLDER", supplies)
    assert native_schedule.runs_on_battery()
    wanted = {"a.kernel": ("module", "kernel", b"")}
    assert native_compiler.compile_missing("stage", wanted, folder) == native_compiler.RETRY_LATER_EXIT_CODE
    (supplies / "BAT0" / "status").write_text("Charging\n")
    assert not native_schedule.runs_on_battery()


def test_one_process_compiles_at_a_time(folder):
    with (
        native_compiler.lock_compilation(folder) as first,
        native_compiler.lock_compilation(folder) as second,
    ):
        assert first and not second
    with native_compiler.lock_compilation(folder) as later:
        assert later


@posix
def test_compiler_has_the_lowest_priority():
    report = "print(os.nice(0), os.sched_getscheduler(0) if sys.platform == 'linux' else 'idle')"
    start = (
        "import os, sys; from enliven.kernel_cache.native_compiler import lower_priority; lower_priority()"
    )
    done = subprocess.run([sys.executable, "-c", f"{start}; {report}"], capture_output=True, text=True)
    idle = os.SCHED_IDLE if sys.platform == "linux" else "idle"
    assert done.stdout.split() == ["19", str(idle)], done.stderr


def test_compiler_ends_with_its_program(folder, tmp_path, monkeypatch):
    """The program is killed while the compiler imports a module that never finishes importing."""
    (tmp_path / "endless.py").write_text(
        "import pathlib, time\npathlib.Path(__file__).with_name('began').touch()\ntime.sleep(3600)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "enliven.kernel_cache.native_compiler", "stage"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, env=environment) as process:
        pickle.dump({"a.kernel": ("endless", "kernel", b"")}, process.stdin)
        process.stdin.flush()
        while not (tmp_path / "began").exists():
            assert process.poll() is None
            time.sleep(0.05)
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    (path,) = folder.glob("native-*.json")
    assert json.loads(path.read_text())["missing"] == ["a.kernel"]
