"""The command ``enliven doctor``: checks this machine, a running edge or an installation, and suggests a
remedy for each fault."""

from __future__ import annotations

import json
import os
from pathlib import Path

import typer
from rich.table import Table

from enliven.commands.terminal import make_plain_console, make_plain_text
from enliven.doctor import Check, run_all_checks
from enliven.errors import ResourceError
from enliven.health import Severity

_FAILED_CHECK_EXIT_CODE = 4
"""Exit code if a check fails. It equals the exit code 4 of :class:`enliven.errors.ResourceError`."""

_SEE_BELOW = "The problem is described in a row below."
"""The remedy for an edge or a program with a problem. The problem is listed as a separate check."""
MAX_HEARTBEAT_WAIT_S = 5.0
"""Maximum time to wait for a heartbeat of an edge, in seconds. An edge sends ten heartbeats in this time."""

SEARCH_S = 2.5
"""Duration of a search for edges, in seconds. Most edges answer within a second, but some answer only a
second query.
"""


def doctor(
    as_json: bool = typer.Option(False, "--json", help="Print the results as JSON, for scripts."),
    remote: str = typer.Option(
        "",
        "--remote",
        metavar="HOST[:PORT]|URL",
        help="Check the edge at this host, or the installation at this address of a health page.",
    ),
    edges: bool = typer.Option(False, "--edges", help="List the edges on the local network."),
    password_file: Path | None = typer.Option(
        None, "--password-file", help="File with the password of the health page."
    ),
    certificate: Path | None = typer.Option(
        None, "--certificate", help="Certificate (PEM) of the health page to trust."
    ),
) -> None:
    """Check this machine (OpenGL, ports, sensors, permissions), and suggest a remedy for each problem.

    With --remote HOST, the command checks a running edge instead: its sensor, rate and delay, and the
    problems that the edge reports. The edge can be on this or another machine. With the address of a health
    page, the command checks a whole installation. The password comes from --password-file or
    ENLIVEN_HEALTH_PASSWORD. With --edges, the command lists the edges and relays on the local network, with
    their addresses.

    The exit code is 0 if no problem was found, and 4 otherwise.

    \b
      enliven doctor
      enliven doctor --json | python -m json.tool
      enliven doctor --remote 127.0.0.1
      enliven doctor --remote http://127.0.0.1:5590
      enliven doctor --edges
    """
    if edges:
        checks = check_announced_edges()
    elif "://" in remote and not remote.startswith("tcp://"):
        checks = check_installation(remote, password_file, certificate)
    else:
        checks = edge_checks(remote) if remote else run_all_checks()
    if as_json:
        typer.echo(json.dumps([_check_as_json(check) for check in checks], indent=2))
    else:
        make_plain_console().print(_check_table(checks))
    if not all(check.ok for check in checks):
        raise typer.Exit(_FAILED_CHECK_EXIT_CODE)


def check_announced_edges(seconds: float = SEARCH_S, interfaces: list[str] | None = None) -> list[Check]:
    """Returns a check for each edge and relay on the local network.

    Args:
        seconds: duration of the search.
        interfaces: addresses of this machine's network interfaces to search on. None means all.

    Raises:
        ResourceError: if the required library is missing, or the network does not allow the search.
    """
    from enliven.peers.edge_browser import describe_edge, find_edges

    discovered = find_edges(seconds, interfaces)
    if not discovered:
        remedy = (
            "Start an edge with --host 0.0.0.0 on this network. If the network blocks multicast, "
            "use the edge's address instead."
        )
        return [Check("edges", False, "no edge was found on the local network", remedy)]
    return [Check(edge.announcement.name, edge.is_usable, *describe_edge(edge)) for edge in discovered]


def edge_checks(address: str) -> list[Check]:
    """Checks the edge at an address in the form HOST, HOST:PORT or HOST:PORT:CONTROL_PORT.

    Raises:
        InputError: if the address is invalid.
    """
    from enliven.wire import parse_endpoint, receive_heartbeat

    endpoint = parse_endpoint(address)
    try:
        status = receive_heartbeat(endpoint, MAX_HEARTBEAT_WAIT_S)
    except ResourceError as error:
        return [Check("edge", False, f"{error.where}: {error.what}", error.remedy)]
    people = f"{status.performers} performer{'s' * (status.performers != 1)}"
    has_ended = status.phase == "ended"
    checks = [
        Check(
            "edge",
            not has_ended,
            f"{status.edge}: {status.phase}, {people}",
            "Start the edge again." if has_ended else "",
        ),
        Check(
            "sensor",
            bool(status.sensor),
            status.sensor or "none",
            "Connect a sensor, or wait until the edge finds one.",
        ),
        Check("rate", True, f"{status.fps:.0f} poses per second, {status.dropped} frames skipped"),
        Check(
            "delay",
            True,
            f"{status.latency_p50_ms:.0f} ms (median), {status.latency_p99_ms:.0f} ms (99th percentile)",
        ),
    ]
    return checks + [
        Check(state.kind, state.severity == Severity.NOTE, state.what, state.remedy)
        for state in status.health
    ]


def check_installation(url: str, password_file: Path | None, certificate: Path | None) -> list[Check]:
    """Checks an installation by its health page.

    Args:
        url: address of the page, "https://HOST:PORT".
        password_file: file with the password. None means that the password is in an environment variable, or
            that there is none.
        certificate: trusted certificate (PEM). None means the system's certificates.

    Raises:
        InputError: if the address is invalid, a file cannot be used, or the password is missing or wrong.
    """
    from enliven.health_page.report import fetch_report
    from enliven.web_server.access import PASSWORD_VARIABLE, read_password

    password = (
        os.environ.get(PASSWORD_VARIABLE, "") if password_file is None else read_password(password_file)
    )
    try:
        report = fetch_report(url, password, certificate)
    except ResourceError as error:
        return [Check("health page", False, f"{error.where}: {error.what}", error.remedy)]
    checks = [Check("health page", True, f"{report.installation}, enliven {report.version}: {report.status}")]
    for edge in report.edges:
        people = f"{edge.people} performer{'s' * (edge.people != 1)}"
        detail = (
            f"{edge.phase}, {people}, {edge.fps or 0.0:.0f} poses per second" if edge.up else "no heartbeat"
        )
        checks.append(Check(f"edge {edge.name}", edge.up, detail, "" if edge.up else _SEE_BELOW))
    for program in report.programs:
        detail = f"process {program.pid}, {program.restarts} restarts in the last day"
        checks.append(Check(program.name, program.up, detail, "" if program.up else _SEE_BELOW))
    for problem in report.problems:
        subject = problem.subject or "computer"
        is_note = problem.severity == "note"
        checks.append(Check(f"{subject}: {problem.kind}", is_note, problem.message, problem.remedy))
    return checks


def _check_table(checks: list[Check]) -> Table:
    """Builds the table of checks. Each check has a row, and a failed check has another row with its
    remedy."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for check in checks:
        mark = make_plain_text("ok", "green") if check.ok else make_plain_text("missing", "red")
        detail = make_plain_text(check.detail)
        if not check.ok:
            detail.append("\n").append(make_plain_text(check.remedy, "yellow"))
        table.add_row(mark, make_plain_text(check.name), detail)
    return table


def _check_as_json(check: Check) -> dict[str, object]:
    """Returns a check as a JSON object. The remedy has the key "mend", because existing scripts use this
    name."""
    return {"name": check.name, "ok": check.ok, "detail": check.detail, "mend": check.remedy}
