"""Reports the simulated exhibition hours of a soak test, and the growth of memory.

It runs `make soak` for 25 minutes. The programs run for the last 15 minutes without a restart. The slope is
fitted after their warm-up of six minutes. The figure is the steepest slope of all programs.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from figure import Figure

ROOT = Path(__file__).parents[2]
MINUTES, SEED = 25.0, 1
"""Length of the soak in minutes, and the seed of its schedule. A whole day takes 50 minutes."""


def figures() -> Iterator[Figure]:
    """Yields the simulated hours, and the steepest slope of a program's memory with its standard error."""
    command = [sys.executable, "tests/soak/soak.py", "--minutes", str(MINUTES), "--seed", str(SEED)]
    subprocess.run(command, cwd=ROOT, check=False)
    report = json.loads((ROOT / "out" / "soak" / "report.json").read_text())
    yield Figure("soak.hours", report["hours"], "h")
    keys = ("rss_slope_mb_per_day", "rss_slope_error_mb_per_day")
    slopes = [tuple(each[key] for key in keys) for each in report["programs"].values()]
    measured = [slope for slope in slopes if None not in slope]
    if measured:
        slope, error = max(measured)
        yield Figure("soak.rss_slope_mb_day", slope, "MB")
        yield Figure("soak.rss_slope_error_mb_day", error, "MB")
