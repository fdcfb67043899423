"""Logging for people and for services: plain or JSON lines, with text from outside escaped."""

from __future__ import annotations

import io
import json
import logging
import re
import sys
import time
import unicodedata
import warnings
from typing import Any

OWN_LOGGERS = ("enliven", "enliven_edge", "enliven_viewer", "py.warnings")
"""The loggers of these packages, and of Python's warnings."""


_KEPT_CATEGORIES = frozenset({"Zs"})
"""Unicode categories of spaces, which are invisible and move no other character."""
_KEPT_JOINERS = frozenset("\u200c\u200d")
"""Joiners that Persian, Hindi and emoji need. They neither end a line nor change its direction."""
_ASCII_PATTERN = re.compile(r"[\x20-\x7e]*")


def escape_text(text: str) -> str:
    r"""Returns text with every non-printable character written as ``\x1b`` or ``\u202e``.

    These are control characters, line ends, terminal escapes, marks that change the direction of writing, and
    surrogates. Escaping text again changes nothing.
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
    """A log record with messages of one printable line: ids and names from outside cannot forge further
    lines."""

    def getMessage(self) -> str:
        """Returns the message with every non-printable character escaped."""
        return escape_text(super().getMessage())


def escape_records() -> None:
    """Escapes the messages of all further records of enliven's loggers, also for handlers of other
    programs."""
    make = logging.getLogRecordFactory()
    if getattr(make, "escapes", False):
        return

    def make_escaped(name: str | None, *values: Any, **more: Any) -> logging.LogRecord:
        if name is None:  # logging.makeLogRecord passes no name, and sets it later.
            return make(name, *values, **more)
        if name.partition(".")[0] in OWN_LOGGERS or name in OWN_LOGGERS:
            return EscapedRecord(name, *values, **more)
        return make(name, *values, **more)

    make_escaped.escapes = True  # type: ignore[attr-defined]
    logging.setLogRecordFactory(make_escaped)


class JsonLinesFormatter(logging.Formatter):
    """Formats a record as {"time", "level", "logger", "message"} and extra fields, one object per line,
    times in UTC."""

    _STANDARD_FIELDS = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime"}

    def format(self, record: logging.LogRecord) -> str:
        """Returns a record as one line of JSON."""
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line = {
            "time": f"{stamp}.{int(record.msecs):03d}Z",
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
    """Formats a record as its logger and its message. A Python warning becomes one sentence."""

    def format(self, record: logging.LogRecord) -> str:
        """Returns a record as a sentence for people."""
        name = "enliven" if record.name == "py.warnings" else record.name
        return f"{name}: {record.getMessage().strip()}"


class _LossyStream(io.FileIO):
    """A standard error that never fails: text that a closed pipe or a full disk refuses is dropped."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


def ignore_broken_stderr() -> None:
    """Prevents a failure of standard error from ending the process or changing its exit code."""
    try:
        stream = io.BufferedWriter(_LossyStream(sys.stderr.fileno(), "w", closefd=False))
        sys.stderr = io.TextIOWrapper(
            stream, sys.stderr.encoding, errors="backslashreplace", line_buffering=True
        )
    except (AttributeError, OSError):  # Standard error is missing, or it is not a file.
        return


def start_logging(*, as_json: bool = False, level: int = logging.INFO) -> None:
    """Sends the log of every logger under "enliven" to standard error, escaped."""
    escape_records()
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLinesFormatter() if as_json else SentenceFormatter())
    for name in OWN_LOGGERS:
        logger = logging.getLogger(name)
        logger.handlers[:] = [handler]
        logger.setLevel(level)
        logger.propagate = False
    # Print warnings without the source line that raised them.
    warnings.formatwarning = lambda message, *place, **more: str(message)
    logging.captureWarnings(True)
