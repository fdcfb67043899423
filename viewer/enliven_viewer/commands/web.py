"""enliven web: shows the live characters of an edge on a web page."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from enliven.commands.processes import terminate_as_interrupt
from enliven.commands.terminal import print_line
from enliven.errors import ResourceError

DEFAULT_PORT = 5588
"""Default TCP port of the web page. It follows the ports of the edge."""

_LIBRARIES = ("starlette", "uvicorn", "websockets", "segno", "cryptography")
"""The libraries of the optional extra "web"."""


def web(
    edge: Annotated[
        str, typer.Argument(help="Address of the edge: HOST, HOST:PORT or HOST:PORT:CONTROL_PORT.")
    ] = "127.0.0.1",
    host: Annotated[
        str, typer.Option(help="Network address to listen on. 0.0.0.0 lets phones in the network connect.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the web page. 0 uses any free port.")
    ] = DEFAULT_PORT,
    certificate: Annotated[
        Path | None,
        typer.Option(
            help="TLS certificate (PEM file). Required for other machines, unless --insecure is set."
        ),
    ] = None,
    certificate_key: Annotated[
        Path | None, typer.Option(help="Private key of the certificate (PEM file).")
    ] = None,
    insecure: Annotated[
        bool,
        typer.Option(
            "--insecure", help="Let everyone on the network watch without encryption or a password."
        ),
    ] = False,
) -> None:
    """Show the live characters of an edge on a web page, for browsers on laptops and phones.

    \b
      enliven web                                  the edge on this machine: open the printed address
      enliven web 192.168.1.20                     an edge on the network
      enliven web --host 0.0.0.0 --insecure        phones in the network may watch: scan the printed code

    The page only shows the edge and cannot control it. Ctrl-C ends the command.
    """
    # Heavy modules are imported only here, so that `--help` is quick.
    from enliven.wire import parse_endpoint

    _require_libraries()
    from enliven_viewer.web.access import load_access
    from enliven_viewer.web.server import WebServer

    address = str(parse_endpoint(edge))
    access = load_access(host, insecure, certificate, certificate_key)
    server = WebServer(address, access, port)
    print_line(f"enliven: the edge at {edge} can be watched at {server.link}")
    if not access.is_local:
        _print_code(server.link)
    with terminate_as_interrupt():
        server.run()


def _require_libraries() -> None:
    """Raises ResourceError if a library of the extra is not installed."""
    missing_libraries = [name for name in _LIBRARIES if importlib.util.find_spec(name) is None]
    if missing_libraries:
        raise ResourceError(
            f"these packages are not installed: {', '.join(missing_libraries)}",
            where="enliven web",
            remedy='Install the extra: pip install "enliven-viewer[web]" '
            '(from a checkout: pip install "./viewer[web]").',
        )


def _print_code(link: str) -> None:
    """Prints the QR code of an address for phones."""
    import segno

    segno.make(link, micro=False).terminal(compact=True, border=1)
