"""Runs the tests in several configurations: with other processor instructions, in other orders, and on a
loaded machine.

Usage: test_matrix.py [--only ROW ROW ...] [--load N] [pytest arguments ...] Prints a table with the passed
tests, the failed tests and the seconds of each configuration (row). The exit code is 1 if a test failed.
"""

import argparse
import contextlib
import dataclasses
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
TWO_PROCESSES = ("-n", "2", "--dist", "loadfile", "--no-loadscope-reorder")
"""pytest options for two processes that share the files in the order of collection."""
SEED = "20251123"
"""Seed of the shuffled order. Any fixed number works."""
PLAIN_NUMPY = "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"
"""All instruction sets that NumPy 2.4 dispatches to on x86-64. Without them it uses code compiled for
SSE4.2."""


@dataclasses.dataclass(frozen=True)
class Row:
    """One configuration for running the tests.

    Attributes:
        name: name for ``--only``.
        environment: environment variables to set.
        options: pytest options.
        busy: number of processes that keep the processor busy during the run.
        apart: True to cache Numba's kernels separately, because they are compiled for another processor.
    """

    name: str
    environment: dict[str, str] = dataclasses.field(default_factory=dict)
    options: tuple[str, ...] = TWO_PROCESSES
    busy: int = 0
    apart: bool = False


def list_rows(load: int) -> list[Row]:
    """Returns all rows, in the order in which they run."""
    cores = ("Sandybridge", "Haswell", "SkylakeX", "Zen")
    old = {"NPY_DISABLE_CPU_FEATURES": PLAIN_NUMPY, "NUMBA_CPU_NAME": "generic"}
    return [
        Row("two"),
        Row("one", options=()),
        Row("shuffled", options=(*TWO_PROCESSES, "--shuffle", SEED)),
        *(Row(core.lower(), {"OPENBLAS_CORETYPE": core}) for core in cores),
        Row("generic", old, apart=True),
        Row("load", busy=load),
    ]


@contextlib.contextmanager
def keep_busy(count: int) -> Iterator[None]:
    """Keeps ``count`` processes busy in an endless loop."""
    circles = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for circle in circles:
            circle.kill()
            circle.wait()


def make_command(row: Row, rest: list[str]) -> str:
    """Returns the command line that runs this row alone."""
    words = [f"{name}={shlex.quote(value)}" for name, value in row.environment.items()]
    words += ["NUMBA_CACHE_DIR=$(mktemp -d)"] if row.apart else []
    return " ".join([*words, ".venv/bin/python -m pytest", *row.options, *rest])


def count_results(output: str) -> tuple[int, int]:
    """Returns the numbers (passed, failed) from pytest's last line. Errors count as failed."""
    lines = [line for line in output.splitlines() if re.search(r"\d+ (passed|failed|error)", line)]
    matches = re.findall(r"(\d+) (passed|failed|error)", lines[-1] if lines else "")
    counts = {word: int(count) for count, word in matches}
    return counts.get("passed", 0), counts.get("failed", 0) + counts.get("error", 0)


def run(row: Row, rest: list[str]) -> tuple[bool, str]:
    """Runs a row. Returns True if it passed, and its line of the table."""
    with tempfile.TemporaryDirectory() as kernels, keep_busy(row.busy):
        extra = {"NUMBA_CACHE_DIR": kernels} if row.apart else {}
        begun = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *row.options, *rest],
            env=os.environ | row.environment | extra, cwd=ROOT, capture_output=True, text=True, check=False,
        )  # fmt: skip
        seconds = time.monotonic() - begun
    passed, failed = count_results(done.stdout)
    if done.returncode:
        print(f"--- {row.name}: exit {done.returncode}\n{done.stdout}\n{done.stderr}", file=sys.stderr)
    load_note = f" with {row.busy} busy processes" if row.busy else ""
    line = f"| {row.name} | `{make_command(row, rest)}`{load_note} | {passed} | {failed} | {seconds:.0f} |"
    return done.returncode == 0, line


def main() -> int:
    """Runs the chosen rows and prints a table. Returns 1 if tests of a row failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], metavar="ROW", help="run only these rows")
    parser.add_argument("--load", type=int, default=8, help="number of busy processes of the row 'load'")
    options, rest = parser.parse_known_args()
    rest = [word for word in rest if word != "--"]
    rows_by_name = {row.name: row for row in list_rows(options.load)}
    if unknown := [name for name in options.only if name not in rows_by_name]:
        parser.error(f"unknown rows: {' '.join(unknown)}. Known rows: {' '.join(rows_by_name)}")
    print("| row | command | passed | failed | seconds |\n|---|---|---|---|---|", flush=True)
    passed = []
    for name in options.only or rows_by_name:
        has_passed, line = run(rows_by_name[name], rest)
        passed.append(has_passed)
        print(line, flush=True)
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
