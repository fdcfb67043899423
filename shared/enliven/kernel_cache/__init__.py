"""A cache of compiled kernels on disk. File names depend on the content, so entries are never outdated.

A kernel is compiled for a named processor level (:mod:`~enliven.kernel_cache.target`), so that its machine
code runs on every machine of that level. A fingerprint (:mod:`~enliven.kernel_cache.fingerprint`) covers
everything that the machine code depends on: the byte code of the kernel and of all kernels that it calls, and
the constants that they read. Docstrings, comments and line numbers are not part of it. The file name of a
compiled kernel is a hash of fingerprint, argument types, processor level and library versions
(:mod:`~enliven.kernel_cache.store`), so a file never has to be checked for its age.

Numba's own cache keeps machine code next to the source until that file changes. It misses changes in other
files that a kernel calls, and one damaged cache file (power cut, full disk) ends every later start.

Private interfaces of Numba that are used, all in this package and in ``kernels.py``:

- ``Dispatcher._cache``: the one place where Numba asks for compiled code; there is no public hook.
- ``numba.core.caching._Cache``: the interface that Numba expects there.
- ``CompileResult._reduce`` and ``_rebuild``: the serialised form of machine code.
- ``JITCodeLibrary`` and ``JitEngine._defined_symbols``: machine code that is loaded without its bitcode.
- ``environment._rebuild_env`` and ``Environment._memo``: the serialised form of a function's globals.
- ``cpu_target._toplevel_target_context``: exists if Numba has chosen its processor level already.
- ``numba.core.extending._Intrinsic._defn``: the function behind an intrinsic, for the fingerprint.
- ``njit(no_cfunc_wrapper=True)``: an undocumented option that skips an entry point for C.

``tests/shared/kernel_cache/test_numba_interfaces.py`` names each one that a new Numba lacks.
"""
