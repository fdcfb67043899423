"""Measures compiled kernels: a first start without them, one with those of a release, and processor levels.

It compiles everything several times, ten minutes on two cores, so it runs only if ``start`` is named:
``make bench ONLY=start``. start.wheel_mb and start.wheel_first_pose_s need the wheel that ``make release``
puts into out/release/archives, and are left out without it.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import llvmlite.binding
from bench_start import ENLIVEN, FIRST_FRAME, ROOT, time_first_pose
from data_needs import CMU
from figure import Figure

from enliven.kernel_cache.target import processor_levels

COLD = 900.0
"""Timeout for the first pose without compiled kernels, seconds."""
LAPS = 3
"""Repetitions of a start with a release's kernels. The median is reported."""
REPLAY = ("edge", "--speed", "0", "--possess-at", "0", "--port", "0", "--control-port", "0")
"""Arguments of an edge that plays the shipped recording (270 frames) as fast as possible."""
LEVELS = ("embedded.frame_ms_128", "arap.frame_ms_5k", "tracking")
"""Figures that are measured with native code and with the code of each level. "tracking" has no figure in
bench.json.
"""
UNTIL = """
import sys
sys.path.insert(0, sys.argv[1])
import run
module = run._module(run.HERE / f"bench_{sys.argv[2].partition('.')[0]}.py")
print(next(figure.value for figure in module.figures() if figure.name == sys.argv[2]))
"""
"""Program that prints one figure. Arguments: the folder of the benchmarks, and the figure's name."""


def figures() -> Iterator[Figure]:
    """Yields start.cold_first_pose_s, .cold_run_s, .compile_cpu_s, .kernels, .wheel_*, .portable_cost_*."""
    if "start" not in sys.argv[1:]:
        return
    with tempfile.TemporaryDirectory() as empty:
        yield Figure("start.cold_first_pose_s", time_first_pose(COLD, NUMBA_CACHE_DIR=f"{empty}/pose"), "s")
        film = [*ENLIVEN, "run", "--film", "--out", f"{empty}/film"]
        yield Figure("start.cold_run_s", time_command(film, NUMBA_CACHE_DIR=f"{empty}/run"), "s")
        cold = measure_processor_seconds(NUMBA_CACHE_DIR=f"{empty}/edge")
        warm = measure_processor_seconds(NUMBA_CACHE_DIR=f"{empty}/edge")
        yield Figure("start.compile_cpu_s", cold - warm, "s of processor time")
        yield Figure("start.kernels", len(list(Path(empty, "edge").glob("*.kernel"))), "files of an edge")
        yield from measure_wheel(Path(empty))
    yield from measure_portable_cost()


def time_command(command: list[str], **environment: str) -> float:
    """Returns the seconds of a command, which must succeed."""
    began = time.perf_counter()
    subprocess.run(command, env={**os.environ, **environment}, check=True, capture_output=True)
    return time.perf_counter() - began


def measure_processor_seconds(**environment: str) -> float:
    """Returns the processor time in seconds of an edge on the shipped recording, including its child
    processes.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    time_command([*ENLIVEN, *REPLAY, "--name", f"bench-{os.getpid()}"], **environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure_wheel(folder: Path) -> Iterator[Figure]:
    """Yields the size of the wheel of kernels, and the time to the first pose of an edge that has only this
    wheel.
    """
    wheels = [
        path
        for path in (ROOT / "out" / "release" / "archives").glob("enliven_kernels-*.whl")
        if not path.name.endswith("-none-any.whl")
    ]
    for wheel in wheels[:1]:
        yield Figure("start.wheel_mb", wheel.stat().st_size / 1e6, "MB")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder / "site")
        words = {"PYTHONPATH": str(folder / "site"), "NUMBA_CACHE_DIR": str(folder / "own")}
        poses = [time_first_pose(COLD, **words) for _ in range(LAPS)]
        yield Figure("start.wheel_first_pose_s", statistics.median(poses), "s")
        compiled = len(list((folder / "own").glob("*.kernel")))
        yield Figure("start.wheel_compiled", compiled, "kernels that the wheel lacks")


def measure_portable_cost() -> Iterator[Figure]:
    """Yields the time with code for the processor's level as a multiple of that with native code."""
    names = processor_levels()
    native = {
        "NUMBA_CPU_NAME": llvmlite.binding.get_host_cpu_name(),
        "NUMBA_CPU_FEATURES": find_host_features(),
    }
    for figure in LEVELS:
        if figure.startswith("embedded") and CMU.is_missing:
            continue
        least: dict[str, float] = {}
        for _ in range(LAPS):  # alternately, so that a change of the machine's load affects all of them
            for name in ("native", *names):
                chosen = native if name == "native" else {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""}
                least[name] = min(least.get(name, float("inf")), time_level(figure, **chosen))
        for name in names:
            cost = least[name] / least["native"]
            yield Figure(f"start.portable_cost_{name}_{figure.partition('.')[0]}", cost, "times native code")


def find_host_features() -> str:
    """Returns LLVM's list of this processor's features, as Numba uses it for native code."""
    return llvmlite.binding.get_host_cpu_features().flatten()


def time_level(figure: str, **environment: str) -> float:
    """Returns the milliseconds of one of :data:`LEVELS`."""
    return (
        measure_tracking_ms(**environment)
        if figure == "tracking"
        else measure_in_process(figure, **environment)
    )


def measure_in_process(figure: str, **environment: str) -> float:
    """Returns a figure that a benchmark measures in a separate process."""
    command = [sys.executable, "-c", UNTIL, str(ROOT / "tests" / "benchmarks"), figure]
    done = subprocess.run(
        command, env={**os.environ, **environment}, check=True, capture_output=True, text=True
    )
    return float(done.stdout.splitlines()[-1])  # a benchmark may print notes first


def measure_tracking_ms(**environment: str) -> float:
    """Returns the median milliseconds per frame for tracking the person in the shipped recording."""
    command = [sys.executable, "-c", FIRST_FRAME]
    done = subprocess.run(
        command, env={**os.environ, **environment}, check=True, capture_output=True, text=True
    )
    return statistics.median(map(float, done.stdout.split()[1:]))
