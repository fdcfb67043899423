"""Generates the table of docs/figures.md from the figures that one machine measured on one day."""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Collection
from datetime import date
from pathlib import Path

from data_needs import Need, find_missing_needs
from figure import Figure

PAGE = Path(__file__).parents[2] / "docs" / "figures.md"
DAY = Path(__file__).parents[2] / "out" / "bench_day.json"
"""File with today's results of this machine, by benchmark. Several calls may each measure a part."""


def gather_figures(
    benchmark: str, figures: list[Figure], machine: str, day: date, kept: Path = DAY
) -> dict[str, list[Figure]]:
    """Stores a benchmark's figures. Returns those of all benchmarks that this machine measured on this
    day."""
    stamp = {"machine": machine, "day": day.isoformat()}
    before = json.loads(kept.read_text()) if kept.exists() else {}
    of_day = before["figures"] if {key: before.get(key) for key in stamp} == stamp else {}
    of_day[benchmark] = [vars(figure) for figure in figures]
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({**stamp, "figures": of_day}, indent=1) + "\n")
    return {name: [Figure(**figure) for figure in measured] for name, measured in of_day.items()}


def write_when_whole(of_day: dict[str, list[Figure]], known: Collection[str], page: Path = PAGE) -> list[str]:
    """Writes the table as soon as every benchmark was measured. Returns the names of missing benchmarks."""
    missing = [name for name in known if name not in of_day]
    if not missing:
        figures = [figure for measured in of_day.values() for figure in measured]
        needs = find_missing_needs(known)
        text = make_page(page.read_text(encoding="utf-8"), figures, this_machine(), date.today(), needs)
        page.write_text(text, encoding="utf-8")
    return missing


def make_page(page: str, figures: list[Figure], machine: str, day: date, needs: Collection[Need] = ()) -> str:
    """Returns the page with the table of these figures instead of the previous table.

    Below the table are the data that the missing figures need.
    """
    rows = [
        f"| `{figure.name}` | {figure.value:.4g} {figure.unit} | {_compare_figure(figure)} |"
        for figure in sorted(figures, key=lambda one: one.name)
    ]
    head = [
        f"Measured on {day.isoformat()} on {machine}.",
        "",
        "| figure | value | beside |",
        "|---|---|---|",
    ]
    lacks = [f"- {need}" for need in needs]
    below = ["", "This machine lacked data:", "", *lacks] if lacks else []
    table = "\n".join(["<!-- figures -->", "", *head, *rows, *below, "", "<!-- end -->"])
    return re.sub("<!-- figures -->.*?<!-- end -->", lambda _: table, page, flags=re.DOTALL)


def _compare_figure(one: Figure) -> str:
    return "" if one.ratio is None else f"{one.ratio:.3g} times better than {one.peer}"


def this_machine() -> str:
    """Returns the processor, the number of cores that this process may use, and the operating system."""
    listed = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", listed.read_text()) if listed.exists() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {processor}, {platform.system()}, Python {platform.python_version()}"
