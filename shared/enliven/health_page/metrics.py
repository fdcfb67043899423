"""The metrics of an installation in Prometheus' format. :data:`METRICS` defines and documents all of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from enliven import __version__
from enliven.health_page.snapshot import STATUS_WORDS, HealthSnapshot

if TYPE_CHECKING:
    from prometheus_client.core import Metric as PrometheusMetric


@dataclass(frozen=True)
class HealthMetric:
    """The definition of a metric.

    Attributes:
        name: name of the metric, which ends with the unit, or with "_total" for counters.
        kind: "gauge" for a current value, "counter" for a value that only increases, "info" for texts.
        labels: names of its labels.
        doc: one sentence about its meaning.
    """

    name: str
    kind: Literal["gauge", "counter", "info"]
    labels: tuple[str, ...]
    doc: str


METRICS = (
    HealthMetric(
        "enliven_info",
        "info",
        ("version", "installation"),
        "Version of enliven, and name of the installation.",
    ),
    HealthMetric("enliven_status", "gauge", (), "0: no warning and no error. 1: a warning. 2: an error."),
    HealthMetric("enliven_problems", "gauge", ("severity",), "Number of current problems."),
    HealthMetric("enliven_problem", "gauge", ("kind", "subject", "severity"), "1 for each current problem."),
    HealthMetric(
        "enliven_edge_up", "gauge", ("edge",), "1 if the edge sent a heartbeat in the last 5 seconds."
    ),
    HealthMetric(
        "enliven_edge_heartbeat_age_seconds", "gauge", ("edge",), "Time since the last heartbeat of the edge."
    ),
    HealthMetric(
        "enliven_edge_frame_age_seconds", "gauge", ("edge",), "Time since the last frame of the edge."
    ),
    HealthMetric(
        "enliven_edge_frames_per_second", "gauge", ("edge",), "Frames that the edge publishes per second."
    ),
    HealthMetric(
        "enliven_edge_latency_seconds",
        "gauge",
        ("edge", "quantile"),
        "Delay from reading a frame to publishing its poses: median (0.5) and 99th percentile (0.99).",
    ),
    HealthMetric("enliven_edge_people", "gauge", ("edge",), "Number of people in view."),
    HealthMetric(
        "enliven_edge_dropped_frames_total",
        "counter",
        ("edge",),
        "Frames dropped since the start of the edge.",
    ),
    HealthMetric(
        "enliven_edge_temperature_celsius", "gauge", ("edge",), "Temperature of the sensor, if known."
    ),
    HealthMetric("enliven_program_up", "gauge", ("program",), "1 if the program's process exists."),
    HealthMetric(
        "enliven_program_start_time_seconds", "gauge", ("program",), "Unix time of the start of the program."
    ),
    HealthMetric(
        "enliven_program_progress_age_seconds",
        "gauge",
        ("program",),
        "Time since the program last reported progress.",
    ),
    HealthMetric(
        "enliven_program_resident_memory_bytes", "gauge", ("program",), "Resident memory of the program."
    ),
    HealthMetric(
        "enliven_program_restarts_total",
        "counter",
        ("program",),
        "Restarts of the program since the start of the health page.",
    ),
    HealthMetric("enliven_machine_temperature_celsius", "gauge", (), "Highest temperature of the computer."),
    HealthMetric("enliven_machine_memory_bytes", "gauge", (), "Size of the computer's memory."),
    HealthMetric(
        "enliven_machine_memory_available_bytes", "gauge", (), "Memory that programs can still allocate."
    ),
    HealthMetric("enliven_machine_load", "gauge", (), "Mean number of running processes in the last minute."),
    HealthMetric("enliven_disk_bytes", "gauge", (), "Size of the disk that stores the recordings."),
    HealthMetric(
        "enliven_disk_free_bytes", "gauge", (), "Free space on the disk that stores the recordings."
    ),
    HealthMetric(
        "enliven_certificate_expiry_time_seconds",
        "gauge",
        ("use",),
        "Unix time at which a TLS certificate expires: of the page (health) or of the souvenirs (souvenirs).",
    ),
    HealthMetric(
        "enliven_alerts_sent_total", "counter", (), "Alerts delivered since the start of the health page."
    ),
    HealthMetric("enliven_alert_failures_total", "counter", (), "Failed attempts to deliver an alert."),
)
"""All metrics, in the order of the output."""

Sample = tuple[str, tuple[str, ...], float]
"""A value: the metric's name, the values of its labels, and the number."""
_SECONDS_PER_MILLISECOND = 1e-3
"""A millisecond in seconds."""


@dataclass(frozen=True)
class HealthCounters:
    """Counters of the health page since its start.

    Attributes:
        restarts: number of restarts by program.
        alerts_sent: number of delivered alerts.
        alert_failures: number of failed attempts to deliver an alert.
    """

    restarts: dict[str, int]
    alerts_sent: int = 0
    alert_failures: int = 0


def metrics_text(snapshot: HealthSnapshot, counts: HealthCounters) -> tuple[bytes, str]:
    """Returns the metrics as text, and its media type."""
    from prometheus_client import CollectorRegistry
    from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
    from prometheus_client.registry import Collector

    class SnapshotCollector(Collector):
        """A Prometheus collector for the metrics of one snapshot."""

        def collect(self) -> Iterable[PrometheusMetric]:
            """Returns all metrics that have values."""
            return _metric_families(_collect_samples(snapshot, counts))

    registry = CollectorRegistry(auto_describe=False)
    registry.register(SnapshotCollector())
    return generate_latest(registry), CONTENT_TYPE_LATEST


def metrics_table() -> str:
    """Returns the table of all metrics in Markdown, for the documentation."""
    rows = [
        f"| `{metric.name}` | {metric.kind} | {', '.join(metric.labels)} | {metric.doc} |"
        for metric in METRICS
    ]
    return "\n".join(["| metric | kind | labels | meaning |", "|---|---|---|---|", *rows])


def _metric_families(samples: Iterable[Sample]) -> Iterator[PrometheusMetric]:
    """Yields the metrics in :data:`METRICS` with their values. Metrics without values are left out."""
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily

    values: dict[str, list[tuple[tuple[str, ...], float]]] = {}
    for name, labels, value in samples:
        values.setdefault(name, []).append((labels, value))
    for metric in METRICS:
        if metric.name not in values:
            continue
        if metric.kind == "info":
            info = InfoMetricFamily(metric.name.removesuffix("_info"), metric.doc)
            for labels, _ in values[metric.name]:
                info.add_metric([], dict(zip(metric.labels, labels, strict=True)))
            yield info
            continue
        kind = CounterMetricFamily if metric.kind == "counter" else GaugeMetricFamily
        family = kind(metric.name.removesuffix("_total"), metric.doc, labels=list(metric.labels))
        for labels, value in values[metric.name]:
            family.add_metric(list(labels), value)
        yield family


def _collect_samples(snapshot: HealthSnapshot, counts: HealthCounters) -> Iterator[Sample]:
    """Yields the known values of all metrics."""
    yield "enliven_info", (__version__, snapshot.name), 1.0
    yield "enliven_status", (), float(snapshot.severity)
    for severity, word in STATUS_WORDS.items():
        count = sum(problem.severity is severity for problem in snapshot.problems)
        yield "enliven_problems", ("note" if word == "ok" else word,), float(count)
    for kind, subject, severity in dict.fromkeys(
        (problem.kind, problem.subject, problem.severity) for problem in snapshot.problems
    ):
        word = STATUS_WORDS[severity]
        yield "enliven_problem", (str(kind), subject, "note" if word == "ok" else word), 1.0
    yield from _edge_samples(snapshot)
    yield from _program_samples(snapshot)
    for program, restarts in sorted(counts.restarts.items()):
        yield "enliven_program_restarts_total", (program,), float(restarts)
    machine = snapshot.machine
    optional = {
        "enliven_machine_temperature_celsius": machine.temperature_c,
        "enliven_machine_memory_bytes": machine.memory_bytes,
        "enliven_machine_memory_available_bytes": machine.memory_available_bytes,
        "enliven_machine_load": machine.load,
        "enliven_disk_bytes": machine.disk_bytes,
        "enliven_disk_free_bytes": machine.disk_free_bytes,
        "enliven_alerts_sent_total": float(counts.alerts_sent),
        "enliven_alert_failures_total": float(counts.alert_failures),
    }
    yield from ((name, (), value) for name, value in optional.items() if value is not None)
    for certificate in snapshot.certificates:
        if certificate.end_s is not None:
            yield "enliven_certificate_expiry_time_seconds", (certificate.use,), certificate.end_s


def _edge_samples(snapshot: HealthSnapshot) -> Iterator[Sample]:
    """Yields the values of the edges. Values of a silent edge are left out, since they are outdated."""
    for edge in snapshot.edges:
        name = (edge.name,)
        yield "enliven_edge_up", name, float(edge.is_up)
        if edge.heartbeat_age_s is not None:
            yield "enliven_edge_heartbeat_age_seconds", name, edge.heartbeat_age_s
        if edge.frame_age_s is not None:
            yield "enliven_edge_frame_age_seconds", name, edge.frame_age_s
        if edge.temperature_c is not None:
            yield "enliven_edge_temperature_celsius", name, edge.temperature_c
        if edge.status is None or not edge.is_up:
            continue
        status = edge.status
        yield "enliven_edge_frames_per_second", name, status.fps
        yield (
            "enliven_edge_latency_seconds",
            (edge.name, "0.5"),
            status.latency_p50_ms * _SECONDS_PER_MILLISECOND,
        )
        yield (
            "enliven_edge_latency_seconds",
            (edge.name, "0.99"),
            status.latency_p99_ms * _SECONDS_PER_MILLISECOND,
        )
        yield "enliven_edge_people", name, float(status.performers)
        yield "enliven_edge_dropped_frames_total", name, float(status.dropped)


def _program_samples(snapshot: HealthSnapshot) -> Iterator[Sample]:
    """Yields the values of the programs."""
    for program in snapshot.programs:
        record = program.record
        name = (record.name,)
        yield "enliven_program_up", name, float(program.is_running)
        yield "enliven_program_start_time_seconds", name, record.started_s
        if record.progress_s > 0.0:
            yield "enliven_program_progress_age_seconds", name, snapshot.at_s - record.progress_s
        if program.rss_bytes is not None:
            yield "enliven_program_resident_memory_bytes", name, program.rss_bytes
