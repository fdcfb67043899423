"""The state of an installation at one time. It is the input of the page, the metrics and the alerts."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from enliven.health import Severity
from enliven.supervision.records import RestartRecord, ServiceRecord
from enliven.wire import StatusMessage

EDGE_SILENT_AFTER_S = 5.0
"""Time without a heartbeat, in seconds, after which an edge counts as silent. An edge sends two heartbeats
per second."""


class ProblemKind(StrEnum):
    """The kinds of problems that the health page detects. Edges report further kinds."""

    EDGE_SILENT = "edge silent"
    NO_FRAMES = "no frames"
    PROGRAM_RESTARTED = "program restarted"
    PROGRAM_ENDED = "program ended"
    PROGRAM_FROZEN = "program frozen"
    DISK_FULL = "disk almost full"
    MACHINE_HOT = "machine hot"
    CERTIFICATE_EXPIRES = "certificate expires"
    CERTIFICATE_EXPIRED = "certificate expired"
    CERTIFICATE_UNREADABLE = "certificate unreadable"
    NO_RECORDS = "records unreadable"
    ALERTS_FAIL = "alerts not delivered"


@dataclass(frozen=True)
class Problem:
    """One problem of an installation.

    Attributes:
        kind: a :class:`ProblemKind`, or the kind of a health state that an edge reports.
        subject: the affected edge, program or file. Empty means the computer.
        severity: its severity. Notes of an edge are problems of severity NOTE, which do not change the
            status.
        message: one sentence about the problem.
        remedy: one sentence about the remedy.
        alerts: True if operators receive an alert about it.
    """

    kind: str
    subject: str
    severity: Severity
    message: str
    remedy: str
    alerts: bool = False


@dataclass(frozen=True)
class MonitoredEdge:
    """The state of one edge.

    Attributes:
        name: its name in the profile.
        address: its address, "HOST:PORT:CONTROL_PORT".
        status: its newest heartbeat. None if no heartbeat was received.
        heartbeat_age_s: time since the newest heartbeat, in seconds. None if no heartbeat was received.
        frame_age_s: time since the newest frame's result arrived, in seconds. None if none was received.
        waiting_s: time since the newest heartbeat, in seconds. Without a heartbeat, it is the time since the
            first attempt to connect.
        heard_s: time since its first heartbeat, in seconds. 0 if no heartbeat was received.
        fault: one sentence about the reason why heartbeats cannot be read. Empty if no reason is known.
        remedy: the remedy for the fault.
        temperature_c: temperature of its sensor in degrees Celsius. None if unknown.
    """

    name: str
    address: str
    status: StatusMessage | None = None
    heartbeat_age_s: float | None = None
    frame_age_s: float | None = None
    waiting_s: float = 0.0
    heard_s: float = 0.0
    fault: str = ""
    remedy: str = ""
    temperature_c: float | None = None

    @property
    def is_up(self) -> bool:
        """True if heartbeats arrive."""
        return self.status is not None and self.waiting_s <= EDGE_SILENT_AFTER_S


@dataclass(frozen=True)
class ProgramState:
    """The state of one supervised program.

    Attributes:
        record: the record that the program wrote.
        is_running: True if its process exists.
        rss_bytes: its resident memory in bytes. None if unknown.
        restarts: number of its restarts in the last day.
    """

    record: ServiceRecord
    is_running: bool
    rss_bytes: float | None = None
    restarts: int = 0


@dataclass(frozen=True)
class MachineState:
    """The state of the computer. A value is None if the system does not provide it.

    Attributes:
        temperature_c: highest temperature of its thermal zones, in degrees Celsius.
        memory_bytes: size of the memory in bytes.
        memory_available_bytes: memory that programs can still allocate, in bytes.
        disk_folder: a folder on the disk that is measured.
        disk_bytes: size of this disk in bytes.
        disk_free_bytes: free space on this disk in bytes.
        load: mean number of running processes in the last minute.
        processors: number of processors.
        uptime_s: time since the start of the computer, in seconds.
    """

    temperature_c: float | None = None
    memory_bytes: float | None = None
    memory_available_bytes: float | None = None
    disk_folder: str = ""
    disk_bytes: float | None = None
    disk_free_bytes: float | None = None
    load: float | None = None
    processors: int = 1
    uptime_s: float | None = None


@dataclass(frozen=True)
class CertificateState:
    """A TLS certificate of the installation.

    Attributes:
        use: "health" for the health page, or "souvenirs" for the souvenir server.
        path: path of the certificate's file.
        end_s: Unix time at which it expires, in seconds. None if the file cannot be read.
        fault: the reason why the file cannot be read. Empty if it can be read.
    """

    use: Literal["health", "souvenirs"]
    path: str
    end_s: float | None
    fault: str = ""


@dataclass(frozen=True)
class HealthSnapshot:
    """The state of an installation.

    Attributes:
        name: name of the installation.
        at_s: Unix time in seconds.
        edges: the edges, in the order of the profile.
        programs: the programs that wrote a record, sorted by name.
        restarts: restarts of the last day, the newest first.
        machine: the computer of the health page.
        problems: all problems, the most severe first.
        certificates: the TLS certificates of the installation.
    """

    name: str
    at_s: float
    edges: tuple[MonitoredEdge, ...] = ()
    programs: tuple[ProgramState, ...] = ()
    restarts: tuple[RestartRecord, ...] = ()
    machine: MachineState = field(default_factory=MachineState)
    problems: tuple[Problem, ...] = ()
    certificates: tuple[CertificateState, ...] = ()

    @property
    def severity(self) -> Severity:
        """The severity of the most severe problem."""
        return max((problem.severity for problem in self.problems), default=Severity.NOTE)

    @property
    def status(self) -> str:
        """The state in one word: "ok", "warning" or "error"."""
        return STATUS_WORDS[self.severity]


STATUS_WORDS = {Severity.NOTE: "ok", Severity.WARNING: "warning", Severity.ERROR: "error"}
"""The word for each severity."""
