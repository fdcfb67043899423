"""Opens the files that another file refers to, within its folder.

These are buffers and images of a glTF, or materials and textures of an OBJ. They must be regular files of
limited size in the folder of the first file or below it. Pipes, devices, links to other folders and paths
that leave the folder raise an error.
"""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from enliven.errors import InputError, find_plain_reason
from enliven.files.faults import INVALID_NAME_REASON
from enliven.files.reading import MAX_FILE_BYTES, read_file

_SAME_FOLDER_ADVICE = "Store all files of the model in one folder."
_recorded_references: ContextVar[list[Path] | None] = ContextVar("references", default=None)
"""The paths that :func:`record_references` collects in this thread, or None."""


@contextlib.contextmanager
def record_references() -> Iterator[list[Path]]:
    """Collects the absolute paths of all files that are opened by reference from other files in this thread,
    including missing files.

    A cache needs these paths, because an entry is outdated if one of the files has changed.
    """
    paths: list[Path] = []
    token = _recorded_references.set(paths)
    try:
        yield paths
    finally:
        _recorded_references.reset(token)


class ReferencedFiles:
    """Opens the files that another file refers to, if they are in its folder or below.

    Args:
        path: path of the file that refers to the others.
        max_bytes: maximum total size of all reads in bytes. A file that is referred to a thousand times
            counts a thousand times.
    """

    def __init__(self, path: Path, max_bytes: int = MAX_FILE_BYTES) -> None:
        self._path, self._left = path, max_bytes

    def read_uri(self, uri: str) -> bytes:
        """Returns the bytes of a data URI, or of the file at a percent-encoded relative URI.

        Raises:
            InputError: in the cases of :meth:`read_named_file`, or if the URI contains invalid data.
        """
        if not uri.startswith("data:"):
            return self.read_named_file(unquote(uri))
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
        except ValueError:
            raise self._reference_error(
                uri, "contains data that cannot be decoded", "Export the model again."
            ) from None

    def read_named_file(self, name: str) -> bytes:
        """Returns the bytes of a file by its name, relative to the folder.

        Raises:
            InputError: if it is outside of the folder, missing or not a regular file, or exceeds the byte
                limit together with earlier reads.
        """
        try:
            folder = self._path.parent.resolve()
            target = (folder / name).resolve()
            if not target.is_relative_to(folder):
                raise self._reference_error(
                    name, "is outside of the folder of the model", _SAME_FOLDER_ADVICE
                )
            if (recorded := _recorded_references.get()) is not None:
                recorded.append(target)
            data = read_file(target, self._left)
        except InputError as error:
            if error.where == str(self._path):
                raise
            raise self._reference_error(name, f"cannot be read ({error.what})", _SAME_FOLDER_ADVICE) from None
        except (OSError, ValueError, RuntimeError) as error:
            # Symbolic links form a loop, or the name is invalid.
            raise self._reference_error(
                name, f"cannot be read ({find_plain_reason(error, INVALID_NAME_REASON)})", _SAME_FOLDER_ADVICE
            ) from None
        self._left -= len(data)
        return data

    def _reference_error(self, name: str, problem: str, remedy: str) -> InputError:
        return InputError(
            f"the referenced file {name[:80]!r} {problem}", where=str(self._path), remedy=remedy
        )
