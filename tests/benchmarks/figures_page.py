"""The table of docs/figures.md, made of the figures of one whole run."""

from __future__ import annotations

import os
import platform
import re
from datetime import date
from pathlib import Path

from figure import Figure

PAGE = Path(__file__).parents[2] / "docs" / "figures.md"


def written(page: str, figures: list[Figure], machine: str, day: date) -> str:
    """The page with the table of these figures in the place of the one before."""
    rows = [
        f"| `{one.name}` | {one.value:.4g} {one.unit} | {_compared(one)} |"
        for one in sorted(figures, key=lambda one: one.name)
    ]
    head = [
        f"Measured on {day.isoformat()} on {machine}.",
        "",
        "| figure | value | beside |",
        "|---|---|---|",
    ]
    table = "\n".join(["<!-- figures -->", "", *head, *rows, "", "<!-- end -->"])
    return re.sub("<!-- figures -->.*?<!-- end -->", lambda _: table, page, flags=re.DOTALL)


def _compared(one: Figure) -> str:
    return "" if one.ratio is None else f"{one.ratio:.3g} times better than {one.peer}"


def this_machine() -> str:
    """The processor, the number of cores that this process may use, and the system."""
    listed = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", listed.read_text()) if listed.exists() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {processor}, {platform.system()}, Python {platform.python_version()}"
