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

HIGHLIGHTS = (
    (
        "Depth frame to pose",
        "time from reading a frame to publishing the pose, median",
        "road.latency_p50_ms",
    ),
    ("", "the same, 99th percentile", "road.latency_p99_ms"),
    ("", "frame rate if nothing waits", "road.fps"),
    ("", "size of a pose on the network", "road.pose_bytes"),
    ("Tracking", "fraction of visible joints within 10 cm", "tracking.within_10cm"),
    ("", "mean error of visible joints", "tracking.mean_error_mm"),
    ("", "time of a frame with one performer, median", "tracking.median_ms_1"),
    ("", "the same, 99th percentile", "tracking.p99_ms_1"),
    ("", "identity switches per minute", "tracking.identity_swaps_per_minute"),
    ("", "jitter of a person who stands still", "tracking.jitter_mm"),
    ("Possession", "a frame of a chair of 128 nodes that follows a person", "embedded.frame_ms_128"),
    ("", "the same with 1,024 nodes", "embedded.frame_ms_1024"),
    ("Matching", "ranking of all matches with a skeleton of 200 joints", "matching.rank_ms_200"),
    ("Retargeting", "time per bone", "matching.retarget_us_per_bone"),
    ("", "direction error of limbs, people onto people, median", "retarget.pose_deg_median"),
    ("", "the same, 90th percentile", "retarget.pose_deg_p90"),
    ("Puppets", "a frame of a surface of 10,488 vertices", "arap.frame_ms_10k"),
    ("", "a frame of a surface of a million vertices", "arap.frame_ms_1m"),
    ("Examples", "3,703 frames through 8 example poses", "examples.unbounded_s_8"),
    ("Scanning", "frames per second", "scanning.fps"),
    ("", "distance of the surface from the true one", "scanning.surface_mm"),
    ("Modeling", "union of two meshes of 10,000 vertices", "modeling.union_ms"),
    ("Physics", "step of a room with objects", "physics.step_ms"),
    ("Start", "time to the first pose with compiled kernels", "start.first_pose_s"),
    ("", "the same after the first installation, from a clone", "start.cold_first_pose_s"),
    ("", "the same after the first installation, from wheels", "start.wheel_first_pose_s"),
)
"""The figures at the top of the page: subject, description and name. An empty subject means the subject
above."""


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
    by_name = {figure.name: figure for figure in figures}
    highlights = [
        f"| {subject} | {text} | {_describe_value(by_name[name])} |"
        for subject, text, name in HIGHLIGHTS
        if name in by_name
    ]
    rows = [
        f"| `{figure.name}` | {_describe_value(figure)} |"
        for figure in sorted(figures, key=lambda figure: figure.name)
    ]
    head = [
        f"Measured within 24 hours, until {now.date().isoformat()}, on {machine}.",
        "",
        "A ratio above 1 means that enliven is better than the peer.",
        "",
        "| subject | measured | value | unit | ratio | peer |",
        "|---|---|---|---|---|---|",
        *highlights,
        "",
        "### All figures",
        "",
        "| figure | value | unit | ratio | peer |",
        "|---|---|---|---|---|",
    ]
    lacks = [f"- {need}" for need in needs]
    below = ["", "This machine lacked data:", "", *lacks] if lacks else []
    table = "\n".join(["<!-- figures -->", "", *head, *rows, *below, "", "<!-- end -->"])
    return re.sub("<!-- figures -->.*?<!-- end -->", lambda _: table, page, flags=re.DOTALL)


def _describe_value(figure: Figure) -> str:
    """Returns the columns value, unit, ratio and peer. The last two are empty without a peer."""
    peer = "|" if figure.ratio is None else f"{figure.ratio:.3g} | {figure.peer}"
    return f"{figure.value:.4g} | {figure.unit} | {peer}"


def this_machine() -> str:
    """Returns the processor, the number of cores that this process may use, and the operating system."""
    listed = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.+)", listed.read_text()) if listed.exists() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {processor}, {platform.system()}, Python {platform.python_version()}"
