"""Reads files of limited size, and decodes text of any usual encoding."""

from __future__ import annotations

import codecs
import io
import locale
import os
import stat
from pathlib import Path
from typing import BinaryIO

from enliven.errors import InputError
from enliven.files.faults import INVALID_NAME_REASON, file_fault

MAX_FILE_BYTES = 1 << 31
"""Maximum size in bytes of a file that is read completely, and of all files that it refers to. A scan of 20
million triangles with its images is smaller, and the memory of a small machine is larger.
"""
_READ_FLAGS = (
    os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
)
"""Flags for opening a file for reading. With them, opening a pipe without a writer does not block, so the
pipe can be refused."""
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
"""Byte order marks and the encodings that they mean. UTF-32 precedes UTF-16, because its mark starts with the
mark of UTF-16.
"""
_USUAL_CODE_PAGE = "cp1252"
"""The 8-bit code page that is assumed on computers that use UTF-8. Most old files are from Windows in western
Europe or America.
"""


class _ReportedFile(io.FileIO):
    """A file that is opened for reading. A failed read raises the error that :func:`file_fault` returns."""

    def readinto(self, buffer: bytearray | memoryview) -> int | None:  # type: ignore[override]
        try:
            return super().readinto(buffer)
        except OSError as error:
            raise file_fault(error, str(self.name)) from None

    def readall(self) -> bytes:
        try:
            return super().readall()
        except OSError as error:
            raise file_fault(error, str(self.name)) from None


def open_file(path: Path) -> BinaryIO:
    """Opens a regular file for reading.

    If a later read fails, it raises the error that :func:`file_fault` returns.

    Raises:
        InputError: if the file is missing or not readable, or is a folder, a pipe or a device.
        ResourceError: if its device fails.
    """
    try:
        descriptor = os.open(path, _READ_FLAGS)
    except FileNotFoundError:
        raise InputError("the file does not exist", where=str(path), remedy="Check the path.") from None
    except OSError as error:
        raise file_fault(error, path) from None
    except ValueError:
        remedy = "Choose a readable file."
        raise InputError(
            f"it cannot be read ({INVALID_NAME_REASON})", where=str(path), remedy=remedy
        ) from None
    kind = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(kind):
        os.close(descriptor)
        problem = (
            "the path is a folder, not a file"
            if stat.S_ISDIR(kind)
            else "the path is a pipe or a device, not a regular file"
        )
        raise InputError(problem, where=str(path), remedy="Choose a readable file.")
    return io.BufferedReader(_ReportedFile(str(path), "rb", opener=lambda *_: descriptor))


def is_file(path: Path | str) -> bool:
    """Returns True for an existing regular file.

    It returns False for a name that is too long, or in a folder that cannot be read. :meth:`Path.is_file`
    raises an OSError for these. A later :func:`read_file` then reports the reason.
    """
    return os.path.isfile(path)


def read_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Reads the bytes of a regular file of at most ``max_bytes`` bytes.

    Raises:
        InputError: in the cases of :func:`open_file`, or if the file is larger.
        ResourceError: if its device fails.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > max_bytes:
            problem = f"the file has {size} bytes, but at most {max_bytes} are allowed"
            raise InputError(problem, where=str(path), remedy="Use a smaller file.")
        return file.read(size)


def decode_text(data: bytes) -> str:
    """Decodes a text file of another program. Every line of the result ends in "\\n".

    If there is a byte order mark, it determines the encoding. Otherwise the encoding is UTF-8 if the bytes
    are valid UTF-8, and else the computer's 8-bit code page. All byte sequences can be decoded, so different
    names stay different.
    """
    for mark, encoding in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            text = data[len(mark) :].decode(encoding, "replace")
            break
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = _decode_code_page(data)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text


def text_bytes(data: bytes) -> bytes:
    """Converts a text file to bytes in which each line ends in b"\\n" and ASCII characters are single bytes.

    Readers of large files search these bytes and decode only names, by :func:`decode_text`. The bytes are
    UTF-8 or in the file's 8-bit code page.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_LE)):
        return decode_text(data).encode()
    data = data.removeprefix(codecs.BOM_UTF8)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _decode_code_page(data: bytes) -> str:
    """Decodes bytes in the locale's 8-bit code page, or in Latin-1 if the code page does not define all of
    them.
    """
    code_page = codecs.lookup(locale.getpreferredencoding(False)).name
    is_single_byte = code_page.startswith(("cp125", "iso8859", "koi8", "mac"))
    try:
        return data.decode(code_page if is_single_byte else _USUAL_CODE_PAGE)
    except UnicodeDecodeError:
        return data.decode("latin-1")
