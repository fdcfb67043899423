"""Runs the tests in parallel, and runs the few failed tests again, one by one.

Usage: run_tests.py [pytest arguments ...]

Many tests drive real programs, sockets and windows, and wait for them with deadlines. On a busy machine, such
a deadline can pass although nothing is wrong. A real fault also makes the test fail when it runs alone. A
test that passes only when it runs alone is listed as unsteady. This is a fault of the test and should be
fixed.

Only the second run of a test prints the values in its assertions: to record them, pytest rewrites each test
module, which takes half a minute of processor time for all modules.

If a test process ends, its unfinished tests run in a second round, including the test that ended it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from unfinished_tests import CACHE_KEY

PARALLEL = ("-n", "3", "--dist", "loadfile", "--no-loadscope-reorder", "--durations=50", "--assert=plain")
"""Options for three processes on two cores. Tests of cameras and of processes mostly wait, so more processes
than cores are useful."""
HANG_S = 720
"""Seconds after which a test counts as endless.

The stacks of all threads are printed and the test fails, even if a library blocks the interpreter. Otherwise
it would occupy CI until its time limit, and its name would remain unknown."""
ENDED_PROCESSES = (
    f"-ofaulthandler_timeout={HANG_S}",
    "-ofaulthandler_exit_on_timeout=true",
    # A process that ends is not replaced. pytest-xdist waits for ever for the replacement of the last one.
    "--max-worker-restart=0",
    "-punfinished_tests",
)
MAX_REPEATED = 5
"""Maximum number of failed tests that are run again. If more tests fail, the reason is not a busy machine."""


def run_pytest(cache: Path, *arguments: str) -> int:
    """Runs pytest in a separate process.

    Args:
        cache: folder for the lists of the failed and of the unfinished tests.
        arguments: pytest arguments.

    Returns:
        The exit status.
    """
    command = [sys.executable, "-m", "pytest", *ENDED_PROCESSES, f"-ocache_dir={cache}", *arguments]
    scripts = os.pathsep.join(filter(None, (str(Path(__file__).parent), os.environ.get("PYTHONPATH"))))
    return subprocess.run(command, env={**os.environ, "PYTHONPATH": scripts}, check=False).returncode


def read_failed_tests(cache: Path) -> list[str]:
    """Returns the tests that failed in their last run with this cache, as pytest names them."""
    return _read_names(cache / "v" / "cache" / "lastfailed")


def read_unfinished_tests(cache: Path) -> list[str]:
    """Returns the tests that did not finish in the last run because a process ended."""
    return _read_names(cache / "v" / CACHE_KEY)


def _read_names(path: Path) -> list[str]:
    return sorted(json.loads(path.read_text())) if path.is_file() else []


def main(arguments: list[str]) -> int:
    """Runs the tests.

    Args:
        arguments: pytest arguments.

    Returns:
        pytest's exit status: 0 if each test passed in one of its rounds.
    """
    with tempfile.TemporaryDirectory() as folder:
        cache, names = Path(folder) / "cache", Path(folder) / "names"
        status = run_pytest(cache, *PARALLEL, *arguments)
        failed = read_failed_tests(cache)
        unfinished = read_unfinished_tests(cache)
        if unfinished and len(failed) <= MAX_REPEATED:
            print(
                f"\nA test process ended unexpectedly. Running the {len(unfinished)} tests that did "
                "not finish.",
                flush=True,
            )
            names.write_text("\n".join(unfinished))
            status = run_pytest(cache, *PARALLEL, f"@{names}")
            if read_unfinished_tests(cache):
                return status
        repeated = read_failed_tests(cache)
        failed = sorted({*failed, *repeated})
        if repeated and status in (0, 1) and len(failed) <= MAX_REPEATED:
            print("\nRunning the failed tests again, in one process.", flush=True)
            status = run_pytest(cache, "-n", "0", *repeated)
        elif repeated and status == 1:
            print(f"\nRunning {MAX_REPEATED} of the failed tests again, to print more.", flush=True)
            run_pytest(cache, "-n", "0", *repeated[:MAX_REPEATED])
        still = read_failed_tests(cache)
    if len(failed) <= MAX_REPEATED:
        for test in failed:
            print(f"{'FAILED TWICE' if test in still else 'UNSTEADY (passes when repeated)'}: {test}")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
