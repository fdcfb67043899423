"""Runs the steps of `make nightly`: long tests, ten minutes of fuzzing, benchmarks and their ratchet.

Each step runs even if an earlier one failed. The last lines list the failures, and the exit code is then 1.
``--update`` stores headline figures that got better.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import ratchet

ROOT = Path(__file__).parents[2]
FUZZ_S = 600
"""Seconds of fuzzing. Each night uses another seed, which is printed."""


def rooms(headlines: Sequence[ratchet.Headline]) -> list[str]:
    """Returns the benchmarks that measure the figures, each once."""
    return list(dict.fromkeys(ratchet.find_benchmark(headline.name) for headline in headlines))


def list_steps(update: bool, names: Sequence[str]) -> dict[str, list[str]]:
    """Returns the command of each step by its name."""
    benchmarks = {
        f"the benchmark {name}": [sys.executable, "tests/benchmarks/run.py", name] for name in names
    }
    return {
        "the long tests": ["make", "test-long"],
        "fuzzing": ["make", "fuzz", f"SECONDS={FUZZ_S}"],
        **benchmarks,
        "the ratchet": [sys.executable, "tests/benchmarks/ratchet.py", *(["--update"] if update else [])],
    }


def forget(path: Path, names: Sequence[str]) -> None:
    """Removes the figures of some benchmarks from bench.json, so that an older run cannot replace this
    one.
    """
    if path.exists():
        kept = [row for row in ratchet.read_list(path) if ratchet.find_benchmark(row["name"]) not in names]
        path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def run_all(commands: dict[str, list[str]], run: Callable[[list[str]], int]) -> list[str]:
    """Runs every command, and returns a sentence for each that failed."""
    failed = []
    for name, command in commands.items():
        print(f"nightly: {name}", flush=True)
        if code := run(command):
            failed.append(f"nightly: {name} failed with exit code {code}: {' '.join(command)}")
    return failed


def main(arguments: Sequence[str]) -> int:
    """Returns the exit code: 1 if a step failed, 2 if a file of figures cannot be read."""
    try:
        names = rooms(ratchet.read_headlines(ratchet.HEADLINES))
        forget(ratchet.RESULT, names)
    except ratchet.BadHeadlines as error:
        print(error, file=sys.stderr)
        return 2
    commands = list_steps("--update" in arguments, names)
    failed = run_all(commands, lambda command: subprocess.run(command, cwd=ROOT, check=False).returncode)
    print("\n".join(failed) or "nightly: all is well")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
