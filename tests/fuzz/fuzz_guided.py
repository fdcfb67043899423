"""Coverage-guided fuzzing with atheris: inputs that reach new code are kept and mutated further.

Python code of enliven is instrumented. Compiled kernels and libraries in C are not. Their faults are noticed,
but the search is not guided into them.

libFuzzer, the engine of atheris, can be started only once in a process. Each turn of a target is therefore a
child process. The parent watches it, because the child cannot catch a crash or a hang in compiled code.
"""

from __future__ import annotations

import contextlib
import faulthandler
import mmap
import os
import resource
import signal
import struct
import sys
import time
import traceback
import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

from fuzz_law import PATIENCE, Broken, Target, TooSlow, check_bytes, keep_broken, peak_mb, timers
from fuzz_mutations import MOST_BYTES

STRUCTURED_SHARE = 0.6
"""Fraction of mutations by the target's own mutators. libFuzzer makes the rest."""
MAX_ADDRESS_SPACE_MB = 4096
"""Additional address space in MB that a child may reserve beyond its parent's, the limit of one
allocation.
"""
HANG_FACTOR = 4
"""Time after which an input counts as a hang in compiled code, as a multiple of :data:`PATIENCE`."""
LOOK_S = 0.1
"""Interval at which the parent checks its child, seconds."""
PACKAGES = ("enliven", "enliven_edge", "enliven_viewer")
"""Packages that are instrumented."""
_FAILURE = 3
"""Exit code of a child after an exception outside the reader, such as one of atheris."""
_HEAD = struct.Struct("<Qdd")
"""The report of a child: executions, slowest seconds, start of the current input. The input follows."""


class NotInstalledError(Exception):
    """Raised if atheris is not installed."""


@dataclass
class Turn:
    """The result of one turn of a target.

    Attributes:
        executions: number of inputs read.
        broken: descriptions of new faults.
        slowest_s: longest time for one input, seconds.
    """

    executions: int
    broken: list[str]
    slowest_s: float


def instrument() -> int:
    """Instruments all plain functions of enliven that are loaded. Returns their number.

    Numba compiles the byte code of kernels, which must not be changed. Kernels, and the functions that only
    kernels call, are objects of Numba instead of plain functions.

    Raises:
        NotInstalledError: without atheris.
    """
    try:
        import atheris
    except ImportError:
        raise NotInstalledError from None
    functions = {id(each): each for each in _plain_functions()}
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
        for function in functions.values():
            atheris.instrument_func(function)
    return len(functions)


def _plain_functions() -> Iterator[types.FunctionType]:
    """Yields functions and methods of the loaded modules of enliven."""
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] not in PACKAGES or module is None:
            continue
        for value in list(vars(module).values()):
            if getattr(value, "__module__", None) != name:
                continue
            members = vars(value).values() if isinstance(value, type) else (value,)
            for member in members:
                if isinstance(member, property):
                    yield from (each for each in (member.fget, member.fset) if _is_plain(each))
                member = getattr(member, "__func__", member)
                if _is_plain(member):
                    yield member


def _is_plain(value: object) -> bool:
    return isinstance(value, types.FunctionType) and "kernel" not in value.__module__.rpartition(".")[2]


def take_turn(target: Target, seconds: float, seed: int, folders: list[Path], room: Path, keep: Path) -> Turn:
    """Fuzzes a target for some seconds in a child process.

    Args:
        folders: the corpus. The first folder receives inputs that reach new code.
        room: folder for the files that the reader reads.
        keep: folder for files that break the reader.
    """
    board = mmap.mmap(-1, _HEAD.size + 8 + MOST_BYTES)
    earlier = set(keep.iterdir())
    child = os.fork()
    if child == 0:
        try:
            _fuzz(target, seconds, seed, folders, room, keep, board)
        except BaseException:
            _traceback_file(target, keep).write_text(traceback.format_exc(), encoding="utf-8")
        finally:
            os._exit(_FAILURE)
    code = _watch(child, board)
    executions, slowest, _ = _HEAD.unpack_from(board, 0)
    turn = Turn(executions, [], slowest)
    if code != 0:
        (length,) = struct.unpack_from("<Q", board, _HEAD.size)
        data = board[_HEAD.size + 8 : _HEAD.size + 8 + length]
        if code == -signal.SIGKILL:
            error: BaseException = TooSlow(f"longer than {HANG_FACTOR * PATIENCE} s, in compiled code")
        elif code == _FAILURE:
            error = ChildProcessError(f"the search itself failed, see {_traceback_file(target, keep)}")
        else:
            error = ChildProcessError(f"the process ended with {code}, in compiled code")
        turn.broken.append(str(keep_broken(target, bytes(data), keep, error)))
    turn.broken += [f"{target.name}: the file is {path}" for path in sorted(set(keep.iterdir()) - earlier)]
    board.close()
    return turn


def _traceback_file(target: Target, keep: Path) -> Path:
    """Returns the file for the traceback of a child whose search failed outside the reader."""
    return keep / f"traceback-{target.slug}.txt"


def _watch(child: int, board: mmap.mmap) -> int:
    """Waits for the child and returns its exit code. Kills it if an input takes far too long."""
    # Checks are counted instead of seconds, so that a pause of both processes does not count.
    looks, begun = 0, 0.0
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        now_read = _HEAD.unpack_from(board, 0)[2]
        looks, begun = (looks + 1, begun) if now_read == begun else (0, now_read)
        if looks * LOOK_S > HANG_FACTOR * PATIENCE:
            os.kill(child, signal.SIGKILL)
        time.sleep(LOOK_S)


def _fuzz(
    target: Target, seconds: float, seed: int, folders: list[Path], room: Path, keep: Path, board: mmap.mmap
) -> None:
    """Runs libFuzzer, and then ends the process."""
    import atheris

    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    faulthandler.disable()
    limit = int(_address_space()) + MAX_ADDRESS_SPACE_MB * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
    executions, slowest = 0, 0.0

    def test(data: bytes) -> None:
        nonlocal executions, slowest
        begun = time.monotonic()
        board[_HEAD.size : _HEAD.size + 8 + len(data)] = struct.pack("<Q", len(data)) + data
        _HEAD.pack_into(board, 0, executions, slowest, begun)
        with contextlib.suppress(Broken):
            check_bytes(target, data, room, keep)
        executions += 1
        slowest = max(slowest, time.monotonic() - begun)

    def mutate(data: bytes, max_size: int, number: int) -> bytes:
        dice = Random(number)
        if dice.random() < STRUCTURED_SHARE:
            changed = dice.choice(target.mutators)(bytes(data), dice.choice(target.seeds), dice)
            return changed[:max_size]
        return atheris.Mutate(data, max_size)

    options = {
        "max_total_time": max(1, round(seconds)),
        "max_len": MOST_BYTES,
        "timeout": 0,
        "artifact_prefix": f"{room}/",  # libFuzzer's own copy of a crash; the input is read from the board
        "rss_limit_mb": 0,
        "seed": seed % 2**32 or 1,
        "verbosity": 0,
        "reload": 0,
    }
    arguments = [target.slug, *map(str, folders), *(f"-{name}={value}" for name, value in options.items())]
    atheris.Setup(arguments, test, custom_mutator=mutate)
    with timers():
        atheris.Fuzz()


def _address_space() -> float:
    """Returns the size of this process's address space in bytes."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    return peak_mb() * 2**20
