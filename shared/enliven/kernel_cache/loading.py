"""Loads machine code from files without initialising the parts of Numba that only the compiler needs.

When Numba itself loads a stored kernel, it imports all lowering rules and SciPy's linear algebra, and parses
the bitcode that other kernels can include. For the 112 kernels of an edge, this took 0.8 s of processor time.
Here, it is delayed until this process compiles a kernel.
"""

from __future__ import annotations

import functools
import importlib
import io
import pickle
import sys
from typing import Any

import llvmlite.binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.environment import Environment, lookup_environment
from numba.core.runtime import rtsys

HASH_SYMBOLS = b"_numba_hashsecret_"
"""Prefix of the names of Python's hash secrets. They are the only symbols of machine code that Numba defines
when it initialises the compiler. All other symbols are defined earlier."""
_HASH_MODULE = "numba.cpython.hashing"
"""The module that defines the symbols of the hash secrets."""
_ENVIRONMENT_READER = ("numba.core.environment", "_rebuild_env")
"""Module and name of Numba's function that reads the environment of a function: its constants and globals."""


class StoredLibrary(JITCodeLibrary):
    """Machine code from a file. Its bitcode is parsed only when a kernel that includes it is compiled.

    Args:
        codegen: Numba's code generator.
        stored: the serialised library: its name, "object", and the machine code with its bitcode.

    Raises:
        ValueError: if it contains no machine code.
    """

    def __init__(self, codegen: Any, stored: tuple[str, str, tuple[bytes, bytes]]) -> None:
        name, kind, (object_code, bitcode) = stored
        if kind != "object":
            raise ValueError(f"{name} is stored as {kind}, not as machine code")
        super().__init__(codegen, name)
        self._bitcode: bytes | None = bitcode
        if HASH_SYMBOLS in object_code:
            importlib.import_module(_HASH_MODULE)
        self.enable_object_caching()
        self._set_compiled_object(object_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """Returns the address of a function, or 0 if this library has none with that name.

        Numba calls this method only with the names of a kernel's own entry points. If the bitcode contains
        such a name, it defines the function.
        """
        if self._bitcode is not None and name.encode() in self._bitcode:
            self._codegen._engine._defined_symbols.add(name)
        return int(super().get_pointer_to_function(name))

    def _get_module_for_linking(self) -> Any:
        """Returns the LLVM module that other kernels include when they are compiled."""
        if self._bitcode is not None:
            self._shared_module = llvmlite.binding.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
            self._bitcode = None
        return super()._get_module_for_linking()


def rebuild_kernel(target_context: Any, data: tuple[Any, ...]) -> Any:
    """Returns the compiled kernel from its serialised form. The caller must hold Numba's compiler lock.

    Args:
        target_context: Numba's target.
        data: the result of ``CompileResult._reduce``.
    """
    rtsys.initialize(target_context)
    codegen = target_context.codegen()
    codegen.unserialize_library = functools.partial(StoredLibrary, codegen)
    return CompileResult._rebuild(target_context, *data)


def unpickle_kernel(data: bytes) -> Any:
    """Returns the result of ``CompileResult._reduce`` from its serialised form."""
    return _KernelUnpickler(io.BytesIO(data)).load()


class _KernelUnpickler(pickle.Unpickler):
    """An unpickler that reads serialised kernels without importing the modules of the functions that they
    contain."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns a class or function by its name. Replaces Numba's reader of environments."""
        return (
            _read_environment if (module, name) == _ENVIRONMENT_READER else super().find_class(module, name)
        )


def _read_environment(module: str, constants: list[Any], name: str) -> Environment:
    """Returns Numba's environment of a kernel's function, which contains constants and globals.

    Numba uses the constants for exceptions, and the globals only in object mode, which kernels do not use. So
    if a module is not imported yet, its globals are left out, except for the module's name.
    """
    environment = lookup_environment(name)
    if environment is not None:
        return environment
    is_imported = module in sys.modules
    environment = Environment(vars(sys.modules[module]) if is_imported else {"__name__": module})
    environment.consts[:] = constants
    environment.env_name = name
    Environment._memo[name] = environment
    return environment
