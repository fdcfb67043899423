"""The folders of compiled kernels: the user's folder, and the folder in the installed package
``enliven-kernels``."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import os
import pickle
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zstandard

_COMPRESSION_LEVEL = 9
"""Compression level of Zstandard. It reduces the size to 40 % in 2 ms per kernel. Higher levels save 5 %
more, but they are slow.
"""
_MAX_UNUSED_S = 60 * 86400.0
"""Time in seconds after which an unused file in the user's folder is deleted (two months)."""
_SHIPPED_PACKAGE = "enliven_kernels"
"""Name of the Python package with the compiled kernels of a release. Its folder ``kernels`` has the same
format as the user's folder.
"""


@functools.cache
def find_shipped_folders() -> tuple[Path, ...]:
    """Returns the folder of the installed package ``enliven-kernels``. The result is empty if it is not
    installed."""
    spec = importlib.util.find_spec(_SHIPPED_PACKAGE)
    return (
        tuple(Path(folder) / "kernels" for folder in (spec.submodule_search_locations or ())) if spec else ()
    )


@functools.cache
def user_folder() -> Path | None:
    """Returns the user's folder, to which kernels are written: ``NUMBA_CACHE_DIR``, or a folder in the user's
    cache folder.

    Returns None if the user has no home folder. Only the user may write to the folder, since code in it is
    executed unchecked.
    """
    if configured := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(configured)
    with contextlib.suppress(RuntimeError):  # The user has no home folder.
        caches = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
        return (Path(caches) if caches else Path.home() / ".cache") / "enliven" / "kernels"
    return None


def load_kernel(name: str, unpickle: Callable[[bytes], Any] = pickle.loads) -> Any:
    """Returns the data that was saved under a name, or None if no folder contains a readable file with this
    name.

    Args:
        unpickle: the function that reads the serialised data.
    """
    writable_folder = user_folder()
    for folder in (*find_shipped_folders(), *(() if writable_folder is None else (writable_folder,))):
        path = folder / name
        # Unpickling a damaged file may raise any exception. A damaged file counts as missing, and is written
        # again.
        with contextlib.suppress(Exception):
            data = path.read_bytes()
            with contextlib.suppress(OSError):
                os.utime(path)
            return unpickle(zstandard.decompress(data))
    return None


def save_kernel(name: str, data: Any) -> None:
    """Writes machine code to the user's folder atomically. Does nothing if the disk is full."""
    folder = user_folder()
    if folder is None:
        return
    from numba.core.serialize import dumps  # Imported here, since doctor uses this module without Numba.

    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        _delete_unused(folder)
        # The checksum detects damaged files, which must not be executed as machine code.
        compressed = zstandard.ZstdCompressor(level=_COMPRESSION_LEVEL, write_checksum=True).compress(
            dumps(data)
        )
        handle, part = tempfile.mkstemp(dir=folder, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(compressed)
            os.replace(part, folder / name)
        except OSError:
            Path(part).unlink(missing_ok=True)
            raise


@functools.cache
def _delete_unused(folder: Path) -> None:
    """Deletes files that were unused for two months, including the files of older versions. Runs once per
    process.
    """
    for path in folder.iterdir():
        with contextlib.suppress(OSError):
            if path.is_file() and time.time() - path.stat().st_mtime > _MAX_UNUSED_S:
                path.unlink()
