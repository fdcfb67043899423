"""Reads files from other programs: checks their size before reading, and opens only what lies beside them.

A file is read whole by :func:`read_file`, and a file of our own is written whole by :func:`write_file`. Every
file that a file names (buffers and pictures of a glTF, materials and textures of an OBJ) is opened by
:class:`Beside`: regular files of that file's own folder or below it, of a bounded size. Pipes, devices, links
that lead elsewhere and paths that climb out are refused in a sentence.
"""

from __future__ import annotations

import base64
import contextlib
import difflib
import os
import stat
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote, unquote_to_bytes

from enliven.errors import InputError, ResourceError, plain_reason

MOST_BYTES = 1 << 31
"""Bytes of one file that is read whole, and of all that it names together: more than a scan of 20 million
triangles with its pictures has, and still less than a small machine's memory."""
DAMAGE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    RecursionError,
)
"""The exceptions that parsers raise on a damaged file's numbers; a check for each number would be most of a
reader."""
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""A pipe without a writer is opened and refused, not waited for."""
_ROOM = "Check the folder's permissions and the space on the disk."
NO_NAME = "no file can have that name"
"""What is wrong with a path that the system refuses without a reason of its own."""
_TOGETHER = "Keep the files of the model in one folder."


def own_folder() -> Path:
    """Returns the user's own folder for data that programs keep between runs."""
    given = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(given) if given else Path.home() / ".local" / "state") / "enliven"


def open_file(path: Path) -> BinaryIO:
    """Opens a regular file for reading.

    Raises:
        InputError: where there is none, it may not be read, or it is a folder, a pipe or a device.
    """
    try:
        descriptor = os.open(path, _FLAGS)
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path), mend="Check the path.") from None
    except (OSError, ValueError) as error:
        reason = plain_reason(error, NO_NAME)
        mend = "Name a file that can be read."
        raise InputError(f"it cannot be read ({reason})", where=str(path), mend=mend) from None
    kind = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(kind):
        os.close(descriptor)
        what = "it is a folder" if stat.S_ISDIR(kind) else "it is no regular file but a pipe or a device"
        raise InputError(what, where=str(path), mend="Name a file that can be read.")
    return os.fdopen(descriptor, "rb")


def read_file(path: Path, most: int = MOST_BYTES) -> bytes:
    """Reads the bytes of a regular file of at most ``most`` bytes.

    Raises:
        InputError: as :func:`open_file`, and for a file that is larger.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            what = f"it has {size} bytes, and no more than {most} are read"
            raise InputError(what, where=str(path), mend="Take a smaller one.")
        try:
            return file.read(size)
        except OSError as error:
            what = f"it cannot be read ({error.strerror or error})"
            raise InputError(what, where=str(path), mend="Name a file that can be read.") from None


def need_folder(*paths: Path | None) -> None:
    """Refuses files to be made in a folder that is not there, before any work; None is no file.

    Raises:
        ResourceError: which folder is missing, with the nearest name beside it.
    """
    for path in paths:
        folder = Path() if path is None else path.parent
        if not folder.is_dir():
            there = [one.name for one in folder.parent.iterdir()] if folder.parent.is_dir() else []
            near = difflib.get_close_matches(folder.name, there, n=1)
            guess = f"Did you mean {folder.with_name(near[0])}? " if near else ""
            what, mend = f"there is no folder {str(folder)!r}", f"{guess}Make it, or check its name."
            raise ResourceError(what, where=str(path), mend=mend)


def write_file(path: Path, data: bytes | str, mend: str = _ROOM) -> None:
    """Writes a file whole or not at all, text as UTF-8, and its folder where that is not there.

    Args:
        mend: what to do where it cannot be written.

    Raises:
        ResourceError: where it cannot be written; then what was there is untouched.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        what = f"it cannot be written ({error.strerror or error})"
        raise ResourceError(what, where=str(path), mend=mend) from None


class Beside:
    """Opens the files that one file names: only those of its own folder or below.

    Args:
        path: of the file that names the others.
        most: bytes of all reads together: one file named a thousand times counts a thousand times.
    """

    def __init__(self, path: Path, most: int = MOST_BYTES) -> None:
        self._path, self._left = path, most

    def uri(self, uri: str) -> bytes:
        """Returns the bytes of a data URI, or of the file that a percent-encoded relative URI names.

        Raises:
            InputError: as :meth:`file`, and for data that is not what the URI says.
        """
        if not uri.startswith("data:"):
            return self.file(unquote(uri))
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
        except ValueError:
            raise self._wrong(uri, "cannot be decoded", "Export the model again.") from None

    def file(self, name: str) -> bytes:
        """Returns the bytes of a file by its name, relative to the folder.

        Raises:
            InputError: where it lies outside of the folder, is missing or no regular file, or is too large
                together with those that were read before.
        """
        try:
            folder = self._path.parent.resolve()
            found = (folder / name).resolve()
            if not found.is_relative_to(folder):
                raise self._wrong(name, "lies outside of its folder", _TOGETHER)
            data = read_file(found, self._left)
        except InputError as error:
            if error.where == str(self._path):
                raise
            raise self._wrong(name, f"cannot be read ({error.what})", _TOGETHER) from None
        except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a name that no file can have
            raise self._wrong(name, f"cannot be read ({plain_reason(error, NO_NAME)})", _TOGETHER) from None
        self._left -= len(data)
        return data

    def _wrong(self, name: str, what: str, mend: str) -> InputError:
        return InputError(f"its part {name[:80]!r} {what}", where=str(self._path), mend=mend)
