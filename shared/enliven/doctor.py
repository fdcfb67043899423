"""Checks of the machine. Each package provides its checks through the entry-point group
``enliven.checks``."""

from __future__ import annotations

import importlib.util
import os
import platform
import socket
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points

from enliven.errors import ResourceError
from enliven.kernel_cache.store import find_shipped_folders, user_folder

DEFAULT_PORTS = (5580, 5581)
"""Default TCP ports of the streams and of the requests. They equal those in :mod:`enliven.wire.sockets`,
which is not imported, because pyzmq may be missing."""


@dataclass(frozen=True)
class Check:
    """The result of one check of the machine: a flag that is True if it passed, a detail, and the remedy if
    it failed."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""


def run_all_checks() -> list[Check]:
    """Runs the checks of all installed packages. The checks of this library come first."""
    entries = sorted(entry_points(group="enliven.checks"), key=lambda e: (e.name != "shared", e.name))
    checks: list[Check] = []
    for entry in entries:
        try:
            contributed: Callable[[], list[Check]] = entry.load()
            checks += contributed()
        except Exception as error:  # An error in one package must not hide the results of the other packages.
            checks.append(
                Check(
                    entry.name,
                    False,
                    f"the checks of this package failed: {error}",
                    "Install the package again.",
                )
            )
    return checks


def checks() -> list[Check]:
    """Checks Python, the cache of compiled kernels, and the ports."""
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
    """Checks that compiled kernels can be stored between starts, and reports the kernels that a release
    contains."""
    remedy = "Set NUMBA_CACHE_DIR to a writable folder. Otherwise, each start compiles for two minutes."
    folder = user_folder()
    if folder is None:
        return Check(
            "compiled kernels", False, "kernels are not stored, because the user has no home folder", remedy
        )
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            detail = (
                f"kernels are stored between starts; {_describe_shipped_kernels()}; "
                f"{_describe_native_kernels()}"
            )
            return Check("compiled kernels", True, detail)
    except OSError as error:
        return Check(
            "compiled kernels", False, f"the folder {folder} cannot be written ({error.strerror})", remedy
        )


def _describe_shipped_kernels() -> str:
    """Returns a phrase with the number of compiled kernels that the installed release contains."""
    count = sum(len(list(folder.glob("*.kernel"))) for folder in find_shipped_folders())
    return (
        f"the release contains {count} compiled kernels"
        if count
        else "the installation contains no compiled kernels"
    )


def _describe_native_kernels() -> str:
    """Returns a phrase about the programs with kernels that are compiled for this exact processor."""
    try:
        from enliven.kernel_cache.native_set import is_native_code_enabled, list_stored_sets
        from enliven.kernel_cache.target import host_processor, processor_levels

        processor, levels = host_processor()[0], processor_levels()
        sets = [str(kernels) for kernels in list_stored_sets()]
    except ImportError as error:
        return f"Numba cannot be loaded: {error}"
    if fixed := os.environ.get("NUMBA_CPU_NAME"):
        return f"programs use machine code for {fixed}, as set by NUMBA_CPU_NAME"
    level = f"programs use machine code for {levels[0] if levels else processor}"
    if not is_native_code_enabled():
        return f"{level}, and do not compile code for {processor}"
    if not sets:
        return f"{level}, and compile code for {processor} in the background after some time"
    return f"{'; '.join(sets)}; other {level}"


def _check_port(port: int) -> Check:
    """Checks that the port is free for an edge."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            remedy = "Another edge may be running. Stop it, or start the edge with --port."
            return Check(f"port {port}", False, f"already in use ({error.strerror})", remedy)
    return Check(f"port {port}", True, "free")


def need(module: str, extra: str, where: str, package: str = "enliven-edge") -> None:
    """Raises ResourceError if an optional library is not installed. The message contains the installation
    command.

    Args:
        package: the package with the optional dependency group ``extra``.
    """
    if importlib.util.find_spec(module) is None:
        folder = package.removeprefix("enliven-").replace("enliven", "shared")
        raise ResourceError(
            f"the library {module!r} is not installed",
            where=where,
            remedy=f'Type: pip install "{package}[{extra}]" (in a checkout: pip install '
            f'"./{folder}[{extra}]").',
        )
