"""Decides which problems operators hear of: once per problem, with a quiet time, and when it is over."""

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
"""Time without a problem, in seconds, after which it is over. A loose cable comes and goes within seconds."""
ALERT_AFTER_S = 10.0
"""Duration of a problem, in seconds, after which operators hear of it. A program that restarts is silent for
some seconds, and its restart is a problem of its own."""
_MAX_REMEMBERED = 1000
"""Maximum number of problems that are remembered. An edge that reports ever new kinds cannot fill the
memory."""

Event = Literal["problem", "recovered", "test"]
"""Kinds of alerts: a problem has begun, it is over, or an operator tries the delivery."""


class Alert(msgspec.Struct, frozen=True):
    """One message to the operators.

    Attributes:
        event: kind of the alert.
        installation: name of the installation.
        host: name of the computer.
        at: time in UTC, ISO 8601.
        kind: kind of the problem.
        subject: the affected edge, program or file. Empty: the machine.
        severity: "note", "warning" or "error".
        message: the problem, one sentence.
        remedy: the remedy, one sentence.
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
class _Watched:
    """A problem that is or was present.

    Attributes:
        problem: its newest description.
        begun_s: time at which it began, in seconds of the monotonic clock.
        seen_s: time at which it was last present.
        sent_s: time of the last alert about its begin. None: there was none.
        is_open: True between the alert about its begin and the one about its end.
    """

    problem: Problem
    begun_s: float
    seen_s: float
    sent_s: float | None = None
    is_open: bool = False


class AlertDesk:
    """The rules of alerts.

    Args:
        installation: name of the installation.
        quiet_s: shortest time between two alerts about the begin of the same problem, in seconds.
    """

    def __init__(self, installation: str, quiet_s: float) -> None:
        self._installation, self._quiet_s = installation, quiet_s
        self._watched: dict[tuple[str, str], _Watched] = {}

    def update(self, problems: Iterable[Problem], clock_s: float, at_s: float) -> list[Alert]:
        """Returns the alerts that the present problems cause.

        Args:
            problems: all present problems. Those with ``alerts`` False are ignored.
            clock_s: time in seconds of the monotonic clock.
            at_s: Unix time in seconds, for the text of the alerts.
        """
        for problem in problems:
            if problem.alerts:
                self._see(problem, clock_s)
        alerts = []
        for watched in self._watched.values():
            is_present = watched.seen_s == clock_s
            if is_present and self._is_due(watched, clock_s):
                watched.is_open, watched.sent_s = True, clock_s
                alerts.append(make_alert("problem", self._installation, watched.problem, at_s))
            elif watched.is_open and clock_s - watched.seen_s >= RECOVERED_AFTER_S:
                watched.is_open = False
                alerts.append(make_alert("recovered", self._installation, watched.problem, at_s))
        self._watched = {key: each for key, each in self._watched.items() if self._matters(each, clock_s)}
        return alerts

    def _see(self, problem: Problem, clock_s: float) -> None:
        """Stores a present problem."""
        key = (str(problem.kind), problem.subject)
        watched = self._watched.get(key)
        if watched is not None:
            if clock_s - watched.seen_s >= RECOVERED_AFTER_S:
                watched.begun_s = clock_s
            watched.problem, watched.seen_s = problem, clock_s
        elif len(self._watched) < _MAX_REMEMBERED:
            self._watched[key] = _Watched(problem, clock_s, clock_s)

    def _is_due(self, watched: _Watched, clock_s: float) -> bool:
        """Returns True if operators should hear of the begin of a present problem."""
        is_quiet = watched.sent_s is not None and clock_s - watched.sent_s < self._quiet_s
        return not watched.is_open and not is_quiet and clock_s - watched.begun_s >= ALERT_AFTER_S

    def _matters(self, watched: _Watched, clock_s: float) -> bool:
        """Returns True if a problem may still cause an alert, or prevent one."""
        is_quiet = watched.sent_s is not None and clock_s - watched.sent_s < self._quiet_s
        return watched.is_open or is_quiet or clock_s - watched.seen_s < RECOVERED_AFTER_S
