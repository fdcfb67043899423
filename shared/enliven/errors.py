"""Exceptions with a message for users: a problem, its location and a remedy."""

from __future__ import annotations

from pathlib import Path

from enliven.logs import escape_text


class EnlivenError(Exception):
    """A failure that a user can understand and fix. The command line prints it without a traceback.

    Args:
        what: the problem, one sentence without the final full stop.
        where: the affected file, port, sensor or field.
        remedy: one sentence about the remedy.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what, self.where, self.remedy = what, where, remedy
        message = f"{where}: {what}" if where else what
        super().__init__(escape_text(f"{message}. {remedy}" if remedy else message))


class InputError(EnlivenError):
    """Raised for an invalid file, frame, mesh or setting (exit code 3)."""

    exit_code = 3


class LaterVersionError(InputError):
    """Raised for a file of a later version than this version of enliven can read.

    The file is neither used nor replaced.
    """


class ResourceError(EnlivenError):
    """Raised if a port, a sensor, OpenGL or another resource is missing or in use (exit code 4)."""

    exit_code = 4


_MAX_PROGRAM_NAME_LENGTH = 40
"""Maximum length of a program's name that an error message quotes from a file."""


def refuse_later_version(version: int, newest: int, where: str, made_by: str = "") -> None:
    """Raises LaterVersionError if a file has a later version than the newest supported version.

    Args:
        version: the version in the file.
        newest: the newest version of the file format that this version of enliven can read.
        where: the file, and the location in the file.
        made_by: the program that wrote the file, such as "enliven 0.3.0". Empty if unknown.
    """
    if version <= newest:
        return
    # Imported here, because a package that is still being loaded has no version yet.
    from enliven import __version__

    program = f", written by {made_by[:_MAX_PROGRAM_NAME_LENGTH]}" if made_by else ""
    remedy = f"This is enliven {__version__}, which reads files up to version {newest}. Update enliven."
    raise LaterVersionError(
        f"the file has the later format version {version}{program}", where=where, remedy=remedy
    )


def find_plain_reason(error: BaseException, otherwise: str = "its contents contradict each other") -> str:
    """Returns the reason of a failure in words for users.

    The result contains only sentences of enliven and of the operating system, and no names of Python
    exceptions and no texts of parsers.

    Args:
        error: the exception of a library.
        otherwise: the result for an exception without useful information.
    """
    if isinstance(error, EnlivenError):
        return error.what
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, MemoryError):
        return "more memory is needed than is available"
    if isinstance(error, RecursionError):
        return "its contents are nested too deeply"
    if isinstance(error, LookupError):
        return "its contents refer to an entry that does not exist"
    return otherwise


def error_location(error: BaseException) -> str:
    """Returns the source location of an internal error, as a suffix for a message.

    The suffix is empty if the location is unknown.
    """
    trace = error.__traceback__
    if trace is None:
        return ""
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f", in {Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno}"
