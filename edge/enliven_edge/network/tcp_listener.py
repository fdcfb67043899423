"""Opens listening TCP ports, limits connections by file descriptors, and detects vanished peers."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import socket
import struct
import sys

from enliven.errors import InputError, ResourceError

_MAX_DESCRIPTORS = 65_536
"""Maximum number of descriptors. Some systems allow a billion. Programs that close all possible descriptors
would then hang."""
_RESERVED_DESCRIPTORS = 128
"""Number of descriptors reserved for everything except connections: libraries, recordings, devices, logs."""
_MIN_CONNECTIONS = 4
"""Minimum number of connections of a server, even if hardly any descriptors are allowed."""
_DEFAULT_DESCRIPTORS = 512
"""Number of descriptors that is assumed if the system reports no limit. It is the limit of ``select`` on
Windows."""


def raise_descriptor_limit() -> int:
    """Raises the soft limit of open descriptors to the hard one. Returns the new limit."""
    if sys.platform == "win32":
        return _DEFAULT_DESCRIPTORS
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    target = _MAX_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, _MAX_DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < target:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
        except (OSError, ValueError):
            return soft
        return target
    return soft if soft != resource.RLIM_INFINITY else target


def limit_connections(max_count: int) -> int:
    """Returns the number of connections for one of two servers, at most ``max_count``.

    Some descriptors stay reserved.
    """
    if sys.platform == "win32":
        limit = _DEFAULT_DESCRIPTORS
    else:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        if limit == resource.RLIM_INFINITY:
            return max_count
    return max(_MIN_CONNECTIONS, min(max_count, (limit - _RESERVED_DESCRIPTORS) // 2))


_BACKLOG = 4096
"""Maximum number of connections that the system queues until they are accepted (it may allow fewer). In a
flood, a new connection waits in this queue instead of being rejected."""
_PROBES: dict[str, int] = {
    "TCP_KEEPIDLE": 4,
    "TCP_KEEPINTVL": 2,
    "TCP_KEEPCNT": 3,
    "TCP_USER_TIMEOUT": 10_000,
}
"""TCP keep-alive options: a peer that is silent for 4 s is probed every 2 s. It is dropped after 3 unanswered
probes, or if data stays unacknowledged for 10,000 ms."""

_SO_TIMESTAMPNS = 35
"""Linux socket option that reports when received bytes arrived. Python has no name for it."""
_TIMESPEC = struct.Struct("=qq")
"""Format of the time of arrival that 64-bit Linux reports: seconds and nanoseconds."""
_CAN_STAMP = sys.platform == "linux" and struct.calcsize("P") == 8
"""True if the system reports the time at which bytes of a TCP connection arrived."""


def is_local(host: str) -> bool:
    """Returns True if only programs on this machine can reach an address. A host name is resolved."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        pass
    if host in ("", "*"):
        return False
    try:
        addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return all(ipaddress.ip_address(str(info[4][0]).split("%")[0]).is_loopback for info in addresses)


def check_open(host: str, open_to_all: bool) -> None:
    """Raises InputError for an address that other machines can reach, unless ``open_to_all`` is set or there
    are keys.
    """
    if open_to_all or is_local(host):
        return
    raise InputError(
        "the edge has no keys, so everyone who can reach this address could watch the performers and "
        "possess characters",
        where=f"host {host or '*'}",
        remedy="Create keys with enliven keys make, start again, and pair each viewer with the shown "
        "code. To use no keys, add --insecure (insecure = true under [wire]) or --host 127.0.0.1.",
    )


def listen(host: str, port: int, option: str) -> socket.socket:
    """Returns a listening, non-blocking socket.

    Args:
        host: an address or name of this machine; "" or "*" for all of IPv6 and IPv4.
        option: the command line option of the port, for the message.

    Raises:
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """
    is_any_address = host in ("", "*")
    is_dual_stack = is_any_address and socket.has_dualstack_ipv6()
    listener: socket.socket | None = None
    try:
        name = ("::" if is_dual_stack else "0.0.0.0") if is_any_address else host
        family, *_, address = socket.getaddrinfo(name, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        reuse = "SO_EXCLUSIVEADDRUSE" if sys.platform == "win32" else "SO_REUSEADDR"
        listener.setsockopt(socket.SOL_SOCKET, getattr(socket, reuse), 1)
        if family == socket.AF_INET6:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, not is_dual_stack)
        listener.bind(address)
        listener.listen(_BACKLOG)
        listener.setblocking(False)
        return listener
    except (OSError, UnicodeError, OverflowError) as error:
        if listener is not None:
            listener.close()
        raise _listen_error(error, host, port, option) from None


def configure_socket(connection: socket.socket) -> None:
    """Makes a socket non-blocking, disables its send delay (TCP_NODELAY), and enables keep-alive probes."""
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if _CAN_STAMP:
        with contextlib.suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    for name, value in _PROBES.items():
        if hasattr(socket, name):
            with contextlib.suppress(OSError):
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def receive_stamped(connection: socket.socket, max_bytes: int) -> tuple[bytes, int]:
    """Returns received bytes, and the wall-clock time in nanoseconds at which the last of them arrived.

    The time is 0 if it is unknown.

    The time of reading is not used instead, because an edge reads its connections only once per frame, up to
    30 ms later.

    Raises:
        BlockingIOError: if nothing has arrived.
        OSError: if the connection is broken.
    """
    if not _CAN_STAMP:
        return connection.recv(max_bytes), 0
    data, notes, _, _ = connection.recvmsg(max_bytes, socket.CMSG_SPACE(_TIMESPEC.size))
    for level, kind, value in notes:
        if (level, kind, len(value)) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS, _TIMESPEC.size):
            seconds, nanoseconds = _TIMESPEC.unpack(value)
            return data, seconds * 1_000_000_000 + nanoseconds
    return data, 0


def _listen_error(error: Exception, host: str, port: int, option: str) -> ResourceError:
    """Returns the error that explains why a port cannot be opened."""
    where = f"{host}:{port}"
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return ResourceError(
            f"port {port} is in use",
            where=where,
            remedy=f"Stop the program that uses this port, or choose another port with {option} (0: a free "
            "port).",
        )
    return ResourceError(
        f"cannot listen on this address ({getattr(error, 'strerror', None) or error})",
        where=where,
        remedy="Set --host to an address of this computer, or to 0.0.0.0 for all its addresses.",
    )
