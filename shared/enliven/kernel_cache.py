"""Compiled kernels on disk: never stale, no reason not to start, and made once for all checkouts of a user.

Numba keeps a kernel's machine code beside its source until the time of that file changes. But the code holds
what the kernel calls and the constants it names too, from other files, and one damaged file of the cache (a
power cut, a full disk) ends every later start. Here the code is kept until the content of any of these
changes, and a cache that cannot be read or written costs a compilation.

What was compiled is kept a second time in the user's own folder for caches, by content: another checkout, or
a new version of a package in which a kernel is as it was, finds it there. Where ``NUMBA_CACHE_DIR`` names a
folder, that one alone is used.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core import types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

_CONSTANTS = (bool, int, float, complex, str, bytes, type(None))
"""Types of module constants that a kernel may hold a copy of."""
_UNUSED = 60 * 86400.0
"""Seconds after which machine code that no new checkout asked for is deleted from the user's folder."""


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Keeps the machine code of one kernel on disk until what it is made of changes."""

    def __init__(self, kernel: Any) -> None:
        super().__init__(kernel)
        own = _content(kernel.__code__.co_filename) or self._cache_file._source_stamp
        made_of = kernel.__module__, own, _content(str(_MADE_BY)), *_imported(kernel.__module__)
        self.stamp = hashlib.sha256(repr(made_of).encode()).hexdigest()
        self._cache_file._source_stamp = self.stamp
        self._shelf = _Shelf.of(f"{self._impl.filename_base}-{self.stamp[:32]}", self.stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled kernel of a signature, or None where there is none that can be read."""
        with _unbroken():
            if (found := super().load_overload(sig, target_context)) is not None:
                return found
        with _unbroken():
            return self._from_shelf(sig, target_context)

    def _from_shelf(self, sig: Any, target_context: Any) -> Any:
        """Returns what another checkout compiled, which from now on lies beside the source too."""
        key = self._index_key(sig, target_context.codegen())
        data = None if self._shelf is None else self._shelf.load(key)
        if data is None:
            return None
        made = self._impl.rebuild(target_context, data)
        self._keep(self._cache_file, key, data)
        return made

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps a compiled kernel beside its source and in the user's folder, where the disk takes it."""
        if not self._impl.check_cachable(data):
            return
        key, reduced = self._index_key(sig, data.codegen), self._impl.reduce(data)
        for place in (self._cache_file, self._shelf):
            if place is not None:
                self._keep(place, key, reduced)

    def _keep(self, place: Any, key: Any, reduced: Any) -> None:
        """Writes machine code to a place, where the disk takes it."""
        with contextlib.suppress(OSError):
            self._impl.locator.ensure_cache_path() if place is self._cache_file else place.make()
            try:
                place.save(key, reduced)
            except OSError:
                raise
            except Exception:  # The index is damaged: it is written anew.
                with _unbroken():
                    place.flush()
                    place.save(key, reduced)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Returns Numba's key, and the fields of named tuples: a kernel reads them by their place."""
        return *super()._index_key(sig, codegen), tuple(_fields(sig))


class _Shelf(IndexDataCacheFile):  # type: ignore[misc]
    """The machine code of one kernel in the user's folder for caches, named by what it is made of."""

    @classmethod
    def of(cls, name: str, stamp: str) -> _Shelf | None:
        """Returns the shelf of a kernel, or None where the user has no folder, or Numba was given one."""
        folder = _folder()
        return None if folder is None else cls(str(folder), name, stamp)

    def load(self, key: Any) -> Any:
        """Returns the machine code of a key, or None, and remembers that it was asked for."""
        data = super().load(key)
        if data is not None:
            with contextlib.suppress(OSError):
                os.utime(self._index_path)
        return data

    def make(self) -> None:
        """Makes the folder, and deletes there what was not asked for in a long time, once a process."""
        Path(self._cache_path).mkdir(parents=True, exist_ok=True, mode=0o700)
        _clear(self._cache_path)


@functools.cache
def _folder() -> Path | None:
    """Returns the folder of all shelves: the user's own, since machine code is run as it is found."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return None
    with contextlib.suppress(RuntimeError):  # There is no home.
        given = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
        return (Path(given) if given else Path.home() / ".cache") / "enliven" / "kernels"
    return None


@functools.cache
def _clear(folder: str) -> None:
    """Deletes the kernels that no checkout asked for in a long time."""
    with contextlib.suppress(OSError):
        for index in Path(folder).glob("*.nbi"):
            if time.time() - index.stat().st_mtime > _UNUSED:
                for path in (index, *Path(folder).glob(f"{index.stem}.*.nbc")):
                    path.unlink()


def _fields(signature: Any) -> Iterator[tuple[str, ...]]:
    """Yields the names of the fields of all named tuples in a signature's types."""
    for one in signature:
        if isinstance(one, types.NamedTuple | types.NamedUniTuple):
            yield one.fields
        if isinstance(one, types.BaseTuple):
            yield from _fields(one)
        if isinstance(one, types.StructRef):
            yield from _fields(one.field_dict.values())


_MADE_BY = Path(__file__).with_name("kernels.py")
"""The file that says with which options every kernel is compiled."""


@functools.cache
def _content(path: str) -> str:
    """Returns the hash of a file, or an empty string where it cannot be read."""
    with contextlib.suppress(OSError):
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return ""


def keep(kernel: Any) -> Any:
    """Makes a kernel's machine code outlive the process, where there is a folder that can be written.

    Returns:
        The same kernel; a plain function, which ``NUMBA_DISABLE_JIT`` makes of it, stays as it is.
    """
    if not isinstance(kernel, Dispatcher):
        return kernel
    with contextlib.suppress(RuntimeError):  # No folder can be written: every start compiles.
        kernel._cache = KernelCache(kernel.py_func)
    return kernel


@contextlib.contextmanager
def _unbroken() -> Iterator[None]:
    """Lets a damaged or unwritable cache count as an empty one; unpickling it may raise anything."""
    with contextlib.suppress(Exception):
        yield


@functools.cache
def _imported(module: str) -> tuple[str, ...]:
    """Returns the stamps of all kernels and the values of all constants that a module imports.

    Imports stand above the first kernel, which is when this is asked for the first time. What the module
    states itself is in its own file, and Numba takes the stamp of that.
    """
    names = vars(sys.modules[module]) if module in sys.modules else {}
    return tuple(text for name in sorted(names) if (text := _text_of(name, names[name], module)))


def _text_of(name: str, value: Any, module: str) -> str:
    """Returns what the machine code may hold of a module's name, or an empty string."""
    if isinstance(value, Dispatcher):
        stamp = getattr(getattr(value, "_cache", None), "stamp", "")
        return f"{name} {stamp}" if value.py_func.__module__ != module else ""
    if isinstance(value, ModuleType) or name.startswith("__"):
        return ""
    if isinstance(value, _CONSTANTS) or (
        isinstance(value, tuple) and all(isinstance(v, _CONSTANTS) for v in value)
    ):
        return f"{name}={value!r}"
    return ""
