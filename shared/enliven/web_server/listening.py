"""Binds the port of a web server, determines its address for other computers, and limits its connections."""

from __future__ import annotations

import socket
import sys
from typing import TYPE_CHECKING, Any

from enliven.errors import ResourceError

if TYPE_CHECKING:
    import uvicorn

    from enliven.web_server.certificate import ServerCertificate

ANY_HOSTS = ("0.0.0.0", "::")
"""Network addresses that make a server listen on all addresses of its computer."""
MAX_CONNECTIONS = 100
"""Maximum number of connections of a server. Further requests get status 503."""
_MAX_HEADER_BYTES = 16 * 1024
"""Maximum size of a request's headers in bytes."""
_IDLE_TIMEOUT_S = 10
"""Time in seconds after which an idle connection is closed."""
_SHUTDOWN_TIMEOUT_S = 3
"""Maximum time to wait for unfinished responses when the program ends, in seconds."""
_BACKLOG = 64
"""Maximum number of connections that wait to be accepted."""
_HOST_ADVICE = "Use an address of this computer, 127.0.0.1 or 0.0.0.0."
"""The remedy for an invalid address."""


def bind_port(host: str, port: int, remedy: str) -> socket.socket:
    """Returns a socket that is bound to an address.

    Args:
        remedy: the remedy if the port is in use.

    Raises:
        ResourceError: if the port is in use, or the address does not belong to this computer.
    """
    where = f"{host}:{port}"
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise ResourceError(
            f"the address cannot be used ({error.strerror})", where=where, remedy=_HOST_ADVICE
        ) from None
    try:
        if sys.platform != "win32":
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        raise ResourceError(
            f"the port cannot be used ({error.strerror})", where=where, remedy=remedy
        ) from None
    return listener


def find_own_address() -> str:
    """Returns this machine's address in its network, or a loopback address without a network. Sends
    nothing.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Connecting a UDP socket only selects the network interface and sends nothing. The destination
            # address is reserved for documentation.
            probe.connect(("192.0.2.1", 9))
            address: str = probe.getsockname()[0]
        except OSError:
            return "127.0.0.1"
    return address


def format_address(host: str, port: int, *, uses_tls: bool = False) -> str:
    """Returns the address of a server for browsers, with a slash at its end.

    If the server listens on all addresses, the result contains this computer's address in its network.
    """
    name = find_own_address() if host in ANY_HOSTS else host
    scheme = "https" if uses_tls else "http"
    return f"{scheme}://[{name}]:{port}/" if ":" in name else f"{scheme}://{name}:{port}/"


def make_server(
    app: Any,
    certificate: ServerCertificate | None = None,
    *,
    max_connections: int = MAX_CONNECTIONS,
    max_message_bytes: int = 0,
) -> uvicorn.Server:
    """Returns a server for an ASGI application, with limits for slow and malicious clients.

    Args:
        certificate: the TLS certificate. None disables encryption.
        max_connections: maximum number of connections.
        max_message_bytes: maximum size of a received WebSocket message in bytes. 0 for a server without
            WebSockets.
    """
    import uvicorn

    context = None if certificate is None else certificate.context
    config = uvicorn.Config(
        app,
        http="h11",
        ws="websockets-sansio" if max_message_bytes else "none",
        ws_max_size=max_message_bytes,
        # Disable compression, because poses are already compressed and compression would cost time for each
        # client.
        ws_per_message_deflate=False,
        loop="asyncio",
        lifespan="on",
        log_config=None,
        access_log=False,
        server_header=False,
        # Ignore addresses in proxy headers, because the rate limit of passwords needs the real address.
        proxy_headers=False,
        limit_concurrency=max_connections,
        timeout_keep_alive=_IDLE_TIMEOUT_S,
        timeout_graceful_shutdown=_SHUTDOWN_TIMEOUT_S,
        h11_max_incomplete_event_size=_MAX_HEADER_BYTES,
        ssl_context_factory=None if context is None else lambda *_: context,
    )
    return uvicorn.Server(config)
