"""Runs programs under a hook that records every host name lookup, from C++ as well as from Python."""

from __future__ import annotations

import ipaddress
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_suffix(".c")
TELEMETRY_HOST = "mobile.events.data.microsoft.com"
"""The host that ONNX Runtime reports to."""
PASSED_ON = ("PATH", "XDG_STATE_HOME", "NUMBA_CACHE_DIR")
"""Environment variables that a hooked program inherits. CI is not among them, since it disables the
telemetry."""


class NameHook:
    """A folder with the hook, and separate home and temporary folders for the programs under it."""

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not sys.platform.startswith("linux") or compiler is None:
            pytest.skip("the hook needs Linux and a C compiler")
        self.folder = folder
        self.home, self.temporary, self.log = folder / "home", folder / "tmp", folder / "names.log"
        self.past = folder / "clock-before-1970"
        self.library = folder / "name_hook.so"
        for directory in (self.home / ".cache", self.temporary):
            directory.mkdir(parents=True)
        kernels = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "enliven"
        kernels.mkdir(parents=True, exist_ok=True)
        (self.home / ".cache" / "enliven").symlink_to(kernels)
        build = [compiler, "-shared", "-fPIC", "-O1", "-o", self.library, SOURCE, "-ldl"]
        subprocess.run(build, check=True, capture_output=True)

    def start(self, *command: str | Path, **more: str) -> subprocess.Popen[str]:
        """Starts a command under the hook. ``more`` are additional environment variables."""
        given = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
        own = {
            "HOME": str(self.home),
            "TMPDIR": str(self.temporary),
            "XDG_RUNTIME_DIR": str(self.temporary),
            "XDG_CACHE_HOME": str(self.home / ".cache"),
            "LD_PRELOAD": str(self.library),
            "NAME_HOOK_LOG": str(self.log),
            "NAME_HOOK_PAST": str(self.past),
        }
        return subprocess.Popen(
            [str(word) for word in command],
            env={**given, **own, **more},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )

    def outside_names(self) -> set[str]:
        """Returns every name and address of other machines that a program has looked up or sent to."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        return {line.split(" ", 2)[2] for line in lines if not _is_of_this_machine(line.split(" ", 2)[2])}

    def telemetry_files(self) -> list[Path]:
        """Returns the files written by ONNX Runtime's telemetry."""
        cache = self.home / ".cache" / "Microsoft"
        files = [path for path in cache.rglob("*") if path.is_file()]
        return [*files, *self.temporary.glob(".ses")]


def _is_of_this_machine(name: str) -> bool:
    """Returns True if a name or address belongs to this machine: loopback, or any of its addresses."""
    try:
        address = ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return name == "localhost"
    address = getattr(address, "ipv4_mapped", None) or address
    return address.is_loopback or address.is_unspecified
