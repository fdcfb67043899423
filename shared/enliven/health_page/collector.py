"""Collects the state of edges, programs and the computer, once per second."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from enliven.errors import EnlivenError
from enliven.files import user_data_folder
from enliven.health import Severity
from enliven.health_page.edge_monitor import EdgeMonitor
from enliven.health_page.history import DayHistory
from enliven.health_page.machine import is_running, read_machine, resident_bytes
from enliven.health_page.problems import (
    find_certificate_problems,
    find_edge_problems,
    find_machine_problems,
    find_program_problems,
    sort_problems,
)
from enliven.health_page.snapshot import (
    CertificateState,
    HealthSnapshot,
    MachineState,
    MonitoredEdge,
    Problem,
    ProblemKind,
    ProgramState,
)
from enliven.kiosk.profile import KioskEdge, KioskProfile
from enliven.supervision.records import (
    RestartRecord,
    ServiceRecord,
    read_restarts,
    read_services,
    runtime_folder,
)
from enliven.web_server.certificate import ServerCertificate, read_end
from enliven.wire import Endpoint

log = logging.getLogger(__name__)

REFRESH_INTERVAL_S = 1.0
"""Interval in seconds at which the state is collected."""
SAVE_INTERVAL_S = 3600.0
"""Interval in seconds at which the history file is written. A power failure loses the values since the last
write."""
HISTORY_FILE = "health-history.msgpack"
"""Name of the history file in the user's data folder."""
EDGE_SERIES = (("fps", "frame rate", "/s"), ("latency", "delay (99 %)", "ms"), ("people", "people", ""))
"""Charted values of each edge: key, title and unit."""
MACHINE_SERIES = (
    ("temperature", "temperature", "°C"),
    ("memory", "memory in use", "%"),
    ("disk", "disk free", "GB"),
    ("load", "load", ""),
)
"""Charted values of the computer: key, title and unit."""
PROGRAM_SERIES = (("rss", "memory", "MB"),)
"""Charted values of each program: key, title and unit."""
_DAY_S = 86_400.0
"""Duration of a day in seconds."""
_TEMPERATURE_FIGURE = "temperature_c"
"""Name of the value in an edge's service record that contains the temperature of its sensor."""


class HealthCollector:
    """The state of an installation, and its history.

    Only one thread at a time may call the methods, except :meth:`close`.

    Args:
        profile: the profile of the installation.
        certificate: the TLS certificate of the health page, or None.

    Attributes:
        snapshot: the newest state.
        history: the values of the last day.
        restart_counts: for each program, its number of restarts since the start of this program.

    Raises:
        InputError: if the address of an edge is invalid.
    """

    def __init__(self, profile: KioskProfile, certificate: ServerCertificate | None = None) -> None:
        self._profile = profile
        self._certificate = certificate
        self._edges = EdgeMonitor(profile.edges or {"edge": KioskEdge()})
        self._history_path = user_data_folder() / HISTORY_FILE
        self._known_restarts: set[RestartRecord] | None = None
        self._saved_s = time.monotonic()
        self._has_warned = False
        self.history = DayHistory()
        self.history.load(self._history_path)
        self.restart_counts: dict[str, int] = {}
        self.snapshot = HealthSnapshot(profile.name, time.time())

    @property
    def endpoints(self) -> Mapping[str, Endpoint]:
        """The addresses of the edges by name."""
        return self._edges.endpoints

    def refresh(self, faults: Sequence[Problem] = ()) -> bool:
        """Updates :attr:`snapshot`. Receives heartbeats for :data:`REFRESH_INTERVAL_S`, and reads all other
        values.

        Args:
            faults: problems that other parts of the program report.

        Returns:
            True if a heartbeat or the records were read, which counts as progress of this program.
        """
        heartbeats = self._edges.poll(REFRESH_INTERVAL_S)
        at_s = time.time()
        problems = list(faults)
        records, restarts, has_records = self._read_records(problems)
        programs = tuple(_create_program_state(record, restarts) for record in records)
        edges = tuple(_with_temperature(edge, records) for edge in self._edges.states())
        machine = read_machine(self._find_measured_folder())
        for edge in edges:
            problems += find_edge_problems(edge)
        care = self._profile.care
        problems += find_program_problems(programs, restarts, at_s, care.frozen_after)
        problems += find_machine_problems(machine, care.keep_free)
        certificates = tuple(self._read_certificates())
        for certificate in certificates:
            problems += find_certificate_problems(certificate, at_s)
        self.snapshot = HealthSnapshot(
            name=self._profile.name,
            at_s=at_s,
            edges=edges,
            programs=programs,
            restarts=tuple(reversed(restarts)),
            machine=machine,
            problems=sort_problems(problems),
            certificates=certificates,
        )
        self.history.add(at_s, _series_values(edges, programs, machine))
        self._save_if_due()
        return heartbeats > 0 or has_records

    def close(self) -> None:
        """Writes the history, and closes all connections."""
        self._save_history()
        self._edges.close()

    def _read_records(self, problems: list[Problem]) -> tuple[list[ServiceRecord], list[RestartRecord], bool]:
        """Returns the records of programs, the restarts of the last day (the oldest first), and True if both
        were read."""
        try:
            records = read_services(runtime_folder())
            restarts = read_restarts()
        except (EnlivenError, OSError) as error:
            reason = error.what if isinstance(error, EnlivenError) else error.strerror or "unknown"
            problems.append(
                Problem(
                    ProblemKind.NO_RECORDS,
                    "",
                    Severity.WARNING,
                    f"The status records of the programs cannot be read ({reason}).",
                    "Check that ENLIVEN_RUNTIME (the runtime folder) is the same for all programs.",
                )
            )
            return [], [], False
        self._count_restarts(restarts)
        now_s = time.time()
        return records, [restart for restart in restarts if abs(now_s - restart.at_s) <= _DAY_S], True

    def _read_certificates(self) -> Iterator[CertificateState]:
        """Yields the TLS certificates of the health page and of the souvenir server, if they use TLS.

        The page loads its certificate when it starts. The certificate of the souvenir server is read from its
        file.
        """
        if self._certificate is not None:
            yield CertificateState("health", str(self._certificate.path), self._certificate.end_s)
        souvenir = self._profile.souvenir
        if not (souvenir.kind and souvenir.certificate):
            return
        try:
            yield CertificateState("souvenirs", souvenir.certificate, read_end(Path(souvenir.certificate)))
        except EnlivenError as error:
            yield CertificateState("souvenirs", souvenir.certificate, None, error.what)

    def _count_restarts(self, restarts: Sequence[RestartRecord]) -> None:
        """Adds new restarts to :attr:`restart_counts`."""
        present = set(restarts)
        if self._known_restarts is not None:
            for restart in present - self._known_restarts:
                self.restart_counts[restart.name] = self.restart_counts.get(restart.name, 0) + 1
        self._known_restarts = present

    def _find_measured_folder(self) -> Path:
        """Returns the folder on the disk that is measured: the folder of the recordings, or otherwise the
        user's data folder."""
        recordings = self._profile.care.recordings
        return Path(recordings) if recordings else user_data_folder()

    def _save_if_due(self) -> None:
        if time.monotonic() - self._saved_s >= SAVE_INTERVAL_S:
            self._save_history()

    def _save_history(self) -> None:
        """Writes the history. A write error is logged once and is never fatal."""
        self._saved_s = time.monotonic()
        try:
            self.history.save(self._history_path)
        except (EnlivenError, OSError) as error:
            if not self._has_warned:
                log.warning("The values for the charts of the last day cannot be stored: %s", error)
            self._has_warned = True


def _create_program_state(record: ServiceRecord, restarts: Sequence[RestartRecord]) -> ProgramState:
    """Returns the state of a program."""
    rss_mb = record.figures.get("rss_mb")
    rss_bytes = resident_bytes(record.pid)
    if rss_bytes is None and rss_mb is not None:
        rss_bytes = rss_mb * 1e6
    count = sum(restart.name == record.name for restart in restarts)
    return ProgramState(record, is_running(record.pid), rss_bytes, count)


def _with_temperature(edge: MonitoredEdge, records: Sequence[ServiceRecord]) -> MonitoredEdge:
    """Returns an edge's state with the temperature from the edge's service record."""
    names = {edge.name, f"edge {edge.name}"}
    for record in records:
        if record.name in names and _TEMPERATURE_FIGURE in record.figures:
            return replace(edge, temperature_c=record.figures[_TEMPERATURE_FIGURE])
    return edge


def _series_values(
    edges: Sequence[MonitoredEdge], programs: Sequence[ProgramState], machine: MachineState
) -> dict[str, float | None]:
    """Returns the current values of all series by name."""
    values: dict[str, float | None] = {
        "machine/temperature": machine.temperature_c,
        "machine/load": machine.load,
        "machine/disk": None if machine.disk_free_bytes is None else machine.disk_free_bytes / 1e9,
    }
    if machine.memory_bytes and machine.memory_available_bytes is not None:
        values["machine/memory"] = 100.0 * (1.0 - machine.memory_available_bytes / machine.memory_bytes)
    for edge in edges:
        if edge.status is not None and edge.is_up:
            values[f"edge/{edge.name}/fps"] = edge.status.fps
            values[f"edge/{edge.name}/latency"] = edge.status.latency_p99_ms
            values[f"edge/{edge.name}/people"] = float(edge.status.performers)
    for program in programs:
        values[f"program/{program.record.name}/rss"] = (
            None if program.rss_bytes is None else program.rss_bytes / 1e6
        )
    return values
