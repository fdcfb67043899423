"""Finds the problems of an installation in its measured state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

from enliven.health import HealthKind, Severity
from enliven.health_page.snapshot import (
    EDGE_SILENT_AFTER_S,
    CertificateState,
    MachineState,
    MonitoredEdge,
    Problem,
    ProblemKind,
    ProgramState,
)
from enliven.logs import escape_text
from enliven.supervision.records import RestartRecord
from enliven.wire import messages_to_health

NO_FRAMES_AFTER_S = 5.0
"""Maximum age of the newest frame, in seconds. If it is older, an edge has no frames. The slowest cameras
send five frames per second."""
FIRST_FRAME_AFTER_S = 180.0
"""Time after the first heartbeat, in seconds, after which an edge must have published a frame. On a new
machine it compiles its kernels first, which takes two minutes."""
RESTART_DISPLAY_S = 600.0
"""Time in seconds for which a restart counts as a problem. After this time, the program counts as stable."""
RECORD_INTERVAL_S = 60.0
"""Time in seconds that is added to ``frozen_after``. Programs write their records less often than they make
progress, and the supervisor needs time to restart them."""
MIN_HOT_TEMPERATURE_C = 85.0
"""Temperature limit of the computer, in degrees Celsius. Processors reduce their speed above it."""
CERTIFICATE_WARNING_DAYS = 14.0
"""Number of days before the expiry of a TLS certificate at which the warnings start. An operator can still
renew it after a week of holidays."""
_CERTIFICATE_PROGRAMS = {"health": "the health page", "souvenirs": "enliven-souvenirs"}
"""The program that must be restarted after a certificate is renewed, by the use of the certificate."""
_SECONDS_PER_DAY = 86_400.0
"""Duration of a day in seconds."""
_BYTES_PER_GIGABYTE = 1e9
"""A gigabyte in bytes."""
_NO_FRAME_KINDS = (HealthKind.NO_FRAMES, HealthKind.SENSOR_LOST, HealthKind.FROZEN)
"""Kinds of health states of an edge that imply that no frames arrive."""
_ALERT_KINDS = (*_NO_FRAME_KINDS, HealthKind.HOT)
"""Kinds of health states of an edge that cause alerts at any severity."""


def sort_problems(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Returns the problems sorted by severity, the most severe first, then by subject and kind."""
    return tuple(sorted(problems, key=lambda p: (-p.severity, p.subject, p.kind)))


def find_edge_problems(edge: MonitoredEdge) -> Iterator[Problem]:
    """Yields the problems of an edge: its silence, missing frames, and the health states that it reports."""
    if edge.waiting_s > EDGE_SILENT_AFTER_S:
        yield _create_silence_problem(edge)
        return
    if edge.status is None:
        return
    states = messages_to_health(edge.status.health)
    if edge.status.phase == "ended":
        yield Problem(
            ProblemKind.NO_FRAMES,
            edge.name,
            Severity.ERROR,
            "The edge has ended.",
            "Start the edge again.",
            alerts=True,
        )
    elif _lacks_frames(edge) and not any(state.kind in _NO_FRAME_KINDS for state in states):
        yield Problem(
            ProblemKind.NO_FRAMES,
            edge.name,
            Severity.ERROR,
            f"The edge is running, but it has published no frame for {_describe_age(edge.frame_age_s)}."
            if edge.frame_age_s is not None
            else "The edge is running, but it has published no frame since its start.",
            "Check the camera and its cable. Then restart the edge.",
            alerts=True,
        )
    for state in states:
        kind = ProblemKind.NO_FRAMES if state.kind in _NO_FRAME_KINDS else escape_text(state.kind)
        is_alert = state.severity is Severity.ERROR or (
            state.kind in _ALERT_KINDS and state.severity > Severity.NOTE
        )
        yield Problem(kind, edge.name, state.severity, state.what, state.remedy, is_alert)


def find_program_problems(
    programs: Sequence[ProgramState], restarts: Sequence[RestartRecord], at_s: float, frozen_after_s: float
) -> Iterator[Problem]:
    """Yields the problems of programs: ended, frozen, or restarted a short time ago.

    Args:
        restarts: the restarts of all programs.
        at_s: Unix time in seconds.
        frozen_after_s: time without progress in seconds until the supervisor restarts a program.
    """
    for program in programs:
        record = program.record
        idle_s = at_s - record.progress_s
        if not program.is_running:
            yield Problem(
                ProblemKind.PROGRAM_ENDED,
                record.name,
                Severity.ERROR,
                f"The program (process {record.pid}) has ended.",
                "Wait until the supervisor restarts the program. If the program does not start, read "
                "the log below.",
                alerts=True,
            )
        elif record.progress_s > 0.0 and idle_s > frozen_after_s + RECORD_INTERVAL_S:
            yield Problem(
                ProblemKind.PROGRAM_FROZEN,
                record.name,
                Severity.ERROR,
                f"The program is running, but it has made no progress for {_describe_age(idle_s)}.",
                "Restart the program.",
                alerts=True,
            )
    newest = {restart.name: restart for restart in restarts}
    for restart in newest.values():
        if 0.0 <= at_s - restart.at_s <= RESTART_DISPLAY_S:
            yield Problem(
                ProblemKind.PROGRAM_RESTARTED,
                restart.name,
                Severity.WARNING,
                f"The program was restarted. Cause: {escape_text(restart.cause) or 'unknown'}.",
                "A rare restart needs no action. If restarts are frequent, read the log.",
                alerts=True,
            )


def find_machine_problems(machine: MachineState, keep_free_gb: float) -> Iterator[Problem]:
    """Yields the problems of the computer: a full disk, and heat."""
    free = machine.disk_free_bytes
    if free is not None and free < keep_free_gb * _BYTES_PER_GIGABYTE:
        yield Problem(
            ProblemKind.DISK_FULL,
            machine.disk_folder,
            Severity.WARNING,
            f"The disk has {free / _BYTES_PER_GIGABYTE:.2f} GB of free space, but at least "
            f"{keep_free_gb:g} GB should be free.",
            "Delete unnecessary files, or move recordings to another disk.",
            alerts=True,
        )
    if machine.temperature_c is not None and machine.temperature_c > MIN_HOT_TEMPERATURE_C:
        yield Problem(
            ProblemKind.MACHINE_HOT,
            "",
            Severity.WARNING,
            f"The computer is {machine.temperature_c:.0f} °C hot, so it may run more slowly.",
            "Clean the fan and the filters of the computer, and check that air can flow.",
            alerts=True,
        )


def find_certificate_problems(certificate: CertificateState, at_s: float) -> Iterator[Problem]:
    """Yields a problem if a TLS certificate has expired, expires soon, or cannot be read.

    Args:
        at_s: Unix time in seconds.
    """
    program = _CERTIFICATE_PROGRAMS[certificate.use]
    kind, severity = ProblemKind.CERTIFICATE_EXPIRES, Severity.WARNING
    if certificate.end_s is None:
        kind = ProblemKind.CERTIFICATE_UNREADABLE
        message = f"The TLS certificate of the {certificate.use} server cannot be read: {certificate.fault}."
    else:
        days = (certificate.end_s - at_s) / _SECONDS_PER_DAY
        if days > CERTIFICATE_WARNING_DAYS:
            return
        date = datetime.fromtimestamp(certificate.end_s, tz=UTC).strftime("%Y-%m-%d")
        message = f"The TLS certificate of the {certificate.use} server expires on {date}."
        if days <= 0.0:
            # Use a separate kind of problem, so that an alert is sent although the warning already caused
            # one.
            kind, severity = ProblemKind.CERTIFICATE_EXPIRED, Severity.ERROR
            message = f"The TLS certificate of the {certificate.use} server expired on {date}."
    remedy = f"Renew the certificate, and restart {program}."
    yield Problem(kind, certificate.path, severity, message, remedy, alerts=True)


def _create_silence_problem(edge: MonitoredEdge) -> Problem:
    """Returns the problem of an edge without heartbeats, with the reason if it is known."""
    message = f"The edge at {edge.address} has sent no heartbeat for {_describe_age(edge.waiting_s)}."
    if edge.fault:
        message = f"{message[:-1]}: {edge.fault}."
    remedy = (
        edge.remedy or "Check that the edge is running, and check its address, the network and the firewall."
    )
    return Problem(ProblemKind.EDGE_SILENT, edge.name, Severity.ERROR, message, remedy, alerts=True)


def _lacks_frames(edge: MonitoredEdge) -> bool:
    """Returns True if an edge has not published a frame for some time, or has never published one since its
    start."""
    if edge.frame_age_s is None:
        return edge.heard_s > FIRST_FRAME_AFTER_S
    return edge.frame_age_s > NO_FRAMES_AFTER_S


def _describe_age(seconds: float) -> str:
    """Returns a duration in words, such as "12 s" or "3 min"."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.0f} h"
