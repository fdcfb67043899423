"""Counts the hostile files and messages that fuzzing has given to the readers, and the faults that it has
found.

It adds two minutes of `make fuzz` to the runs that are already in out/fuzz. Longer runs are made by `make
fuzz SECONDS=3600`. A fault counts until its reader accepts or refuses the stored file correctly.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from figure import Figure

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "fuzz"
SECONDS = 120
"""Length of the run, seconds."""


def figures() -> Iterator[Figure]:
    """Yields the number of inputs in all runs of this checkout, and the number of remaining faults."""
    run = [sys.executable, "tests/fuzz/run.py"]
    subprocess.run([*run, "--seconds", str(SECONDS)], cwd=ROOT, check=False)
    totals = json.loads((OUT / "totals.json").read_text())
    yield Figure("fuzz.executions", sum(totals.values()), "inputs")
    kept = sorted(OUT.glob("broken-*.bin"))
    left = [path for path in kept if subprocess.run([*run, "--repeat", str(path)], cwd=ROOT).returncode]
    yield Figure("fuzz.crashes", len(left), "faults")
