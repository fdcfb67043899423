"""Runs the tests in parallel, and runs the few that fail once more, alone.

Usage: run_tests.py [pytest arguments ...]

Many tests drive real programs, sockets and windows, and wait for them with deadlines. On a busy machine,
such a deadline can pass although nothing is wrong. A fault fails alone as well. A test that passes only alone
is listed as unsteady: this is a fault of the test, which should be fixed.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

PARALLEL = ("-n", "3", "--dist", "loadfile", "--no-loadscope-reorder", "--durations=50")
"""Three processes for two cores, since tests of cameras and of processes wait much of their time."""
HANG_S = 720
"""Seconds after which a test counts as endless. The stacks of all threads are printed and it fails, even if a
library blocks the interpreter. Otherwise it would occupy CI until its time limit, and its name would remain
unknown."""
STOP_HANGS = (
    f"-ofaulthandler_timeout={HANG_S}",
    "-ofaulthandler_exit_on_timeout=true",
    # A process that ends is not replaced. pytest-xdist waits for ever for the replacement of the last one.
    "--max-worker-restart=0",
    "-pended_processes",
)
MAX_REPEATED = 5
"""Failed tests that are run again. If more fail, the reason is not a busy machine."""


def run_pytest(cache: Path, *arguments: str) -> int:
    """Runs pytest in a process of its own.

    Args:
        cache: folder for the list of the failed tests.
        arguments: pytest arguments.

    Returns:
        The exit status.
    """
    command = [sys.executable, "-m", "pytest", *STOP_HANGS, f"-ocache_dir={cache}", *arguments]
    scripts = os.pathsep.join(filter(None, (str(Path(__file__).parent), os.environ.get("PYTHONPATH"))))
    return subprocess.run(command, env={**os.environ, "PYTHONPATH": scripts}, check=False).returncode


def read_failed_tests(cache: Path) -> list[str]:
    """Returns the tests that failed in the last run with this cache, as pytest names them."""
    path = cache / "v" / "cache" / "lastfailed"
    return sorted(json.loads(path.read_text())) if path.is_file() else []


def main(arguments: list[str]) -> int:
    """Runs the tests.

    Args:
        arguments: pytest arguments.

    Returns:
        pytest's exit status: 0 if each test passed in the whole run or alone. A run that pytest did not
        finish is never repeated.
    """
    with tempfile.TemporaryDirectory() as folder:
        status = run_pytest(Path(folder), *PARALLEL, *arguments)
        failed = read_failed_tests(Path(folder))
        if status != 1 or not 1 <= len(failed) <= MAX_REPEATED:
            return status
        print("\nRunning the failed tests once more, alone.", flush=True)
        status = run_pytest(Path(folder), "-n", "0", *failed)
        still = read_failed_tests(Path(folder))
    for test in failed:
        print(f"{'FAILED TWICE' if status and test in still else 'UNSTEADY (passes alone)'}: {test}")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
