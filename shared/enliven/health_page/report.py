"""Writes the state of an installation as JSON for scripts, and reads it for ``enliven doctor --remote
URL``."""

from __future__ import annotations

import base64
import ssl
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import msgspec

from enliven import __version__
from enliven.errors import InputError, ResourceError
from enliven.files import DECODE_ERRORS
from enliven.health_page.snapshot import STATUS_WORDS, HealthSnapshot, MonitoredEdge
from enliven.keys.key_files import is_loopback
from enliven.web_server.access import PASSWORD_VARIABLE

REPORT_PATH = "/health"
"""Path of the report on the health page."""
_MAX_REPORT_BYTES = 4 << 20
"""Maximum size in bytes of a report that is read. A report about 100 edges has 100,000 bytes."""
_TIMEOUT_S = 10.0
"""Timeout, in seconds, of the connection and of each part of the response."""
_MAX_ITEMS = 10_000
"""Maximum number of problems, edges or programs in a report."""
_UNAVAILABLE = 503
"""HTTP status of a report with errors."""

Text = Annotated[str, msgspec.Meta(max_length=2000)]


class ReportedProblem(msgspec.Struct, frozen=True):
    """One problem. ``severity`` is "note", "warning" or "error"."""

    kind: Text
    subject: Text
    severity: Text
    message: Text
    remedy: Text


class ReportedEdge(msgspec.Struct, frozen=True):
    """One edge. Ages are in seconds, latencies in milliseconds. Unknown values are None."""

    name: Text
    address: Text
    up: bool
    sensor: Text = ""
    phase: Text = ""
    heartbeat_age_s: float | None = None
    frame_age_s: float | None = None
    fps: float | None = None
    latency_p50_ms: float | None = None
    latency_p99_ms: float | None = None
    people: int | None = None
    dropped: int | None = None


class ReportedProgram(msgspec.Struct, frozen=True):
    """One program. Times are Unix times in seconds. Unknown values are None."""

    name: Text
    pid: int
    up: bool
    started_s: float
    progress_s: float
    restarts: int
    rss_bytes: float | None = None


class HealthReport(msgspec.Struct, frozen=True):
    """The state of an installation. ``status`` is "ok", "warning" or "error"."""

    status: Text
    installation: Text
    version: Text
    at: Text
    problems: Annotated[list[ReportedProblem], msgspec.Meta(max_length=_MAX_ITEMS)]
    edges: Annotated[list[ReportedEdge], msgspec.Meta(max_length=_MAX_ITEMS)]
    programs: Annotated[list[ReportedProgram], msgspec.Meta(max_length=_MAX_ITEMS)]


def make_report(snapshot: HealthSnapshot) -> HealthReport:
    """Returns the report of a state."""
    return HealthReport(
        status=snapshot.status,
        installation=snapshot.name,
        version=__version__,
        at=datetime.fromtimestamp(snapshot.at_s, tz=UTC).isoformat(timespec="seconds"),
        problems=[
            ReportedProblem(
                str(problem.kind),
                problem.subject,
                STATUS_WORDS[problem.severity].replace("ok", "note"),
                problem.message,
                problem.remedy,
            )
            for problem in snapshot.problems
        ],
        edges=[_create_edge_report(edge) for edge in snapshot.edges],
        programs=[
            ReportedProgram(
                name=program.record.name,
                pid=program.record.pid,
                up=program.is_running,
                started_s=program.record.started_s,
                progress_s=program.record.progress_s,
                restarts=program.restarts,
                rss_bytes=program.rss_bytes,
            )
            for program in snapshot.programs
        ],
    )


def _create_edge_report(edge: MonitoredEdge) -> ReportedEdge:
    """Returns the report of one edge."""
    base = ReportedEdge(
        name=edge.name,
        address=edge.address,
        up=edge.is_up,
        heartbeat_age_s=edge.heartbeat_age_s,
        frame_age_s=edge.frame_age_s,
    )
    status = edge.status
    if status is None:
        return base
    return msgspec.structs.replace(
        base,
        sensor=status.sensor,
        phase=status.phase,
        fps=status.fps,
        latency_p50_ms=status.latency_p50_ms,
        latency_p99_ms=status.latency_p99_ms,
        people=status.performers,
        dropped=status.dropped,
    )


def fetch_report(url: str, password: str = "", authority: Path | None = None) -> HealthReport:
    """Reads the report of a health page.

    Args:
        url: address of the health page, "https://HOST:PORT" or, on this machine, "http://127.0.0.1:PORT".
        password: password of the health page. If empty, no password is sent.
        authority: file with trusted certificates (PEM), such as the page's self-signed certificate. None
            means the system's certificates.

    Raises:
        InputError: if the address is invalid, or the password is wrong or would be sent unencrypted.
        ResourceError: if the page does not answer, or its certificate is not trusted.
    """
    from http.client import HTTPException
    from urllib.error import URLError
    from urllib.request import HTTPHandler, HTTPSHandler, OpenerDirector, Request

    request = Request(_report_url(url, bool(password)), headers={"User-Agent": "enliven"})
    if password:
        credentials = base64.b64encode(f"enliven:{password}".encode()).decode()
        request.add_header("Authorization", f"Basic {credentials}")
    opener = OpenerDirector()
    # Do not follow redirects, so that the password is sent only to the given host.
    for handler in (HTTPHandler(), HTTPSHandler(context=_client_context(authority))):
        opener.add_handler(handler)
    try:
        with opener.open(request, timeout=_TIMEOUT_S) as answer:
            status, data = int(answer.status), answer.read(_MAX_REPORT_BYTES + 1)
    except (OSError, HTTPException, ValueError) as error:
        raise _connection_error(url, error.reason if isinstance(error, URLError) else error) from None
    if status in (401, 429):
        reason = (
            "the password of the health page is missing or wrong"
            if status == 401
            else "too many wrong passwords were sent to the health page"
        )
        remedy = (
            f"Set the variable {PASSWORD_VARIABLE}, or use --password-file."
            if status == 401
            else "Wait a minute."
        )
        raise InputError(reason, where=url, remedy=remedy)
    if status not in (200, _UNAVAILABLE):
        raise ResourceError(
            f"the server answers with HTTP status {status} instead of a health report",
            where=url,
            remedy="Check the address of the health page.",
        )
    try:
        if len(data) > _MAX_REPORT_BYTES:
            raise msgspec.ValidationError("the health report is too large")
        return msgspec.json.decode(data, type=HealthReport)
    except DECODE_ERRORS:
        raise ResourceError(
            "the server's answer is not a health report",
            where=url,
            remedy="Check the address, and check that both computers have the same version of enliven.",
        ) from None


def _report_url(url: str, has_password: bool) -> str:
    """Returns the URL of the report. Raises InputError if the address is invalid or the password would be
    sent unencrypted."""
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError:
        host = None
    if not host or parts.scheme not in ("http", "https") or parts.path.strip("/") or not url.isprintable():
        raise InputError(f"{url!r} is not the address of a health page", remedy="Write https://HOST:PORT.")
    if has_password and parts.scheme == "http" and not is_loopback(host):
        raise InputError(
            "the password would be sent over the network without encryption",
            where=url,
            remedy="Write https:// at the start of the address.",
        )
    return f"{parts.scheme}://{parts.netloc}{REPORT_PATH}"


def _client_context(authority: Path | None) -> ssl.SSLContext:
    """Returns a TLS context for a client that trusts the given certificates."""
    if authority is None:
        return ssl.create_default_context()
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", "") or "the file does not contain a certificate"
        raise InputError(
            f"the certificate file cannot be used ({reason})",
            where=str(authority),
            remedy="Choose a certificate file (PEM).",
        ) from None


def _connection_error(url: str, reason: object) -> ResourceError:
    """Returns the error that describes a failed connection."""
    if isinstance(reason, ssl.SSLCertVerificationError):
        return ResourceError(
            f"the certificate of the health page is not trusted ({reason.verify_message})",
            where=url,
            remedy="To trust the page's own certificate, use --certificate FILE.",
        )
    return ResourceError(
        f"the health page does not answer ({reason})",
        where=url,
        remedy="Start the health page on that computer: enliven health PROFILE. Check the address, "
        "the port and the firewall.",
    )
