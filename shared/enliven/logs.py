"""Logging as plain lines for people or JSON lines for services. Untrusted text is escaped.

A log file is rotated, and repeated warnings are limited, so that a program that runs for months cannot fill
its disk.
"""

from __future__ import annotations

import contextlib
import io
import json
import logging
import logging.handlers
import re
import sys
import threading
import time
import unicodedata
import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

OWN_LOGGERS = ("enliven", "enliven_edge", "enliven_viewer", "py.warnings")
"""Names of the loggers of enliven's packages and of Python's warnings."""


MAX_LOG_FILE_BYTES = 5_000_000
"""Maximum size of a log file in bytes. A full file is renamed to ``FILE.1``, and a new file is started."""
MAX_OLD_LOG_FILES = 3
"""Maximum number of renamed log files. ``FILE.1`` is the newest. All log files together have at most 20
MB."""
REPEAT_WINDOW_S = 60.0
"""Time window in seconds in which the number of identical warnings is limited."""
MAX_REPEATS = 3
"""Maximum number of identical warnings in :data:`REPEAT_WINDOW_S`. Further warnings are counted, but not
logged."""
_DECISION = "is_repeated_too_often"
"""Attribute of a log record that stores the decision of :class:`RepeatLimit`."""
_MAX_REMEMBERED_WARNINGS = 256
"""Maximum number of different warnings that are counted. It limits the memory."""


_KEPT_CATEGORIES = frozenset({"Zs"})
"""Unicode categories that are not escaped although Python counts them as unprintable: spaces, which do not
affect other characters."""
_KEPT_JOINERS = frozenset("\u200c\u200d")
"""Joiner characters that are not escaped, because Persian, Hindi and emoji need them. They neither end a line
nor change its direction."""
_ASCII_PATTERN = re.compile(r"[\x20-\x7e]*")


def escape_text(text: str) -> str:
    r"""Returns text with every non-printable character written as ``\x1b`` or ``\u202e``.

    Non-printable characters are control characters, line ends, terminal escapes, marks that change the
    writing direction, and surrogates. Escaping is idempotent.
    """
    if _ASCII_PATTERN.fullmatch(text):
        return text
    return "".join(letter if _is_printable(letter) else _escape_character(letter) for letter in text)


def _is_printable(letter: str) -> bool:
    """Returns True if a character is printable on one line."""
    category = unicodedata.category(letter)
    return category[0] not in "CZ" or category in _KEPT_CATEGORIES or letter in _KEPT_JOINERS


def _escape_character(letter: str) -> str:
    """Returns a character as Python writes it in a text literal."""
    return ascii(letter)[1:-1]


class EscapedRecord(logging.LogRecord):
    """A log record with a message of one printable line, so that untrusted ids and names cannot forge
    additional lines."""

    def getMessage(self) -> str:
        """Returns the message with every non-printable character escaped."""
        return escape_text(super().getMessage())


def escape_records() -> None:
    """Escapes the messages of all later records of enliven's loggers, also for handlers of other programs."""
    make = logging.getLogRecordFactory()
    if getattr(make, "escapes", False):
        return

    def make_escaped(name: str | None, *values: Any, **more: Any) -> logging.LogRecord:
        if name is None:  # logging.makeLogRecord does not pass a name, and sets it later.
            return make(name, *values, **more)
        if name.partition(".")[0] in OWN_LOGGERS or name in OWN_LOGGERS:
            return EscapedRecord(name, *values, **more)
        return make(name, *values, **more)

    make_escaped.escapes = True  # type: ignore[attr-defined]
    logging.setLogRecordFactory(make_escaped)


class JsonLinesFormatter(logging.Formatter):
    """Formats a record as a JSON object in one line, with the fields "time" (UTC), "level", "logger",
    "message", and extra fields."""

    _STANDARD_FIELDS = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", _DECISION}

    def format(self, record: logging.LogRecord) -> str:
        """Returns a record as one line of JSON."""
        timestamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line = {
            "time": f"{timestamp}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        line |= {
            k: v
            for k, v in vars(record).items()
            if k not in self._STANDARD_FIELDS and k not in ("message", "asctime")
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str).replace("\x7f", "\\u007f")


class SentenceFormatter(logging.Formatter):
    """Formats a record as a line with its logger and its message. A Python warning becomes one sentence."""

    def format(self, record: logging.LogRecord) -> str:
        """Returns a record as a sentence for people."""
        name = "enliven" if record.name == "py.warnings" else record.name
        return f"{name}: {record.getMessage().strip()}"


class _LossyStream(io.FileIO):
    """A stream for standard error that never raises. Text that cannot be written, because of a closed pipe or
    a full disk, is dropped.
    """

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


def ignore_broken_stderr() -> None:
    """Prevents write errors on standard error from ending the process or changing its exit code."""
    try:
        stream = io.BufferedWriter(_LossyStream(sys.stderr.fileno(), "w", closefd=False))
        sys.stderr = io.TextIOWrapper(
            stream, sys.stderr.encoding, errors="backslashreplace", line_buffering=True
        )
    except (AttributeError, OSError):  # Standard error is missing, or it is not a file.
        return


class RepeatLimit(logging.Filter):
    """A filter that drops identical warnings and errors beyond :data:`MAX_REPEATS` within
    :data:`REPEAT_WINDOW_S`.

    The first identical warning after this time contains the number of dropped warnings.

    Args:
        clock: a function that returns the time in seconds. Tests replace it.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock, self._lock = clock, threading.Lock()
        self._seen: OrderedDict[tuple[str, int, str], tuple[float, int]] = OrderedDict()

    def filter(self, record: logging.LogRecord) -> bool:
        """Returns False for a record that is dropped."""
        if record.levelno < logging.WARNING:
            return True
        # Each handler calls the filter. Store the decision, because all handlers need the same decision.
        decision = vars(record).get(_DECISION)
        if decision is None:
            decision = vars(record)[_DECISION] = self._count_record(record)
        return bool(decision)

    def _count_record(self, record: logging.LogRecord) -> bool:
        """Counts a record. Returns False if it must be dropped."""
        message, now = record.getMessage(), self._clock()
        key = record.name, record.levelno, message
        with self._lock:
            start_s, count = self._seen.pop(key, (now, 0))
            omitted = count - MAX_REPEATS if now - start_s >= REPEAT_WINDOW_S else 0
            if now - start_s >= REPEAT_WINDOW_S:
                start_s, count = now, 0
            self._seen[key] = start_s, count + 1
            while len(self._seen) > _MAX_REMEMBERED_WARNINGS:
                self._seen.popitem(last=False)
        if omitted > 0:
            record.msg, record.args = f"{message} (this message was omitted {omitted} times)", ()
        return count < MAX_REPEATS


class _DatedFormatter(SentenceFormatter):
    """Formats a record for a log file: time in UTC, level, and sentence."""

    def format(self, record: logging.LogRecord) -> str:
        timestamp = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(record.created))
        return f"{timestamp}Z {record.levelname} {super().format(record)}"


class _LogFile(logging.handlers.RotatingFileHandler):
    """A log file of limited size. If the disk is full, lines are lost, but the program continues."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Drops a line that cannot be written."""

    def close(self) -> None:
        """Closes the file, even if its last line cannot be written."""
        with contextlib.suppress(OSError):
            super().close()


@dataclass(frozen=True)
class LogOptions:
    """The log options of a command line.

    Attributes:
        as_json: True writes JSON lines.
        file: path of the log file. None means standard error.
    """

    as_json: bool = False
    file: Path | None = None


def split_log_options(arguments: Sequence[str]) -> tuple[list[str], LogOptions]:
    """Separates the log options, which every command has, from a command line. Returns the other arguments
    and the options.

    They are ``--log-json``, and ``--log-file FILE`` or ``--log-file=FILE``. Arguments after "--" are kept.

    Raises:
        ValueError: if the name of the file is missing.
    """
    other_arguments: list[str] = []
    as_json, file = False, None
    words = iter(arguments)
    for word in words:
        if word == "--":
            other_arguments += [word, *words]
        elif word == "--log-json":
            as_json = True
        elif word == "--log-file" or word.startswith("--log-file="):
            name = word.partition("=")[2] if "=" in word else next(words, "")
            if not name:
                raise ValueError("the option --log-file has no file name")
            file = Path(name)
        else:
            other_arguments.append(word)
    return other_arguments, LogOptions(as_json, file)


def start_logging(*, as_json: bool = False, level: int = logging.INFO, file: Path | None = None) -> None:
    """Configures the loggers of enliven to write escaped lines to standard error or to a file.

    Args:
        file: path of a log file, which is rotated. The log is also written to standard error if it is a
            terminal, but not otherwise, because a supervisor may collect it without a size limit.

    Raises:
        OSError: if the file cannot be written.
    """
    escape_records()
    handlers: list[logging.Handler] = []
    if file is None or sys.stderr.isatty():
        handlers.append(logging.StreamHandler(sys.stderr))
        handlers[0].setFormatter(JsonLinesFormatter() if as_json else SentenceFormatter())
    if file is not None:
        handlers.append(
            _LogFile(file, maxBytes=MAX_LOG_FILE_BYTES, backupCount=MAX_OLD_LOG_FILES, encoding="utf-8")
        )
        handlers[-1].setFormatter(JsonLinesFormatter() if as_json else _DatedFormatter())
    limit = RepeatLimit()
    for handler in handlers:
        handler.addFilter(limit)
    for name in OWN_LOGGERS:
        logger = logging.getLogger(name)
        logger.handlers[:] = handlers
        logger.setLevel(level)
        logger.propagate = False
    # Show Python warnings without the source line that raised them.
    warnings.formatwarning = lambda message, *place, **more: str(message)
    logging.captureWarnings(True)
