"""Creates the HTML pages. Jinja escapes all text, since the names of edges and programs are untrusted."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlencode

from enliven import __version__
from enliven.errors import EnlivenError
from enliven.health import HealthState, Severity
from enliven.health_page.charts import HEIGHT, WIDTH, Chart, draw_chart
from enliven.health_page.collector import EDGE_SERIES, MACHINE_SERIES, PROGRAM_SERIES
from enliven.health_page.history import CAPACITY_MINUTES, DayHistory
from enliven.health_page.problems import find_edge_problems
from enliven.health_page.snapshot import STATUS_WORDS, HealthSnapshot, MonitoredEdge, ProblemKind
from enliven.logs import escape_text
from enliven.wire import messages_to_health

_MAX_CHARTED_EDGES = 8
"""Maximum number of edges with charts. It keeps a page with 100 edges short and fast to render."""
_MAX_EXPANDED_EDGES = 4
"""Maximum number of edges with all sections expanded. If there are more edges, only edges with problems are
expanded."""
_MAX_RESTARTS = 30
"""Maximum number of restarts on the page. The newest are shown."""
_MAX_PROBLEMS = 200
"""Maximum number of problems on the page. The most severe are shown."""
_PROGRAM_KINDS = (ProblemKind.PROGRAM_ENDED, ProblemKind.PROGRAM_FROZEN, ProblemKind.PROGRAM_RESTARTED)
"""Kinds of problems of programs. They distinguish a program from an edge with the same name."""
_UNKNOWN_TEXT = "unknown"
"""Text for a value that the system does not provide."""
_DISPLAYED_UNITS = {
    "s": "s",
    "ms": "ms",
    "mb": "MB",
    "gb": "GB",
    "c": "°C",
    "percent": "%",
    "hz": "Hz",
    "m": "m",
}
"""Units of a record's values by the suffix of the value's name."""


class PageWriter:
    """The templates of the health page."""

    def __init__(self) -> None:
        from jinja2 import Environment, PackageLoader, StrictUndefined

        self._environment = Environment(
            loader=PackageLoader("enliven.health_page"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        self._environment.filters.update(
            age=format_age,
            bytes=_format_bytes,
            clock=_format_clock,
            date=_format_date,
            edge_severity=_edge_severity,
            figures=_format_figures,
            iso=_format_iso,
            notes=_edge_notes,
            number=_format_number,
            people=_format_people,
            severity=_severity_class,
            short=_format_short,
        )
        self._charts: tuple[float, list[tuple[str, list[Chart]]]] = (-1.0, [])

    def render_health_page(
        self,
        snapshot: HealthSnapshot,
        history: DayHistory,
        log_lines: Sequence[str],
        notices: Sequence[str],
        picture_at_s: float | None,
    ) -> str:
        """Returns the health page.

        Args:
            snapshot: the state.
            history: the values of the last day.
            log_lines: the newest lines of the log.
            notices: sentences about recent actions.
            picture_at_s: Unix time of the picture of the screen, in seconds. None without a picture.
        """
        problems = [problem for problem in snapshot.problems if problem.severity > Severity.NOTE]
        return self._render_template(
            "page.html",
            title=f"{snapshot.status}: {snapshot.name}",
            state=snapshot,
            status=snapshot.status,
            summary=_summarise_problems(len(problems)),
            host=platform.node(),
            version=__version__,
            notices=notices,
            problems=problems[:_MAX_PROBLEMS],
            opens_edges=len(snapshot.edges) <= _MAX_EXPANDED_EDGES,
            machine=snapshot.machine,
            chart_groups=self._chart_groups(snapshot, history),
            chart_width=WIDTH,
            chart_height=HEIGHT,
            hidden_edges=max(0, len(snapshot.edges) - _MAX_CHARTED_EDGES),
            restarts=snapshot.restarts[:_MAX_RESTARTS],
            hidden_restarts=max(0, len(snapshot.restarts) - _MAX_RESTARTS),
            log_lines=log_lines,
            picture_s=None if picture_at_s is None else max(0.0, snapshot.at_s - picture_at_s),
            picture_key=0 if picture_at_s is None else round(1000 * picture_at_s),
            confirm_url=confirm_url,
            program_status=_program_statuses(snapshot).__getitem__,
        )

    def render_confirmation(
        self, title: str, question: str, label: str, action: str, subject: str, token: str
    ) -> str:
        """Returns the page that asks for confirmation of an action."""
        return self._render_template(
            "confirm.html",
            title=title,
            question=question,
            label=label,
            action=action,
            subject=subject,
            token=token,
        )

    def render_result(self, title: str, text: str, remedy: str = "", code: str = "") -> str:
        """Returns the page with the result of an action."""
        return self._render_template("result.html", title=title, text=text, remedy=remedy, code=code)

    def render_error(self, error: EnlivenError) -> str:
        """Returns the page for an action that failed."""
        text = f"{error.where}: {error.what}." if error.where else f"{error.what}."
        return self.render_result("The action failed", escape_text(text), escape_text(error.remedy))

    def _render_template(self, template: str, **values: Any) -> str:
        return self._environment.get_template(template).render(**values)

    def _chart_groups(self, snapshot: HealthSnapshot, history: DayHistory) -> list[tuple[str, list[Chart]]]:
        """Returns the groups of charts with their titles. The charts are redrawn once per minute."""
        minute = math.floor(snapshot.at_s / 60.0)
        subjects = (len(snapshot.edges), len(snapshot.programs))
        key = float(hash((minute, subjects, len(history.names))))
        if self._charts[0] != key:
            self._charts = (key, _draw_groups(snapshot, history))
        return self._charts[1]


def confirm_url(action: str, subject: str) -> str:
    """Returns the URL of the page that asks for confirmation of an action."""
    return f"/confirm?{urlencode({'action': action, 'subject': subject}, errors='replace')}"


def format_age(seconds: float | None) -> str:
    """Returns a duration in words, such as "0.2 s", "12 s", "3 min" or "2 days 4 h"."""
    if seconds is None or not math.isfinite(seconds):
        return _UNKNOWN_TEXT
    seconds = max(seconds, 0.0)
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if seconds < 7200.0:
        return f"{seconds / 60.0:.0f} min"
    hours = round(seconds / 3600.0)
    if hours < 48:
        return f"{hours} h"
    return f"{hours // 24} days {hours % 24} h"


def _draw_groups(snapshot: HealthSnapshot, history: DayHistory) -> list[tuple[str, list[Chart]]]:
    """Returns the charts of all edges, of the machine and of the programs."""

    def draw(prefix: str, series: Sequence[tuple[str, str, str]], label: str = "") -> list[Chart]:
        return [
            draw_chart(
                label or title,
                unit,
                history.read(
                    f"{prefix}/{key}",
                    snapshot.at_s,
                    WIDTH if CAPACITY_MINUTES % WIDTH == 0 else CAPACITY_MINUTES,
                ),
            )
            for key, title, unit in series
        ]

    groups = [
        (f"edge {edge.name}", draw(f"edge/{edge.name}", EDGE_SERIES))
        for edge in snapshot.edges[:_MAX_CHARTED_EDGES]
    ]
    groups.append(("computer", draw("machine", MACHINE_SERIES)))
    programs = [
        chart
        for program in snapshot.programs[:_MAX_CHARTED_EDGES]
        for chart in draw(f"program/{program.record.name}", PROGRAM_SERIES, program.record.name)
    ]
    if programs:
        groups.append(("memory of the programs", programs))
    return groups


def _summarise_problems(problems: int) -> str:
    """Returns a summary of the state in a few words."""
    if problems == 0:
        return "No problems"
    return "1 problem" if problems == 1 else f"{problems} problems"


def _severity_class(severity: Severity) -> str:
    """Returns the CSS class of a severity."""
    return STATUS_WORDS[severity]


def _edge_severity(edge: MonitoredEdge) -> str:
    """Returns the CSS class of an edge's most severe problem."""
    worst = max((problem.severity for problem in find_edge_problems(edge)), default=Severity.NOTE)
    return STATUS_WORDS[worst]


def _program_statuses(snapshot: HealthSnapshot) -> dict[str, str]:
    """Returns the CSS class of each program's most severe problem by its name."""
    worst = {program.record.name: Severity.NOTE for program in snapshot.programs}
    for problem in snapshot.problems:
        if problem.subject in worst and problem.kind in _PROGRAM_KINDS:
            worst[problem.subject] = max(worst[problem.subject], problem.severity)
    return {name: STATUS_WORDS[severity] for name, severity in worst.items()}


def _edge_notes(edge: MonitoredEdge) -> list[HealthState]:
    """Returns the health states of an edge that are not problems."""
    states = messages_to_health(edge.status.health) if edge.status is not None else []
    return [state for state in states if state.severity is Severity.NOTE]


def _format_people(count: int) -> str:
    return "1 person" if count == 1 else f"{count} people"


def _format_number(value: float | None, digits: int = 0, unit: str = "") -> str:
    """Returns a number with its unit."""
    if value is None or not math.isfinite(value):
        return _UNKNOWN_TEXT
    return f"{value:.{digits}f}{unit}"


def _format_short(value: float) -> str:
    """Returns a number with about three digits."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.1f}".removesuffix(".0")


def _format_bytes(value: float | None) -> str:
    """Returns a size in MB or GB."""
    if value is None or not math.isfinite(value):
        return _UNKNOWN_TEXT
    return f"{value / 1e9:.1f} GB" if value >= 1e9 else f"{value / 1e6:.0f} MB"


def _format_figures(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """Returns the values of a record with their units. The resident memory is left out, because the page
    measures it."""
    result = []
    for name, value in sorted(figures.items())[:12]:
        words = re.split(r"[_\s]+", escape_text(name)[:40])
        unit = _DISPLAYED_UNITS.get(words[-1].lower(), "") if len(words) > 1 else ""
        if name == "rss_mb":
            continue
        title = " ".join(words[:-1] if unit else words)
        result.append((title, f"{_format_short(value)} {unit}".strip()))
    return result


def _local_datetime(at_s: float) -> datetime:
    """Converts a Unix time in seconds to the time zone of this computer. Invalid times become 1970."""
    try:
        return datetime.fromtimestamp(at_s, tz=UTC).astimezone()
    except (OverflowError, ValueError, OSError):
        return datetime.fromtimestamp(0, tz=UTC)


def _format_clock(at_s: float) -> str:
    """Returns a Unix time in seconds as date and time of day."""
    return _local_datetime(at_s).strftime("%d %b, %H:%M:%S")


def _format_date(at_s: float) -> str:
    return _local_datetime(at_s).strftime("%Y-%m-%d")


def _format_iso(at_s: float) -> str:
    return _local_datetime(at_s).isoformat(timespec="seconds")
