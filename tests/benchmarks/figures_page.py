"""Generates the table of docs/figures.md from the figures that one machine measured within 24 hours."""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Collection
from datetime import datetime, timedelta
from pathlib import Path

from data_needs import Need, find_missing_needs
from figure import Figure

PAGE = Path(__file__).parents[2] / "docs" / "figures.md"
RECENT = Path(__file__).parents[2] / "out" / "bench_recent.json"
"""File with this machine's recent results, by benchmark. Several calls may each measure a part."""
MAX_AGE = timedelta(hours=24)
"""Older results are measured again: the code has changed since then."""


def gather_figures(
    benchmark: str, figures: list[Figure], machine: str, now: datetime, kept: Path = RECENT
) -> dict[str, list[Figure]]:
    """Stores a benchmark's figures. Returns those of all benchmarks that this machine measured within
    ``MAX_AGE``."""
    before = json.loads(kept.read_text()) if kept.exists() else {}
    recent = before["benchmarks"] if before.get("machine") == machine else {}
    recent[benchmark] = {"time": now.isoformat(), "figures": [vars(figure) for figure in figures]}
    recent = {
        name: entry
        for name, entry in recent.items()
        if abs(now - datetime.fromisoformat(entry["time"])) <= MAX_AGE
    }
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"machine": machine, "benchmarks": recent}, indent=1) + "\n")
    return {name: [Figure(**figure) for figure in entry["figures"]] for name, entry in recent.items()}


def write_when_whole(
    recent: dict[str, list[Figure]], known: Collection[str], now: datetime, page: Path = PAGE
) -> list[str]:
    """Writes the table as soon as every benchmark was measured. Returns the names of missing benchmarks."""
    missing = [name for name in known if name not in recent]
    if not missing:
        figures = [figure for measured in recent.values() for figure in measured]
        needs = find_missing_needs(known)
        text = make_page(page.read_text(encoding="utf-8"), figures, this_machine(), now, needs)
        page.write_text(text, encoding="utf-8")
    return missing


def make_page(
    page: str, figures: list[Figure], machine: str, now: datetime, needs: Collection[Need] = ()
) -> str:
    """Returns the page with the table of these figures instead of the previous table.

    Below the table are the data that the missing figures need.
    """
    rows = [
        f"| `{figure.name}` | {figure.value:.4g} | {figure.unit} | {_describe_peer(figure)} |"
        for figure in sorted(figures, key=lambda figure: figure.name)
    ]
    head = [
        f"Measured within 24 hours, until {now.date().isoformat()}, on {machine}.",
        "",
        "A ratio above 1 means that enliven is better than the peer.",
        "",
        "| figure | value | unit | ratio | peer |",
        "|---|---|---|---|---|",
    ]
    lacks = [f"- {need}" for need in needs]
    below = ["", "This machine lacked data:", "", *lacks] if lacks else []
    table = "\n".join(["<!-- figures -->", "", *head, *rows, *below, "", "<!-- end -->"])
    return re.sub("<!-- figures -->.*?<!-- end -->", lambda _: table, page, flags=re.DOTALL)


def _describe_peer(figure: Figure) -> str:
    return "|" if figure.ratio is None else f"{figure.ratio:.3g} | {figure.peer}"


def this_machine() -> str:
    """Returns the processor, the number of cores that this process may use, and the operating system."""
    listed = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", listed.read_text()) if listed.exists() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {processor}, {platform.system()}, Python {platform.python_version()}"
