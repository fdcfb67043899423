"""Compiles functions that only other kernels call, without machine code and entry points of their own.

When Numba compiles a kernel, it compiles each function that the kernel calls like a kernel of its own: with a
wrapper that unpacks Python objects, with all optimisations, and to machine code. But a kernel includes the
LLVM code of its callees, so none of this is used. Here, a callee stays LLVM code, which is optimised once,
inside the kernel. If Python calls the function later, it is compiled in full. For the kernels of an edge,
this saves a quarter of the compiler's processor time.

The results do not change: LLVM does not reorder floating-point operations unless a kernel allows it
(``fastmath``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.target_extension import dispatcher_registry, target_registry

from enliven.kernel_cache.compile_lock import compile_lock


class _Compilation:
    """The state of the compiler. Numba's compiler lock protects it.

    Attributes:
        depth: the number of functions that are being compiled. If it is above 1, the innermost function is a
            callee of another one.
    """

    depth = 0


def compiles_callee() -> bool:
    """Returns True if the innermost function that is being compiled is called by a kernel, not by Python."""
    return _Compilation.depth > 1


def is_callee(compiled: CompileResult) -> bool:
    """Returns True if a compiled function has no entry point for Python."""
    return isinstance(compiled.library, KernelLibrary) and not compiled.library.has_entry_point


class KernelLibrary(JITCodeLibrary):
    """The code of one compiled function and of its callees.

    Attributes:
        has_entry_point: whether Python can call the function. Only then is its code optimised as a whole and
            translated to machine code.
    """

    has_entry_point = False

    def get_pointer_to_function(self, name: str) -> int:
        """Returns the address of an entry point. Numba calls this once for each function that Python can
        call.
        """
        self.has_entry_point = True
        return int(super().get_pointer_to_function(name))

    def _optimize_final_module(self) -> None:
        if self.has_entry_point:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self.has_entry_point:
            super()._finalize_final_module()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True

    def set_environments(self) -> None:
        """Sets the environment of each callee, which contains the constants of its exceptions."""
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                self.codegen.set_env(variable.name, environment)


class KernelCompiler(Compiler):
    """Numba's compiler, which leaves out the entry points for Python and C if the function is a callee."""

    def define_pipelines(self) -> Any:
        """Returns the passes of the compiler."""
        if compiles_callee():
            flags = self.state.flags
            flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        return super().define_pipelines()


class KernelDispatcher(CPUDispatcher):
    """The compiled variants of a function. Python can call a variant only if it is not a callee.

    The arguments are those of Numba's dispatcher.
    """

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict[str, Any] | None = None,
        targetoptions: dict[str, Any] | None = None,
        pipeline_class: type[Compiler] = KernelCompiler,
    ) -> None:
        super().__init__(py_func, locals, targetoptions, pipeline_class)

    def compile(self, sig: Any) -> Any:
        """Returns the entry point for argument types. If Python calls a callee, it is compiled again."""
        with global_compiler_lock:
            self.targetctx.codegen()._library_class = KernelLibrary
            if _Compilation.depth == 0:
                types = tuple(normalize_signature(sig)[0])
                existing = self.overloads.get(types)
                if existing is not None and is_callee(existing):
                    del self.overloads[types]
            _Compilation.depth += 1
            try:
                return super().compile(sig)
            finally:
                _Compilation.depth -= 1
                if _Compilation.depth == 0:
                    compile_lock.release()

    def add_overload(self, cres: CompileResult) -> None:
        """Adds a compiled variant. A callee is not offered to calls from Python."""
        if not is_callee(cres):
            if isinstance(cres.library, KernelLibrary):
                cres.library.set_environments()
            super().add_overload(cres)
            return
        name = object()  # Calls from kernels find a variant by its entry point, so this must be unique.
        self.targetctx.insert_user_function(name, cres.fndesc, [cres.library])
        self.overloads[tuple(cres.signature.args)] = cres._replace(entry_point=name)


def compile_callees_without_entry_points() -> None:
    """Makes Numba use :class:`KernelDispatcher` for all functions that are decorated from now on.

    This includes Numba's own functions, for example the variants of ``numpy.empty``.
    """
    # The registry refuses a second value for a key, and offers no other way to replace one.
    dict.__setitem__(dispatcher_registry, target_registry["cpu"], KernelDispatcher)
