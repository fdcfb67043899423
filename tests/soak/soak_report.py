"""The report of a soak, as JSON and as a page of Markdown."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from soak_programs import Program, Sample

WARM_UP_S = 360.0
"""Minimum number of seconds of each process that are excluded from the slope."""
WARM_UP_FRAMES = 10_000
"""Minimum number of published frames of each process that are also excluded.

After this number, an edge has used each kernel, buffer and cache at least once. Until then, its memory grows
by 2 MB. A slow machine publishes fewer frames in :data:`WARM_UP_S`.
"""
MAX_CORRELATION = 0.95
"""Maximum correlation of neighbouring blocks that the error of a slope takes into account."""
BLOCK_S = 10.0
"""Seconds of one block of samples."""
SAMPLE_STEP = 5
"""Every fifth sample is written to report.json: time, process, memory, handles and threads, for a chart."""
MIN_BLOCKS = 12
"""Minimum number of blocks of a process that counts."""
DAY_S = 86_400.0
"""Seconds in an uncompressed day."""


def slope(samples: Sequence[Sample], value: str) -> tuple[float, float] | None:
    """Returns the slope of a measured value per second and its standard error, None if there are too few
    samples.

    Each process of the program has its own level. The slope is common, by least squares. Memory grows in
    steps, so the deviations of neighbouring blocks are correlated. They then count as fewer independent
    blocks, as in a first-order autoregressive process.
    """
    times, values = [], []
    for life in sorted({sample.life for sample in samples}):
        own = [sample for sample in samples if sample.life == life]
        begin_s, begin_frames = own[0].at_s + WARM_UP_S, own[0].frames + WARM_UP_FRAMES
        blocks: dict[int, list[Sample]] = {}
        for sample in own:
            if sample.at_s >= begin_s and sample.frames >= begin_frames:
                blocks.setdefault(int((sample.at_s - begin_s) / BLOCK_S), []).append(sample)
        if len(blocks) < MIN_BLOCKS:
            continue
        at = np.array([np.mean([sample.at_s for sample in block]) for block in blocks.values()])
        measured = np.array([np.mean([getattr(s, value) for s in block]) for block in blocks.values()])
        times.append(at - at.mean())
        values.append(measured - measured.mean())
    if not times:
        return None
    x, y = np.concatenate(times), np.concatenate(values)
    fitted = float(x @ y / (x @ x))
    residuals = [own - fitted * at for at, own in zip(times, values, strict=True)]
    squares = sum(float(own @ own) for own in residuals)
    spread = squares / max(len(x) - len(times) - 1, 1)
    likeness = sum(float(own[1:] @ own[:-1]) for own in residuals) / squares if squares > 0.0 else 0.0
    likeness = min(max(likeness, 0.0), MAX_CORRELATION)
    return fitted, math.sqrt(spread / float(x @ x) * (1.0 + likeness) / (1.0 - likeness))


def describe_program(program: Program, seconds_per_day: float, started_s: float) -> dict[str, Any]:
    """Returns the measurements of a program.

    Args:
        seconds_per_day: seconds of a soak in which the events of one day occur.
        started_s: Unix time of the soak's start, in seconds.
    """
    fitted = slope(program.samples, "rss_mb")
    last = [sample for sample in program.samples if sample.life == program.samples[-1].life]
    return {
        "lives": program.samples[-1].life,
        "restarts": [{"at_s": round(at - started_s, 1), "reason": cause} for at, cause in program.restarts],
        "unexpected_ends": program.unexpected_ends,
        "rss_mb": _range(program.samples, "rss_mb"),
        "rss_last_mb": round(last[-1].rss_mb, 1),
        "rss_slope_mb_per_day": None if fitted is None else round(fitted[0] * seconds_per_day, 2),
        "rss_slope_error_mb_per_day": None if fitted is None else round(fitted[1] * seconds_per_day, 2),
        "rss_slope_mb_per_24h": None if fitted is None else round(fitted[0] * DAY_S, 1),
        "rss_slope_error_mb_per_24h": None if fitted is None else round(fitted[1] * DAY_S, 1),
        "handles": _range(program.samples, "handles"),
        "threads": _range(program.samples, "threads"),
        "errors": program.errors,
        "samples": [
            [round(s.at_s, 1), s.life, round(s.rss_mb, 2), s.handles, s.threads]
            for s in program.samples[::SAMPLE_STEP]
        ],
    }


def _range(samples: Sequence[Sample], value: str) -> list[float]:
    """Returns the minimum, the median and the maximum of a value."""
    values = [getattr(sample, value) for sample in samples]
    return [round(float(each), 1) for each in (min(values), np.median(values), max(values))]


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Writes report.json and report.md."""
    (folder / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    (folder / "report.md").write_text(_markdown(report))


def _markdown(report: dict[str, Any]) -> str:
    bodies = report["published"].get("bodies", 0)
    lines = [
        f"# Soak of {report['minutes']:g} minutes, seed {report['seed']}",
        "",
        f"**{report['hours']:.2f} simulated opening hours** of a day of {report['day_hours']:g} hours. "
        f"They are limited by the kind of event that is furthest behind: {report['limited_by']}.",
        "",
        f"Published: {bodies} frames of people, {report['published'].get('pose', 0)} poses. A camera of 30 "
        f"frames per second sends that number of frames in {report['frame_hours']:.2f} hours. "
        f"Longest silence: {report['longest_silence_s']:.1f} s. Full disk: {report['disk']}.",
        "",
        "| event | occurred | per day |",
        "|---|---|---|",
        *(f"| {kind} | {report['counts'].get(kind, 0)} | {per} |" for kind, per in report["per_day"].items()),
        "",
        "| program | lives | memory MB (least, median, most) | slope MB/simulated day | slope MB/24 h "
        "| handles | threads | errors |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, each in report["programs"].items():
        rates = (_with_error(each, f"rss_slope{{}}_mb_per_{day}") for day in ("day", "24h"))
        lines.append(
            f"| {name} | {each['lives']} | {_join(each['rss_mb'])} | {' | '.join(rates)} | "
            f"{_join(each['handles'])} | "
            f"{_join(each['threads'])} | {len(each['errors'])} |"
        )
    lines += ["", f"Requests of guests: {report['requests']}.", "", "## Faults", ""]
    lines += [f"- {fault}" for fault in report["faults"]] or ["None."]
    lines += ["", "## Restarts", ""]
    for name, each in report["programs"].items():
        lines += [f"- {name}, {restart['at_s']} s: {restart['reason']}" for restart in each["restarts"]]
    lines += ["", "## Silences longer than two seconds", ""]
    lines += [f"- {each['length_s']:.1f} s until {each['at_s']:.0f} s" for each in report["silences"]]
    lines += ["", "## Error lines of the logs", ""]
    lines += [f"    {line}" for each in report["programs"].values() for line in each["errors"]]
    lines += ["", "## Events", ""]
    lines += [f"- {event['at_s']:.1f} s: {event['kind']} {event['detail']}" for event in report["events"]]
    return "\n".join(lines) + "\n"


def _with_error(program: Mapping[str, Any], key: str) -> str:
    """Returns a slope with its standard error as text. ``key`` contains a placeholder for the word
    "error".
    """
    value = program[key.format("")]
    return "too short" if value is None else f"{value:g} ± {program[key.format('_error')]:g}"


def _join(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
