"""Checks of the machine, which each package contributes by the entry-point group ``enliven.checks``."""

from __future__ import annotations

import importlib.util
import platform
import socket
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

DEFAULT_PORTS = (5580, 5581)
"""TCP ports of the streams and of the commands: those of :mod:`enliven.wire.sockets`, which is not
imported since pyzmq may be missing."""


@dataclass(frozen=True)
class Check:
    """One check of the machine: whether it passed, the detail, and the remedy if it failed."""

    name: str
    ok: bool
    detail: str
    mend: str = ""


def all_checks() -> list[Check]:
    """Runs every installed package's checks, the library's own first."""
    found = sorted(entry_points(group="enliven.checks"), key=lambda e: (e.name != "shared", e.name))
    made: list[Check] = []
    for entry in found:
        try:
            contributed: Callable[[], list[Check]] = entry.load()
            made += contributed()
        except Exception as error:  # a broken package must not hide the results of the others
            made.append(Check(entry.name, False, f"its checks failed: {error}", "Install the package again."))
    return made


def checks() -> list[Check]:
    """Checks Python, the compiler cache and the ports."""
    return [_python(), _compiler_cache(), *(_port(port) for port in DEFAULT_PORTS)]


def _python() -> Check:
    version = platform.python_version()
    ok = sys.version_info >= (3, 11)
    return Check(
        "Python",
        ok,
        f"{version} on {platform.system()} {platform.machine()}",
        "Install Python 3.11 or newer.",
    )


def _compiler_cache() -> Check:
    """Checks that Numba can store compiled kernels, next to the sources or in the user's cache folder."""
    spec = importlib.util.find_spec("enliven")
    folder = Path(spec.origin).parent if spec and spec.origin else Path.cwd()
    try:
        with tempfile.TemporaryFile(dir=folder):
            return Check("compiled kernels", True, "are kept between starts")
    except OSError:
        mend = (
            "Set NUMBA_CACHE_DIR to a folder that can be written, or every start compiles for half a minute."
        )
        return Check("compiled kernels", False, f"{folder} cannot be written", mend)


def _port(port: int) -> Check:
    """Checks that an edge could listen on this port now."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            mend = "Another edge may be running; stop it, or start with --port."
            return Check(f"port {port}", False, f"taken ({error.strerror})", mend)
    return Check(f"port {port}", True, "free")
