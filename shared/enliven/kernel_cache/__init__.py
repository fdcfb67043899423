"""A cache of compiled kernels on disk. File names are hashes of the kernels' content, so entries are never
outdated.

A kernel is compiled for a named processor level (:mod:`~enliven.kernel_cache.target`), so that its machine
code runs on every machine of that level. A fingerprint (:mod:`~enliven.kernel_cache.fingerprint`) covers
everything that the machine code depends on: the byte code of the kernel and of all kernels that it calls, and
the constants that they read. Docstrings, comments and line numbers are not part of it. The file name of a
compiled kernel is a hash of fingerprint, argument types, processor level and library versions
(:mod:`~enliven.kernel_cache.store`), so the age of a file is irrelevant.

Numba's own cache keeps machine code next to the source until that file changes. It does not detect changes of
functions in other files that a kernel calls. And a damaged cache file (after a power cut, or on a full disk)
makes every later start fail.

Private interfaces of Numba that are used, all in this package and in ``kernels.py``:

- ``Dispatcher._cache``: the one place where Numba asks for compiled code; there is no public hook.
- ``numba.core.caching._Cache``: the interface that Numba expects there.
- ``CompileResult._reduce`` and ``_rebuild_player``: the serialised form of machine code.
- ``JITCodeLibrary`` and ``JitEngine._defined_symbols``: machine code that is loaded without its bitcode.
- ``environment._rebuild_env`` and ``Environment._memo``: the serialised form of a function's globals.
- ``cpu_target._toplevel_target_context``: exists if Numba has already chosen its processor level.
- ``numba.core.extending._Intrinsic._defn``: the function behind an intrinsic, for the fingerprint.
- ``target_extension.dispatcher_registry``: the class of compiled functions, which
  :mod:`~enliven.kernel_cache.callees` replaces. This module also uses ``Dispatcher.add_overload``, the flags
  ``no_compile`` and ``no_cpython_wrapper``, ``JITCPUCodegen._library_class`` and
  ``CPUCodeLibrary._optimize_final_module``.
- ``njit(no_cfunc_wrapper=True)``: an undocumented option that skips an entry point for C.

``tests/shared/kernel_cache/test_numba_interfaces.py`` lists each interface that a new version of Numba lacks.
"""
