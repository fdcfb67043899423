"""The number of files and connections that this process may open."""

from __future__ import annotations

import sys

_ENOUGH = 65_536
"""Descriptors at most: beyond it some systems allow a billion, and programs that close "all of them" hang."""
_OTHERS = 128
"""Descriptors reserved for everything but connections: libraries, recordings, devices, logs."""
_FEWEST = 4
"""Connections of a server at least, where hardly any descriptors are allowed."""
_UNKNOWN = 512
"""Descriptors assumed where the system does not state them, such as on Windows: the limit of ``select``
there."""


def raise_descriptor_limit() -> int:
    """Raises the soft limit of open descriptors to the hard one; returns the limit from now on."""
    if sys.platform == "win32":
        return _UNKNOWN
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _ENOUGH if hard == resource.RLIM_INFINITY else min(hard, _ENOUGH)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        except (OSError, ValueError):
            return soft
        return wanted
    return soft if soft != resource.RLIM_INFINITY else wanted


def connections_allowed(most: int) -> int:
    """Returns the connections that one of two servers may take, at most ``most``, so that descriptors are
    left."""
    if sys.platform == "win32":
        limit = _UNKNOWN
    else:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        if limit == resource.RLIM_INFINITY:
            return most
    return max(_FEWEST, min(most, (limit - _OTHERS) // 2))
