"""``enliven relay``: forwards the streams of an edge to many viewers."""

from __future__ import annotations

import contextlib
import logging
import signal
import time
from typing import Annotated

import typer

log = logging.getLogger(__name__)

_REPORT_INTERVAL_S = 60.0
"""Seconds between two log lines with the number of viewers."""


def relay(
    edge: Annotated[
        str, typer.Argument(metavar="HOST[:PORT]", help="Address of the edge, or of another relay.")
    ],
    port: Annotated[
        int,
        typer.Option(
            min=0, max=65535, help="Network port for the viewers of this relay. 0 picks a free port."
        ),
    ] = 5600,
    control_port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Network port of the viewers' requests. By default, the port after --port."
        ),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on. 0.0.0.0 listens on all addresses.")
    ] = "127.0.0.1",
    name: Annotated[str, typer.Option(help="Name of this relay on the network.")] = "relay",
    viewers: Annotated[
        int, typer.Option(min=1, max=20_000, help="Maximum number of viewers at the same time.")
    ] = 1000,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Use no keys. Everyone who can reach --host can then watch.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="Stop after this number of seconds.")] = None,
) -> None:
    """Forward the streams of an edge to hundreds of viewers. Together they load the edge like one viewer.

    The viewers can only watch. They get the characters, the newest poses and the edge's clock from the relay.
    An edge with keys must be paired with this computer first; the role watch is enough.

    \b
      enliven relay 192.168.1.20 --host 0.0.0.0
      enliven relay 127.0.0.1 --port 5600
      enliven view --edge 127.0.0.1:5600
    """
    from enliven.wire import parse_endpoint
    from enliven_edge.commands.progress import handle_signals
    from enliven_edge.network.access import open_access
    from enliven_edge.network.announcing import announce
    from enliven_edge.network.tcp_listener import raise_descriptor_limit
    from enliven_edge.relay.relay import Relay, relay_settings

    wire = relay_settings(name, host, port, control_port, insecure)
    access = open_access(wire)
    raise_descriptor_limit()
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True

    started = reported = time.monotonic()
    with contextlib.ExitStack() as stack:
        opened = stack.enter_context(Relay(parse_endpoint(edge), wire, access, viewers))
        announcer = announce(wire, opened.endpoint, has_keys=access is not None, relay_of=edge)
        if announcer is not None:
            stack.enter_context(announcer)
        with handle_signals(stop, signal.SIGINT, signal.SIGTERM):
            log.info("%s listens on %s and relays %s", name, opened.endpoint, edge)
            if access is not None:
                access.open_pairing()
            while not stopped and (seconds is None or time.monotonic() - started < seconds):
                opened.poll()
                if time.monotonic() - reported > _REPORT_INTERVAL_S:
                    reported = time.monotonic()
                    log.info("%d viewers", opened.viewers)
