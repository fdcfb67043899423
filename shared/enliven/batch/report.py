"""Writes the HTML report of a batch: finished pairs with their quality, and failures with their reasons.

While the batch runs, the page reloads itself every few seconds, so it also shows the progress.
"""

from __future__ import annotations

import html
import os
import statistics
import urllib.parse
from collections.abc import Iterable, Sequence
from pathlib import Path

from enliven.batch.jobs import JobResult
from enliven.files import write_file

_REFRESH_S = 5
"""Interval at which the page of a running batch reloads itself, in seconds."""
_COLUMNS = {
    "pose_deg": ("pose error", "{:.1f}\u00b0"),
    "slide_cm_s": ("foot slide", "{:.1f} cm/s"),
    "stretch": ("stretch", "{:.2f}"),
    "floor": ("floor distance", "{:.1%}"),
    "inside": ("self-intersection", "{:.1%}"),
}
"""Columns of the table: title and format of each measure."""
_STYLE_SHEET = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 96rem; padding: 0 1rem;
       color: #222; background: #fff }
table { border-collapse: collapse; width: 100% } th, td { text-align: left; padding: .3rem .6rem;
       border-bottom: 1px solid #ddd; vertical-align: top } td.number { text-align: right;
       font-variant-numeric: tabular-nums; white-space: nowrap }
th { position: sticky; top: 0; background: #fff } .failed { color: #a40000 } .fault { color: #8a5a00 }
.bar { background: #e4e4e4; border-radius: 4px; height: 12px } .bar div { background: #2f7d5b; height: 12px;
       border-radius: 4px } .wide { overflow-x: auto } img { width: 20rem }
       th:last-child { min-width: 20rem }
@media (prefers-color-scheme: dark) { body, th { background: #1b1b1b; color: #ddd } .failed { color: #ff8a80 }
       .fault { color: #ffc46b }
       a { color: #8ab4f8 } th, td { border-color: #444 } .bar { background: #444 } }
"""


def write_report(path: Path, results: Sequence[JobResult], total: int, *, running: bool = False) -> None:
    """Writes the report, completely or not at all.

    Args:
        results: the results up to now.
        total: number of jobs of the plan.
        running: True while jobs remain. In this case the page reloads itself.

    Raises:
        ResourceError: if it cannot be written.
    """
    ordered_results = sorted(
        results, key=lambda result: (not result.problem, not result.faults, result.job.output)
    )
    refresh = f'<meta http-equiv="refresh" content="{_REFRESH_S}">' if running else ""
    page = f"""<!doctype html><html lang="en"><head><meta charset="utf-8">{refresh}
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Batch: {len(results)} of {total}</title>
<style>{_STYLE_SHEET}</style></head><body><h1>Batch retargeting</h1>
{_format_summary(results, total, running)}
<div class="wide"><table><thead><tr><th>motion</th><th>character</th><th>result</th><th>length</th>
{"".join(f"<th>{title}</th>" for title, _ in _COLUMNS.values())}<th>remarks</th></tr></thead><tbody>
{"".join(_format_row(result, path.parent) for result in ordered_results)}
</tbody></table></div></body></html>
"""
    write_file(path, page)


def _format_summary(results: Sequence[JobResult], total: int, running: bool) -> str:
    """Returns the counts, the progress bar and the medians of all measures."""
    failed = sum(bool(result.problem) for result in results)
    faulty = sum(bool(result.faults) for result in results)
    earlier_count = sum(not result.is_new for result in results)
    spent = sum(result.took_s for result in results if result.is_new)
    done_percent = 100.0 * len(results) / max(total, 1)
    state = "running" if running else "ended" if len(results) == total else "stopped early"
    medians = ", ".join(
        f"{title} {form.format(statistics.median(values))}"
        for name, (title, form) in _COLUMNS.items()
        if (values := [result.measures[name] for result in results if name in result.measures])
    )
    return f"""<p>{len(results)} of {total} pairs, {state}: <b class="failed">{failed} failed</b>,
<span class="fault">{faulty} with visible faults</span>, {earlier_count} from earlier runs.
Processing time of the new results: {spent:.0f} s.</p>
<div class="bar"><div style="width:{done_percent:.1f}%"></div></div>
<p>{"Medians: " + html.escape(medians) + "." if medians else ""}</p>"""


def _format_row(result: JobResult, folder: Path) -> str:
    """Returns the row of one result."""
    job, output = result.job, Path(result.job.output)
    link = urllib.parse.quote(Path(os.path.relpath(output, folder)).as_posix())
    file = f'<a href="{link}">{html.escape(output.name)}</a>' if result.output_digest else "none"
    if result.output_digest and job.sheet:
        sheet = urllib.parse.quote(Path(os.path.relpath(job.sheet_path, folder)).as_posix())
        file += f'<br><a href="{sheet}"><img loading="lazy" src="{sheet}" alt="six frames of the result"></a>'
    length = f"{result.measures['seconds']:.1f} s" if "seconds" in result.measures else ""
    cells = [
        form.format(result.measures[name]) if name in result.measures else ""
        for name, (_, form) in _COLUMNS.items()
    ]
    numbers = "".join(f'<td class="number">{text}</td>' for text in (length, *cells))
    remarks = [
        *_format_remarks("failed", [result.problem] if result.problem else []),
        *_format_remarks("fault", result.faults),
        *_format_remarks("", result.notes),
    ]
    names = "".join(f"<td>{html.escape(Path(name).stem)}</td>" for name in (job.motion, job.character))
    return f"<tr>{names}<td>{file}</td>{numbers}<td>{''.join(remarks)}</td></tr>\n"


def _format_remarks(kind: str, sentences: Iterable[str]) -> list[str]:
    return [f'<div class="{kind}">{html.escape(sentence)}</div>' for sentence in sentences]
