"""The state of an installation at one moment, as the page, the metrics and the alerts show it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from enliven.health import Severity
from enliven.supervision.records import RestartRecord, ServiceRecord
from enliven.wire import StatusMessage

EDGE_SILENT_AFTER_S = 5.0
"""Time without a heartbeat, in seconds, after which an edge is silent. It sends two per second."""


class ProblemKind(StrEnum):
    """The kinds of problems that the health page detects. Edges report further kinds of their own."""

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
        subject: the affected edge, program or file. Empty: the machine.
        severity: its severity. Notes of an edge are problems of severity NOTE, and change no status.
        message: the problem, one sentence.
        remedy: the remedy, one sentence.
        alerts: True if operators receive an alert about it.
    """

    kind: str
    subject: str
    severity: Severity
    message: str
    remedy: str
    alerts: bool = False


@dataclass(frozen=True)
class WatchedEdge:
    """The state of one edge.

    Attributes:
        name: its name in the profile.
        address: its address, "HOST:PORT:CONTROL_PORT".
        status: its newest heartbeat. None: none was received.
        heartbeat_age_s: time since the newest heartbeat, in seconds. None: none was received.
        frame_age_s: time since the newest result of a frame, in seconds. None: none was received.
        waiting_s: time since the newest heartbeat, or else since the first attempt to connect, in seconds.
        heard_s: time since its first heartbeat, in seconds. 0: none was received.
        fault: why heartbeats cannot be read, one sentence. Empty: no reason is known.
        remedy: the remedy for the fault.
        temperature_c: temperature of its sensor in degrees Celsius. None: unknown.
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
        rss_bytes: its resident memory in bytes. None: unknown.
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
        memory_bytes: size of the memory.
        memory_available_bytes: memory that programs can still allocate.
        disk_folder: a folder on the disk that is measured.
        disk_bytes: size of that disk.
        disk_free_bytes: free space on that disk.
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
        use: "health" for the health page, or "souvenirs" for their server.
        path: its file.
        end_s: Unix time at which it expires, in seconds. None: the file cannot be read.
        fault: why the file cannot be read. Empty: it can.
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
    edges: tuple[WatchedEdge, ...] = ()
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
