"""The sets of kernels that are compiled, or must still be compiled, for this exact processor. There is one
set per program.

A release contains kernels for processor levels. Code for the exact processor (native code) is faster on some
processors. After a program has run for some time, native code is compiled in the background
(:mod:`~enliven.kernel_cache.native_schedule`). When all kernels of earlier sessions are compiled, later
sessions use native code. The target does not change during a session.

If the environment variable ``ENLIVEN_NATIVE_KERNELS`` is ``off``, native code is disabled. If it is ``on``,
native code is enabled on every processor, also in continuous integration.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import tempfile
from pathlib import Path

import llvmlite.binding

from enliven import __version__
from enliven.kernel_cache.program import PROGRAM_VARIABLE
from enliven.kernel_cache.store import user_folder
from enliven.kernel_cache.target import can_choose_target, host_processor
from enliven.kernel_cache.versions import CODE_VERSIONS

_MODE_VARIABLE = "ENLIVEN_NATIVE_KERNELS"
"""Environment variable that disables native code, or enables it on every processor."""
_FASTER_FEATURES = ("avx512f", "avx512vl")
"""Processor features (LLVM's names) that make native code faster than code for x86-64-v3.

docs/releasing.md contains the measurements. Processors without these features were not measured.
"""


def is_native_code_enabled() -> bool:
    """Returns True if native code is enabled for programs on this machine that have called
    :func:`name_program`."""
    mode = os.environ.get(_MODE_VARIABLE, "")
    if mode == "off" or user_folder() is None:
        return False
    return mode == "on" or (is_native_code_faster() and not os.environ.get("CI"))


def uses_native_code() -> bool:
    """Returns True if this program uses and compiles native code on this machine."""
    return bool(os.environ.get(PROGRAM_VARIABLE)) and is_native_code_enabled()


def is_native_code_faster() -> bool:
    """Returns True if native code is faster on this processor than code for its level."""
    features = llvmlite.binding.get_host_cpu_features()
    return all(features.get(name) for name in _FASTER_FEATURES)


@dataclasses.dataclass(frozen=True)
class NativeSet:
    """The native kernels of one program on one processor, as stored in a state file.

    Attributes:
        program: name of the program.
        kernels: file names of all native kernels that sessions of the program needed.
        missing: kernels that are not compiled yet.
        failed: kernels that cannot be compiled. Sessions use their portable versions instead.
    """

    program: str
    kernels: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()

    @classmethod
    def load(cls, program: str) -> NativeSet:
        """Returns the stored set of a program, or an empty set if none is stored or its file is damaged."""
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
            path = _state_file(program)
            stored_values = json.loads(path.read_bytes())
            os.utime(path)
            return cls(
                program, *(tuple(map(str, stored_values[key])) for key in ("kernels", "missing", "failed"))
            )
        return cls(program)

    def save(self) -> None:
        """Writes the set atomically.

        Raises:
            OSError: if the folder cannot be written.
        """
        path = _state_file(self.program)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump(dataclasses.asdict(self), file)
            os.replace(part, path)
        except OSError:
            Path(part).unlink(missing_ok=True)
            raise

    @property
    def is_complete(self) -> bool:
        """True if there are native kernels, none of them is missing, and all their files exist."""
        folder = user_folder()
        if not self.kernels or self.missing or folder is None:
            return False
        return all((folder / name).exists() for name in self.kernels if name not in self.failed)

    def __str__(self) -> str:
        processor = host_processor()[0]
        count, total = len(self.kernels) - len(self.missing), len(self.kernels)
        if self.is_complete:
            return f"{self.program} uses native code for {processor} ({total} kernels)"
        return (
            f"{self.program} compiles native code for {processor} in the background ({count} of {total} "
            "kernels)"
        )


def list_stored_sets() -> list[NativeSet]:
    """Returns the sets of all programs on this processor, by name."""
    folder = user_folder()
    paths = [] if folder is None else sorted(folder.glob(f"native-*-{_processor_key()}.json"))
    return [NativeSet.load(path.name.removeprefix("native-").rpartition("-")[0]) for path in paths]


def should_begin_native_session() -> bool:
    """Returns True if this process should use native code from its start, because its program has a complete
    set."""
    if not uses_native_code() or not can_choose_target():
        return False
    return NativeSet.load(os.environ[PROGRAM_VARIABLE]).is_complete


def _state_file(program: str) -> Path:
    """Returns the path of a program's state file.

    Raises:
        OSError: if the user does not have a folder for kernels.
    """
    folder = user_folder()
    if folder is None:
        raise OSError("no writable folder for compiled kernels was found")
    return folder / f"native-{program}-{_processor_key()}.json"


def _processor_key() -> str:
    """Returns a hash of the processor, and of the versions that determine the names of its kernels."""
    parts = (host_processor(), CODE_VERSIONS, __version__)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:12]
