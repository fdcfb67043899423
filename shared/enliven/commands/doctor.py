"""The command ``enliven doctor``: checks this machine or a running edge, and gives the remedy for each
fault."""

from __future__ import annotations

import json

import typer
from rich.table import Table

from enliven.commands.terminal import plain_console, plain_text
from enliven.doctor import Check, run_all_checks
from enliven.errors import ResourceError
from enliven.health import Severity

_FAILED_CHECK_EXIT_CODE = 4
"""Exit code if a check fails. It equals the exit code 4 of :class:`enliven.errors.ResourceError`."""

MAX_HEARTBEAT_WAIT_S = 5.0
"""Maximum wait for a heartbeat of an edge, in seconds. An edge sends ten heartbeats in this time."""


def doctor(
    as_json: bool = typer.Option(False, "--json", help="Print the checks as JSON, for scripts."),
    remote: str = typer.Option("", "--remote", metavar="HOST[:PORT]", help="Check the edge that runs there."),
) -> None:
    """Report what this machine has and lacks (OpenGL, ports, sensors, permissions), and how to fix it.

    With --remote it checks a running edge instead, here or on another machine, by its heartbeat: its
    sensor, rate and delay, and everything that it reports as wrong.

    Ends with exit code 0 if all is well, 4 if something is missing or wrong.

    \b
      enliven doctor
      enliven doctor --json | python -m json.tool
      enliven doctor --remote 127.0.0.1
    """
    checks = edge_checks(remote) if remote else run_all_checks()
    if as_json:
        typer.echo(json.dumps([vars(check) for check in checks], indent=2))
    else:
        plain_console().print(_check_table(checks))
    if not all(check.ok for check in checks):
        raise typer.Exit(_FAILED_CHECK_EXIT_CODE)


def edge_checks(address: str) -> list[Check]:
    """Checks the edge at an address, HOST or HOST:PORT or HOST:PORT:CONTROL_PORT.

    Raises:
        InputError: if the address is invalid.
    """
    from enliven.wire import parse_endpoint, receive_heartbeat

    endpoint = parse_endpoint(address)
    try:
        status = receive_heartbeat(endpoint, MAX_HEARTBEAT_WAIT_S)
    except ResourceError as error:
        return [Check("edge", False, f"{error.where}: {error.what}", error.mend)]
    people = f"{status.performers} performer{'s' * (status.performers != 1)}"
    ended = status.phase == "ended"
    checks = [
        Check(
            "edge", not ended, f"{status.edge}: {status.phase}, {people}", "Start it again." if ended else ""
        ),
        Check(
            "sensor", bool(status.sensor), status.sensor or "none", "Connect one, or wait until it is found."
        ),
        Check("rate", True, f"{status.fps:.0f} poses a second, {status.dropped} frames skipped"),
        Check(
            "delay",
            True,
            f"{status.latency_p50_ms:.0f} ms (median), {status.latency_p99_ms:.0f} ms (99th percentile)",
        ),
    ]
    return checks + [
        Check(state.kind, state.severity == Severity.NOTE, state.what, state.mend) for state in status.health
    ]


def _check_table(checks: list[Check]) -> Table:
    """Builds the table of checks: one row each, with the remedy below a check that failed."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for check in checks:
        mark = plain_text("ok", "green") if check.ok else plain_text("missing", "red")
        detail = plain_text(check.detail)
        if not check.ok:
            detail.append("\n").append(plain_text(check.mend, "yellow"))
        table.add_row(mark, plain_text(check.name), detail)
    return table
