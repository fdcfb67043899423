"""Errors that say what was wrong, where it was, and what to do about it."""

from __future__ import annotations

from enliven.logs import escaped


class EnlivenError(Exception):
    """A failure that a user can understand and mend; the command line prints it without a traceback.

    Args:
        what: what was wrong, one sentence without the final full stop.
        where: the file, port, sensor or field it was found in.
        mend: what to do about it, one sentence.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", mend: str = "") -> None:
        self.what, self.where, self.mend = what, where, mend
        message = f"{where}: {what}" if where else what
        super().__init__(escaped(f"{message}. {mend}" if mend else message))


class InputError(EnlivenError):
    """A file, frame, mesh or setting that cannot be used (exit code 3)."""

    exit_code = 3


class ResourceError(EnlivenError):
    """Something of this machine that is missing or taken: a port, a sensor, OpenGL (exit code 4)."""

    exit_code = 4
