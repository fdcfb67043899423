"""A hash of everything that the machine code of a kernel depends on, apart from the types of its arguments.

The hash covers the kernel and all functions that it calls (kernels, intrinsics, inner functions). It includes
their byte code, constants, defaults, closures and compiler options, and the module constants that they read.
It does not include docstrings, comments, line numbers and other functions of the file.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

_REPRESENTABLE_TYPES = (
    bool,
    int,
    float,
    complex,
    str,
    bytes,
    type(None),
    type(Ellipsis),
    range,
    slice,
    np.generic,
)
"""Types with a ``repr`` that represents the whole value."""
_LIBRARIES = ("numba", "numpy", "scipy", "llvmlite", "builtins", "math")
"""Packages with functions that are hashed by name only, because the package versions are part of every file
name."""
_FUNCTION_CODE_FLAGS = 0x3
"""Flags ``CO_OPTIMIZED | CO_NEWLOCALS`` of a code object. Only the code of functions has them, not that of
modules and classes.
"""
_DOCSTRING_CODE_FLAG = 0x4000000
"""Flag of a code object that has a docstring as its first constant, since Python 3.13."""
_CODE_GENERATOR_FILES = ("kernels.py", "lanes.py", "lane_blocks.py")
"""Files next to this package that define overloads and intrinsics, which generate code for all kernels."""


def fingerprint(kernel: FunctionType) -> str:
    """Returns the hash (64 hexadecimal digits) of a kernel's Python function and of all code that it
    calls."""
    hashes, waiting = {}, [kernel]
    while waiting:
        function = waiting.pop()
        if function not in hashes:
            hashes[function], reached = _hash_function(function)
            waiting.extend(reached)
    return _hash("\n".join([_hash_generators(), hashes[kernel], *sorted(hashes.values())]))


@functools.cache
def _hash_function(function: FunctionType) -> tuple[str, tuple[FunctionType, ...]]:
    """Returns the hash of one function, and the functions that it may call, which the hash does not cover."""
    reached_functions: list[FunctionType] = []
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    values = [function.__defaults__, function.__kwdefaults__, *cells]
    parts = [
        f"{function.__module__}.{function.__qualname__}",
        describe_code(function.__code__),
        *(_describe_value(value, reached_functions) for value in values),
        *(
            f"{name}={_describe_value(value, reached_functions)}"
            for name, value in sorted(_iterate_globals(function))
        ),
    ]
    return _hash("\n".join(parts)), tuple(reached_functions)


def describe_code(code: CodeType) -> str:
    """Returns a text with byte code, names and constants of a code object, without docstrings and line
    numbers.

    Parameters are included by name, since they may be passed by keyword. Of other local variables only the
    number is included, since the byte code reads them by index.
    """
    constants = code.co_consts[1:] if _starts_with_docstring(code) else code.co_consts
    parameters = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    names = (code.co_names, parameters, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_nlocals)
    return f"({code.co_code.hex()} {names} {counts} {', '.join(map(_describe_constant, constants))})"


def _starts_with_docstring(code: CodeType) -> bool:
    """Returns True if the first constant is a docstring, or None in place of a docstring."""
    if sys.version_info >= (3, 13):
        return bool(code.co_flags & _DOCSTRING_CODE_FLAG)
    is_named = not code.co_name.startswith("<") or code.co_name == "<lambda>"
    return code.co_flags & _FUNCTION_CODE_FLAGS == _FUNCTION_CODE_FLAGS and is_named


def _describe_constant(value: object) -> str:
    """Returns a text that represents a constant of a code object. Sets are sorted, since their order differs
    between processes.
    """
    if isinstance(value, CodeType):
        return describe_code(value)
    if isinstance(value, tuple):
        return f"({', '.join(map(_describe_constant, value))},)"
    if isinstance(value, frozenset):
        return f"{{{', '.join(sorted(map(_describe_constant, value)))}}}"
    return repr(value)


def _iterate_globals(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Yields names and values of the globals that a function may read, directly or as attributes of
    modules."""
    names = set(_iterate_global_names(function.__code__))
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        yield name, value
        if isinstance(value, ModuleType) and not _is_library(value.__name__):
            yield from ((f"{name}.{inner}", vars(value)[inner]) for inner in names & vars(value).keys())


def _iterate_global_names(code: CodeType) -> Iterator[str]:
    """Yields the names of globals and attributes in a code object and in the functions inside it."""
    yield from code.co_names
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _iterate_global_names(value)


def _describe_value(value: Any, reached: list[FunctionType]) -> str:
    """Returns a text that represents a value that a kernel reads. Adds functions that the kernel may call to
    ``reached``.
    """
    if isinstance(value, Dispatcher):
        reached.append(value.py_func)
        return f"kernel {value.py_func.__qualname__} {describe_options(value)}"
    if isinstance(value, _Intrinsic):
        value = value._defn
    if isinstance(value, FunctionType):
        if not _is_library(value.__module__):
            reached.append(value)
        return f"function {value.__module__}.{value.__qualname__}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}({', '.join(_describe_value(item, reached) for item in value)})"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key!r}: {_describe_value(item, reached)}' for key, item in value.items())}}}"
    if isinstance(value, (set, frozenset)):
        return f"{{{', '.join(sorted(_describe_value(item, reached) for item in value))}}}"
    if isinstance(value, np.ndarray):
        return f"array {value.dtype} {value.shape} {_hash(np.ascontiguousarray(value).tobytes())}"
    if isinstance(value, type):
        return f"class {value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    if isinstance(value, (*_REPRESENTABLE_TYPES, types.Type, np.dtype)):
        return repr(value)
    return f"{type(value).__name__} {getattr(value, '__name__', '')}"


def describe_options(kernel: Any) -> str:
    """Returns a text that represents a kernel's compiler options. Sets are sorted, since their order differs
    between processes.
    """
    return repr(
        [
            (name, sorted(value) if isinstance(value, (set, frozenset)) else value)
            for name, value in sorted(kernel.targetoptions.items())
        ]
    )


def _is_library(module: str | None) -> bool:
    """Returns True if a module belongs to a library that is represented by its version."""
    return (module or "").partition(".")[0] in _LIBRARIES


@functools.cache
def _hash_generators() -> str:
    """Returns the hash of the modules that generate code for all kernels, and of their compiler options."""
    folder = Path(__file__).parents[1]
    texts = []
    for name in _CODE_GENERATOR_FILES:
        path = folder / name
        texts.append(describe_code(compile(path.read_bytes(), name, "exec", dont_inherit=True)))
    return _hash("\n".join(texts))


def _hash(text: str | bytes) -> str:
    """Returns SHA-256 of a text as 64 hexadecimal digits."""
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()
