"""Errors of files: turns errors of the operating system into messages with the file and a remedy."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from enliven.errors import EnlivenError, InputError, ResourceError

DAMAGE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    RecursionError,
)
"""The exceptions that parsers raise if the numbers in a file are damaged. Readers catch them, because checks
of each number would be most of a reader's code.
"""
DECODE_ERRORS = (ValueError, RecursionError)
"""The exceptions of msgspec's decoders for damaged JSON or MessagePack. Those of msgspec are ValueErrors.
So is the error for text that is not UTF-8.
"""
_WRITE_ADVICE = "Check the folder's permissions and the space on the disk."
_FAILING_DISK_ADVICE = (
    "The disk or memory card may be failing. Check it, and copy the readable files to another disk."
)
_DISCONNECTED_ADVICE = (
    "The network drive or device does not answer. Connect it again, or copy the file to this computer."
)
_FULL_DISK_ADVICE = "Free some space on the disk, or choose a folder on another disk."
_DEVICE_FAULTS = {
    number: remedy
    for remedy, names in (
        (_FAILING_DISK_ADVICE, ("EIO", "EUCLEAN", "EBADMSG", "EILSEQ", "EMEDIUMTYPE", "ENOMEDIUM")),
        (
            _DISCONNECTED_ADVICE,
            ("ESTALE", "ENODEV", "ENXIO", "EREMOTEIO", "ETIMEDOUT", "EHOSTDOWN", "ENOTCONN", "ESHUTDOWN"),
        ),
        (_FULL_DISK_ADVICE, ("ENOSPC", "EDQUOT", "EFBIG")),
        ("The disk is read-only. Choose a folder on another disk.", ("EROFS",)),
        ("Close other programs, or raise the limit of open files (ulimit -n).", ("EMFILE", "ENFILE")),
    )
    for name in names
    if (number := getattr(errno, name, None)) is not None
}
"""The remedy for each error number that means an error of a device or of this machine, and not of a file."""
_PERMISSION_ERRORS = {errno.EACCES, errno.EPERM}
"""Error numbers that mean that the user has no permission for a file."""
INVALID_NAME_REASON = "this file name is not valid"
"""The reason in messages about a path that the operating system refuses without a reason."""


def file_fault(
    error: OSError, path: Path | str, doing: Literal["read", "written", "listed", "used"] = "read"
) -> EnlivenError:
    """Converts the error of a failed operation on a file or folder to an error for users, with its path and a
    remedy.

    Args:
        doing: the failed operation as a participle, such as "read" in "it cannot be read".

    Returns:
        ResourceError for an error of the device or of this machine, and for all failed writes. Otherwise
        InputError.
    """
    problem = f"it cannot be {doing} ({error.strerror or error})"
    remedy = _DEVICE_FAULTS.get(error.errno or 0)
    if remedy is not None:
        return ResourceError(problem, where=str(path), remedy=remedy)
    if doing == "written":
        return ResourceError(problem, where=str(path), remedy=_WRITE_ADVICE)
    remedy = (
        "Check the permissions of the file or folder."
        if error.errno in _PERMISSION_ERRORS
        else "Choose a readable file."
    )
    return InputError(problem, where=str(path), remedy=remedy)


def is_file_fault(error: OSError) -> bool:
    """Returns True if an operating system error concerns a file, a folder or their device."""
    number = error.errno or 0
    is_device = number in _DEVICE_FAULTS and not isinstance(error, ConnectionError | TimeoutError)
    return is_device or error.filename is not None or number in _PERMISSION_ERRORS


@contextlib.contextmanager
def explain_write_errors(path: Path, remedy: str) -> Iterator[None]:
    """Converts operating system errors in the ``with`` block to an error that contains the file and the
    remedy."""
    try:
        yield
    except OSError as error:
        fault = file_fault(error, path, "written")
        raise ResourceError(fault.what, where=fault.where, remedy=remedy or fault.remedy) from None
