"""Checks of the machine, which each package contributes by the entry-point group ``enliven.checks``."""

from __future__ import annotations

import platform
import socket
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points

from enliven.kernel_cache import shipped_folders, user_folder

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


def run_all_checks() -> list[Check]:
    """Runs every installed package's checks, the library's own first."""
    entries = sorted(entry_points(group="enliven.checks"), key=lambda e: (e.name != "shared", e.name))
    checks: list[Check] = []
    for entry in entries:
        try:
            contributed: Callable[[], list[Check]] = entry.load()
            checks += contributed()
        except Exception as error:  # A broken package must not hide the results of the other packages.
            checks.append(
                Check(entry.name, False, f"its checks failed: {error}", "Install the package again.")
            )
    return checks


def checks() -> list[Check]:
    """Checks Python, the compiler cache and the ports."""
    return [_check_python(), _check_compiler_cache(), *(_check_port(port) for port in DEFAULT_PORTS)]


def _check_python() -> Check:
    version = platform.python_version()
    ok = sys.version_info >= (3, 11)
    return Check(
        "Python",
        ok,
        f"{version} on {platform.system()} {platform.machine()}",
        "Install Python 3.11 or newer.",
    )


def _check_compiler_cache() -> Check:
    """Checks that compiled kernels can be kept between starts, and names where those of a release are."""
    mend = "Set NUMBA_CACHE_DIR to a folder that can be written, or every start compiles for two minutes."
    folder = user_folder()
    if folder is None:
        return Check("compiled kernels", False, "are not kept: the user has no home folder", mend)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            return Check("compiled kernels", True, f"are kept between starts; {_describe_shipped_kernels()}")
    except OSError as error:
        return Check("compiled kernels", False, f"{folder} cannot be written ({error.strerror})", mend)


def _describe_shipped_kernels() -> str:
    """Returns how many compiled kernels the installed release brings, in words."""
    count = sum(len(list(folder.glob("*.kernel"))) for folder in shipped_folders())
    return f"{count} came with the release" if count else "none came with the installation"


def _check_port(port: int) -> Check:
    """Checks that an edge could listen on this port now."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            mend = "Another edge may be running; stop it, or start with --port."
            return Check(f"port {port}", False, f"taken ({error.strerror})", mend)
    return Check(f"port {port}", True, "free")
