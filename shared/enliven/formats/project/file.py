"""Reads and writes project files (.enliven). A file contains an artist's complete work, and all later
versions of enliven can read it.

The file is a zip archive of project.json (the document with its version) and arrays/<name>.npy, so other
tools can read it. The name of an array is a checksum of its content, so that damage is detected. Writing is
atomic: the previous file is replaced only when the new one is complete.
"""

from __future__ import annotations

import io
import json
import logging
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from enliven import __version__
from enliven.arrays import AnyArray
from enliven.document import Project
from enliven.errors import InputError, refuse_later_version
from enliven.files import DAMAGE, is_file, read_file, write_file
from enliven.formats.npy import read_npy
from enliven.formats.project.file_kinds import describe_file_kind
from enliven.formats.project.lost_motion import replace_lost_motion
from enliven.formats.project.upgrades import combine_characters
from enliven.formats.project.values import UnknownFieldError, array_checksum, pack, unpack

VERSION = 2
"""The version of the format. An added field needs no new version, but a changed meaning of an existing field
does."""
_UPGRADE_BY_VERSION: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {1: combine_characters}
"""For each older version, the function that converts a project object to the next version."""
_FORMAT = "enliven project"
_HEADER, _ARRAYS = "project.json", "arrays/"
_READABLE_ZIP_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Accepted zip methods: stored and deflated. Other methods can allocate gigabytes before the first byte."""
_BASE_UNPACKED_BYTES = 1 << 28
"""Unpacked size, in bytes, that is always allowed: 256 MB. Constant arrays of this size are compressed to 300
kB."""
_MAX_UNPACKED_RATIO = 20
"""Maximum number of additional unpacked bytes per byte of the file. Motion is only compressed to a third of
its size, so the ratio of usual files is far below this limit."""
_COMPRESSION_LEVEL = 1
"""Compression level of zip. Compared with the default 6, the file is 3 % larger, but compression takes a
quarter of the time. Speed matters, because an edit on a stage waits for the compression."""
_ZIP_ENTRY_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of every zip entry: the earliest date that zip can store. With a fixed date, equal projects give equal
files."""


def write_project(path: Path | str, project: Project) -> None:
    """Writes a project. Equal projects give identical files.

    Raises:
        InputError: if the existing file is a project of a later version. It is then not replaced.
        ResourceError: if the file cannot be written. An existing file stays unchanged.
    """
    refuse_later_project(Path(path))
    write_file(Path(path), project_bytes(project), "Save the project in another folder.")


def refuse_later_project(path: Path) -> None:
    """Raises LaterVersionError if a file is a project of a later version. Call it before replacing the
    file."""
    if not is_file(path):  # Skip pipes, because opening a pipe blocks until its other end is opened.
        return
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo(_HEADER).file_size > _BASE_UNPACKED_BYTES:
                return
            header = json.loads(_unpack_entry(archive, _HEADER))
    except (OSError, zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, *DAMAGE):
        # The file does not exist, or it is not a project. If it cannot be replaced, the writer reports the
        # error.
        return
    if isinstance(header, dict) and header.get("format") == _FORMAT:
        _refuse_later(header, str(path))


def read_project(path: Path | str) -> Project:
    """Reads a project of this or any earlier version.

    Raises:
        InputError: if the file is missing, not a project, truncated, damaged, or of a later version. There is
            no error for missing or damaged motion of a possessed mesh that can be solved again. The mesh is
            then at rest.
    """
    path = Path(path)
    return parse_project(read_file(path), str(path))


def project_bytes(project: Project) -> bytes:
    """Returns the bytes that :func:`write_project` writes."""
    arrays: dict[str, AnyArray] = {}
    header = {"format": _FORMAT, "version": VERSION, "made_by": __version__}
    header["project"] = pack(project, arrays)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        text = json.dumps(header, ensure_ascii=False, separators=(",", ":"))
        archive.writestr(_zip_entry(_HEADER), text, compresslevel=_COMPRESSION_LEVEL)
        for name, array in arrays.items():
            numbers = io.BytesIO()
            np.save(numbers, array, allow_pickle=False)
            archive.writestr(
                _zip_entry(f"{_ARRAYS}{name}.npy"), numbers.getvalue(), compresslevel=_COMPRESSION_LEVEL
            )
    return buffer.getvalue()


def parse_project(data: bytes, where: str = "project", most: int | None = None) -> Project:
    """Reads a project from the bytes of a file. ``where`` is the name of the file in error messages.

    Args:
        most: maximum unpacked size in bytes. None uses the limits of a file.
    """
    if not data.startswith(b"PK"):
        raise _make_foreign_file_error(data, where)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_sizes(archive, len(data), where, most)
            header = _upgrade_header(archive, where, data)
            arrays, damaged = _read_arrays(archive)
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, *DAMAGE) as error:
        logging.getLogger(__name__).debug("project", exc_info=error)
        problem = "the project file is truncated or damaged: its archive cannot be unpacked"
        raise InputError(problem, where=where, remedy="Use an earlier copy of the project.") from None
    try:
        project, lost = replace_lost_motion(header["project"], arrays)
        if damaged - lost:
            raise InputError("an array in the project is damaged", where="project")
        document = unpack(Project, project, arrays, "project")
    except InputError as error:
        advice = error.remedy or "Use an earlier copy of the project."
        if isinstance(error, UnknownFieldError):
            advice = _make_unknown_field_advice(header.get("made_by"))
        raise InputError(error.what, where=f"{where}, {error.where}", remedy=advice) from None
    except DAMAGE as error:
        logging.getLogger(__name__).debug("project", exc_info=error)
        problem = "the project file is damaged: its parts are inconsistent"
        raise InputError(problem, where=where, remedy="Use an earlier copy of the project.") from None
    assert isinstance(document, Project)
    return document


def _make_unknown_field_advice(made_by: Any) -> str:
    """Returns the advice about a field that this version does not know.

    Args:
        made_by: the version of enliven that wrote the file, as stated in the file.
    """
    if made_by == __version__:
        return "Use an earlier copy of the project."
    return (
        f"The project was saved by enliven {made_by!s:.40}, but this is enliven {__version__}: update "
        "enliven."
    )


def _zip_entry(name: str) -> zipfile.ZipInfo:
    """Returns a zip entry with a fixed date, so that equal projects give equal files."""
    info = zipfile.ZipInfo(name, _ZIP_ENTRY_DATE)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _check_sizes(archive: zipfile.ZipFile, packed: int, where: str, max_bytes: int | None) -> None:
    """Checks the declared unpacked size before unpacking. Raises InputError if it is larger than for any
    plausible project.
    """
    entries = archive.infolist()
    total = sum(entry.file_size for entry in entries)
    if total > (_BASE_UNPACKED_BYTES + _MAX_UNPACKED_RATIO * packed if max_bytes is None else max_bytes):
        problem = (
            f"the file of {packed} bytes would unpack to {total} bytes, which is more than a project needs"
        )
        raise InputError(problem, where=where, remedy="Get a new copy of the project.")
    if any(entry.compress_type not in _READABLE_ZIP_METHODS for entry in entries):
        raise InputError(
            "the compression method of the file is not supported",
            where=where,
            remedy="Save the project again.",
        )


def _unpack_entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """Unpacks an entry. Reads at most one byte more than its declared size, because the zip library does not
    enforce this size.
    """
    entry = archive.getinfo(name)
    with archive.open(entry) as file:
        return file.read(entry.file_size + 1)


def _make_foreign_file_error(data: bytes, where: str) -> InputError:
    """Returns the error for a file that is not a project. The message contains the kind of the file."""
    kind, ending = describe_file_kind(data)
    advice = "Choose a project that was saved by enliven."
    if ending:
        advice = f"To open the file, rename it to a name ending in {ending}."
    return InputError(f"the file is not an enliven project, but {kind}", where=where, remedy=advice)


def _upgrade_header(archive: zipfile.ZipFile, where: str, data: bytes) -> dict[str, Any]:
    """Returns the content of project.json, upgraded to the current version."""
    try:
        header = json.loads(_unpack_entry(archive, _HEADER))
    except (KeyError, ValueError, RecursionError):
        header = None
    if not isinstance(header, dict) or header.get("format") != _FORMAT:
        raise _make_foreign_file_error(data, where)
    version, project = header.get("version"), header.get("project")
    # Check the version first, because a later version may store all other data differently.
    _refuse_later(header, where)
    if not _is_integer(version) or not isinstance(project, dict) or version < 1:
        raise InputError(
            "the header of the project file is damaged",
            where=where,
            remedy="Use an earlier copy of the project.",
        )
    for step in range(version, VERSION):
        project = _UPGRADE_BY_VERSION[step](project)
    header["project"] = project
    return header


def _refuse_later(header: dict[str, Any], where: str) -> None:
    """Raises LaterVersionError if the header contains a later version."""
    version, maker = header.get("version"), header.get("made_by")
    if _is_integer(version):
        refuse_later_version(version, VERSION, where, f"enliven {maker}" if maker else "")


def _is_integer(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)


def _read_arrays(archive: zipfile.ZipFile) -> tuple[dict[str, AnyArray], set[str]]:
    """Reads the arrays. Returns the arrays by name, and the names of damaged arrays. The content of a damaged
    array does not match the checksum in its name.
    """
    arrays, damaged = dict[str, AnyArray](), set[str]()
    for entry in archive.namelist():
        if not entry.startswith(_ARRAYS):
            continue
        name = entry.removeprefix(_ARRAYS).removesuffix(".npy")
        try:
            array = read_npy(_unpack_entry(archive, entry))
        except (OSError, zipfile.BadZipFile, zlib.error, *DAMAGE):
            array = None
        if array is None or array_checksum(array) != name:
            damaged.add(name)
        else:
            arrays[name] = array
    return arrays, damaged
