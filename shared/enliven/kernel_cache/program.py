"""The name of the running program. This module does not import Numba, so that every command starts
quickly."""

import os

PROGRAM_VARIABLE = "ENLIVEN_PROGRAM"
"""Environment variable with the name of the running program. Its child processes inherit it."""


def name_program(name: str) -> None:
    """Sets the name of the program that this process runs. Call it before the first kernel, because the set
    of native kernels depends on the name.
    """
    os.environ[PROGRAM_VARIABLE] = name
