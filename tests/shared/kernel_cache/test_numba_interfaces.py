"""Tests of the private parts of Numba that the kernel cache uses. With an unsupported Numba, the failing test
names the part.
"""

import inspect

import numba
import pytest
from numba.core import (
    caching,
    codegen,
    compiler,
    cpu,
    dispatcher,
    environment,
    extending,
    options,
    target_extension,
)
from numba.core.registry import cpu_target

from enliven.kernels import quantile

REQUIRED = {
    "numba.core.caching._Cache": (
        caching, "_Cache", ("cache_path", "load_overload", "save_overload", "enable", "disable", "flush")
    ),
    "numba.core.compiler.CompileResult": (compiler, "CompileResult", ("_reduce", "_rebuild")),
    "numba.core.codegen.JITCodeLibrary": (
        codegen, "JITCodeLibrary",
        ("enable_object_caching", "_set_compiled_object", "_finalize_final_module", "_get_module_for_linking",
         "_optimize_final_module", "_finalize_dynamic_globals", "get_pointer_to_function")
    ),
    "numba.core.codegen.JITCPUCodegen": (codegen, "JITCPUCodegen", ("_library_class", "set_env")),
    "numba.core.compiler.Compiler": (compiler, "Compiler", ("define_pipelines",)),
    "numba.core.compiler.Flags": (compiler, "Flags", ("no_compile", "no_cpython_wrapper")),
    "numba.core.cpu.CPUContext": (cpu, "CPUContext", ("insert_user_function",)),
    "numba.core.target_extension": (target_extension, "dispatcher_registry", ()),
    "numba.core.codegen.JitEngine": (codegen, "JitEngine", ("is_symbol_defined", "_load_defined_symbols")),
    "numba.core.environment.Environment": (environment, "Environment", ("_memo", "consts", "env_name")),
    "numba.core.environment._rebuild_env": (environment, "_rebuild_env", ()),
    "numba.core.dispatcher.Dispatcher": (dispatcher, "Dispatcher", ("compile", "stats", "add_overload")),
    "numba.core.extending._Intrinsic": (extending, "_Intrinsic", ()),
}  # fmt: skip
ADVICE = (
    f"Numba {numba.__version__} is not supported yet: change enliven.kernel_cache, then the bound of numba"
)


@pytest.mark.parametrize("name", REQUIRED)
def test_numba_has(name):
    module, kind, members = REQUIRED[name]
    member_type = getattr(module, kind, None)
    assert member_type is not None, f"{name} is gone. {ADVICE}"
    missing = [member for member in members if not hasattr(member_type, member)]
    assert not missing, f"{name} lacks {', '.join(missing)}. {ADVICE}"


def test_a_kernel_has_one_cache_to_replace():
    assert hasattr(quantile, "_cache"), ADVICE
    abstract = getattr(caching._Cache, "__abstractmethods__", frozenset())
    assert abstract <= set(dir(type(quantile._cache))), f"a cache needs {abstract}. {ADVICE}"
    assert "targetoptions" in vars(quantile), ADVICE


def test_the_target_of_the_process_is_kept_under_a_known_name():
    assert cpu_target.target_context is not None
    assert "_toplevel_target_context" in vars(cpu_target), ADVICE


def test_an_intrinsic_has_its_function():
    @extending.intrinsic
    def nothing(context):
        return None

    assert inspect.isfunction(nothing._defn), ADVICE


def test_kernels_can_be_compiled_without_an_entry_for_c():
    assert "no_cfunc_wrapper" in vars(options.DefaultOptions), ADVICE
