"""Decides which alerts are sent: one when a problem begins and one when it ends, with a minimum time between
alerts about the same problem."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import msgspec

from enliven.health_page.snapshot import STATUS_WORDS, Problem
from enliven.logs import escape_text

RECOVERED_AFTER_S = 15.0
"""Time in seconds without a problem after which the problem has ended. It is longer than the interruptions of
a loose cable."""
ALERT_AFTER_S = 10.0
"""Duration of a problem, in seconds, after which an alert is sent. A program that restarts is silent for a
shorter time, and the restart itself is reported as another problem."""
_MAX_REMEMBERED = 1000
"""Maximum number of stored problems. It limits the memory if an edge reports many different kinds."""

Event = Literal["problem", "recovered", "test"]
"""Kinds of alerts: a problem has begun, a problem has ended, or an operator tests the delivery."""


class Alert(msgspec.Struct, frozen=True):
    """One message to the operators.

    Attributes:
        event: kind of the alert.
        installation: name of the installation.
        host: name of the computer.
        at: time in UTC, ISO 8601.
        kind: kind of the problem.
        subject: the affected edge, program or file. Empty means the computer.
        severity: "note", "warning" or "error".
        message: one sentence about the problem.
        remedy: one sentence about the remedy.
    """

    event: Event
    installation: str
    host: str
    at: str
    kind: str
    subject: str
    severity: str
    message: str
    remedy: str

    def json(self) -> bytes:
        """Returns the alert as one JSON object."""
        return msgspec.json.encode(self)


def make_alert(event: Event, installation: str, problem: Problem, at_s: float) -> Alert:
    """Returns the alert about a problem.

    Args:
        at_s: Unix time in seconds.
    """
    word = STATUS_WORDS[problem.severity]
    return Alert(
        event=event,
        installation=escape_text(installation),
        host=escape_text(platform.node()),
        at=datetime.fromtimestamp(at_s, tz=UTC).isoformat(timespec="seconds"),
        kind=escape_text(str(problem.kind)),
        subject=escape_text(problem.subject),
        severity="note" if word == "ok" else word,
        message=escape_text(problem.message),
        remedy=escape_text(problem.remedy),
    )


@dataclass
class _TrackedProblem:
    """The state of a problem that exists or existed.

    Attributes:
        problem: its newest description.
        begun_s: time at which it began, in seconds of the monotonic clock.
        seen_s: time at which it last existed, in seconds of the monotonic clock.
        sent_s: time of the last alert about its begin, in seconds of the monotonic clock. None if there was
            none.
        is_open: True between the alert about its begin and the alert about its end.
    """

    problem: Problem
    begun_s: float
    seen_s: float
    sent_s: float | None = None
    is_open: bool = False


class AlertRules:
    """Applies the rules that decide which alerts are sent.

    Args:
        installation: name of the installation.
        quiet_s: minimum time between two alerts about the begin of the same problem, in seconds.
    """

    def __init__(self, installation: str, quiet_s: float) -> None:
        self._installation, self._quiet_s = installation, quiet_s
        self._watched: dict[tuple[str, str], _TrackedProblem] = {}

    def update(self, problems: Iterable[Problem], clock_s: float, at_s: float) -> list[Alert]:
        """Updates the state of all problems. Returns the alerts to send.

        Args:
            problems: all current problems. Those with ``alerts`` False are ignored.
            clock_s: time in seconds of the monotonic clock.
            at_s: Unix time in seconds, for the text of the alerts.
        """
        for problem in problems:
            if problem.alerts:
                self._record_problem(problem, clock_s)
        alerts = []
        for watched in self._watched.values():
            is_present = watched.seen_s == clock_s
            if is_present and self._is_due(watched, clock_s):
                watched.is_open, watched.sent_s = True, clock_s
                alerts.append(make_alert("problem", self._installation, watched.problem, at_s))
            elif watched.is_open and clock_s - watched.seen_s >= RECOVERED_AFTER_S:
                watched.is_open = False
                alerts.append(make_alert("recovered", self._installation, watched.problem, at_s))
        self._watched = {
            key: alert for key, alert in self._watched.items() if self._may_cause_alert(alert, clock_s)
        }
        return alerts

    def _record_problem(self, problem: Problem, clock_s: float) -> None:
        """Stores the state of a current problem."""
        key = (str(problem.kind), problem.subject)
        watched = self._watched.get(key)
        if watched is not None:
            if clock_s - watched.seen_s >= RECOVERED_AFTER_S:
                watched.begun_s = clock_s
            watched.problem, watched.seen_s = problem, clock_s
        elif len(self._watched) < _MAX_REMEMBERED:
            self._watched[key] = _TrackedProblem(problem, clock_s, clock_s)

    def _is_due(self, watched: _TrackedProblem, clock_s: float) -> bool:
        """Returns True if an alert about the begin of a current problem must be sent now."""
        is_quiet = watched.sent_s is not None and clock_s - watched.sent_s < self._quiet_s
        return not watched.is_open and not is_quiet and clock_s - watched.begun_s >= ALERT_AFTER_S

    def _may_cause_alert(self, watched: _TrackedProblem, clock_s: float) -> bool:
        """Returns True if a stored problem may still cause or prevent an alert. Otherwise it can be
        deleted."""
        is_quiet = watched.sent_s is not None and clock_s - watched.sent_s < self._quiet_s
        return watched.is_open or is_quiet or clock_s - watched.seen_s < RECOVERED_AFTER_S
