"""The versions that determine compiled kernels."""

import sys

import llvmlite
import numba
import numpy as np

CODE_VERSIONS = (
    sys.version_info[:2],
    numba.__version__,
    llvmlite.__version__,
    np.__version__.partition(".")[0],
)
"""Versions that determine byte code, the serialised form of machine code and the code of library functions.

Only NumPy's major version is included, because NumPy's code is not compiled into kernels, and the layout of
its arrays changes at most with a major version.
"""
