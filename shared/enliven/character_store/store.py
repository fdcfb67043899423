"""The folder of prepared characters: it finds, writes and deletes files."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import logging
import os
import platform
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import zstandard

import enliven
from enliven.errors import EnlivenError
from enliven.files import read_file, write_file

log = logging.getLogger(__name__)

FORMAT_VERSION = 1
"""Version of the file format. It is part of every file name, so a file of another version is never read."""
MAX_FILE_BYTES = 64 << 20
"""Maximum size in bytes of a prepared character before compression. A larger character is not stored, and is
prepared at each start."""
MAX_FOLDER_BYTES = 256 << 20
"""Maximum size of the folder in bytes. The least recently used files are deleted first."""
_COMPRESSION_LEVEL = 1
"""Compression level of Zstandard. Higher levels save little space, and the first start waits for the
compression."""
_SUFFIX = ".prepared"
"""Suffix of all files in the folder."""
FOLDER_VARIABLE = "ENLIVEN_CHARACTERS"
"""Environment variable with the path of the user's store, or ``off`` to disable it."""
_PACKAGES = ("enliven", "enliven_edge", "enliven_viewer")
"""Packages with code that prepares characters."""
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "pillow")
"""Libraries that may affect the results by their version."""


class CharacterStore:
    """A folder of prepared characters.

    Files that cannot be read or written are ignored, so the store never stops a program.

    Args:
        folder: the folder. It is created at the first write, with access for its owner only. If None, nothing
            is stored.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    @classmethod
    def open_user_store(cls) -> CharacterStore:
        """Returns the store in the user's cache folder, or in the folder in :data:`FOLDER_VARIABLE`.

        For a user without a home folder, the store is disabled.
        """
        if folder_name := os.environ.get(FOLDER_VARIABLE):
            return cls(None if folder_name == "off" else Path(folder_name))
        with contextlib.suppress(RuntimeError):  # The user has no home folder.
            caches = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
            return cls((Path(caches) if caches else Path.home() / ".cache") / "enliven" / "characters")
        return cls(None)

    def load(self, key: str) -> bytes | None:
        """Returns the data that was saved under a key, or None if it is missing, damaged or too large."""
        if self._folder is None:
            return None
        path = self._result_path(key)
        try:
            if not path.exists():
                return None
            packed = read_file(path, MAX_FILE_BYTES)
            if not 0 <= zstandard.frame_content_size(packed) <= MAX_FILE_BYTES:
                return None
            data = zstandard.ZstdDecompressor().decompress(packed)
        except (EnlivenError, OSError, zstandard.ZstdError, MemoryError) as error:
            log.warning(
                "the stored character %s cannot be read, so the character is prepared again: %s", path, error
            )
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        return data

    def save(self, key: str, data: bytes) -> None:
        """Writes data completely or not at all. Then deletes the least recently used files above the size
        limit."""
        if self._folder is None or len(data) > MAX_FILE_BYTES:
            return
        # The checksum detects damage, for example after a power cut.
        packed = zstandard.ZstdCompressor(level=_COMPRESSION_LEVEL, write_checksum=True).compress(data)
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_file(self._result_path(key), packed, durable=False)
            self._delete_oldest()
        except (EnlivenError, OSError) as error:
            log.info("a prepared character cannot be stored: %s", error)

    def _result_path(self, key: str) -> Path:
        assert self._folder is not None
        return self._folder / f"{key}{_SUFFIX}"

    def _delete_oldest(self) -> None:
        """Deletes the least recently used files until the folder is small enough."""
        assert self._folder is not None
        sizes: dict[Path, tuple[float, int]] = {}
        for path in self._folder.glob(f"*{_SUFFIX}"):
            with contextlib.suppress(OSError):
                state = path.stat()
                # A file with a time in the future, from before the clock was set back, must not stay the
                # newest forever.
                sizes[path] = min(state.st_mtime, time.time()), state.st_size
        left = sum(size for _, size in sizes.values())
        for path in sorted(sizes, key=lambda each: sizes[each]):
            if left <= MAX_FOLDER_BYTES:
                return
            with contextlib.suppress(OSError):
                path.unlink()
                left -= sizes[path][1]


def compute_cache_key(*parts: object) -> str:
    """Returns the key of a result: a hash of its inputs, and of the code and libraries that compute it.

    Args:
        parts: values with a ``repr`` that represents them completely.
    """
    inputs = repr((FORMAT_VERSION, parts, _code_version(), platform.machine()))
    return hashlib.sha256(inputs.encode()).hexdigest()


@functools.cache
def _code_version() -> tuple[object, ...]:
    """Returns the versions of the libraries, and name, size and modification time of each file in enliven's
    packages.

    The files distinguish two states of a checkout with the same version. Reading them takes some
    milliseconds.
    """
    versions = []
    for library in _LIBRARIES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions.append((library, metadata.version(library)))
    files = [state for package in _PACKAGES for state in _file_states(package)]
    return enliven.__version__, tuple(versions), tuple(sorted(files))


def _file_states(package: str) -> Iterator[tuple[str, int, int]]:
    """Yields name, size in bytes and modification time in nanoseconds of each Python file of a package, if
    the package is installed."""
    spec = importlib.util.find_spec(package)
    for root in (spec.submodule_search_locations or ()) if spec is not None else ():
        for folder, _, names in os.walk(root):
            for path in (os.path.join(folder, name) for name in names if name.endswith(".py")):
                state = os.stat(path)
                yield os.path.relpath(path, os.path.dirname(root)), state.st_size, state.st_mtime_ns
