"""Project files (.enliven): everything an artist has made, in one file that later versions read for ever.

A zip archive of project.json (what there is, with its version) and arrays/<name>.npy, where the name is a
checksum of what is in it. So anything can look inside, and damage is noticed. Writing is atomic: the file
from before stays until the new one is whole.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from enliven import __version__
from enliven.arrays import AnyArray
from enliven.document import Project
from enliven.errors import InputError
from enliven.files import DAMAGE, read_file, write_file
from enliven.formats.npy import array_of
from enliven.formats.project.values import name_of, packed, unpacked

VERSION = 1
"""Of the format. A field more needs no new one; whatever changes the meaning of what was written does."""
_UPGRADES: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {}
"""For each version that is not the newest: the project's object as the next version has it."""
_FORMAT = "enliven project"
_HEADER, _ARRAYS = "project.json", "arrays/"
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""What is written, and plain bytes; other ways of packing may ask for gigabytes before a byte comes out."""
_FREE_BYTES, _MOST_RATIO = 1 << 28, 20
"""Bytes that a file may unpack to, however few it has, and more for each byte that it has: motion packs to a
third, and 256 MB that are all alike to 300 kB."""
_LONG_AGO = (1980, 1, 1, 0, 0, 0)


def write_project(path: Path | str, project: Project) -> None:
    """Write a project; the same project makes the same bytes.

    Raises:
        ResourceError: where the file cannot be written; one that was there stays.
    """
    write_file(Path(path), project_bytes(project), "Save it elsewhere.")


def read_project(path: Path | str) -> Project:
    """Read a project of this or any earlier version.

    Raises:
        InputError: where the file is missing, no project, cut short, damaged, or of a later version.
    """
    path = Path(path)
    return project_of(read_file(path), str(path))


def project_bytes(project: Project) -> bytes:
    """What :func:`write_project` writes."""
    arrays: dict[str, AnyArray] = {}
    header = {"format": _FORMAT, "version": VERSION, "made_by": __version__}
    header["project"] = packed(project, arrays)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(_entry(_HEADER), json.dumps(header, ensure_ascii=False, separators=(",", ":")))
        for name, array in arrays.items():
            numbers = io.BytesIO()
            np.save(numbers, array, allow_pickle=False)
            archive.writestr(_entry(f"{_ARRAYS}{name}.npy"), numbers.getvalue())
    return out.getvalue()


def project_of(data: bytes, where: str = "project") -> Project:
    """The project in the bytes of a file; ``where`` is named in errors."""
    if not data.startswith(b"PK"):
        raise InputError("it is no enliven project", where=where, mend="Open a file ending in .enliven.")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_sizes(archive, len(data), where)
            header = _header(archive, where)
            arrays = _arrays(archive, where)
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, *DAMAGE) as error:
        what = f"it is cut short or damaged ({str(error)[:80]})"
        raise InputError(what, where=where, mend="Take an earlier copy.") from None
    try:
        made = unpacked(Project, header["project"], arrays, "project")
    except InputError as error:
        mend = error.mend or "Take an earlier copy."
        raise InputError(error.what, where=f"{where}, {error.where}", mend=mend) from None
    except DAMAGE as error:
        what = f"what it says does not fit together ({type(error).__name__}: {str(error)[:80]})"
        raise InputError(what, where=where, mend="Take an earlier copy.") from None
    assert isinstance(made, Project)
    return made


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry without the time, so that the same project makes the same file."""
    info = zipfile.ZipInfo(name, _LONG_AGO)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _check_sizes(archive: zipfile.ZipFile, packed: int, where: str) -> None:
    """Refuse a file that states more than a project packs to: nothing of it is unpacked."""
    entries = archive.infolist()
    total = sum(entry.file_size for entry in entries)
    if total > _FREE_BYTES + _MOST_RATIO * packed:
        what = f"its {packed} bytes state that they unpack to {total}, which no project does"
        raise InputError(what, where=where, mend="Ask for the project again.")
    if any(entry.compress_type not in _METHODS for entry in entries):
        raise InputError("it is packed in a way that is not known here", where=where, mend="Save it again.")


def _unpacked_entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """The bytes of an entry: no more than it states, which is not left to the archive's own reader."""
    entry = archive.getinfo(name)
    with archive.open(entry) as file:
        return file.read(entry.file_size + 1)


def _header(archive: zipfile.ZipFile, where: str) -> dict[str, Any]:
    """What project.json says, brought to the newest version."""
    try:
        header = json.loads(_unpacked_entry(archive, _HEADER))
    except (KeyError, ValueError, RecursionError):
        header = None
    if not isinstance(header, dict) or header.get("format") != _FORMAT:
        raise InputError("it is no enliven project", where=where, mend="Open a file ending in .enliven.")
    version, project = header.get("version"), header.get("project")
    if not isinstance(version, int) or not isinstance(project, dict) or version < 1:
        raise InputError("it does not say what it is", where=where, mend="Take an earlier copy.")
    if version > VERSION:
        what = f"it is of version {version}, made by enliven {header.get('made_by')}"
        raise InputError(what, where=where, mend=f"This one reads up to {VERSION}: install a later one.")
    for step in range(version, VERSION):
        project = _UPGRADES[step](project)
    header["project"] = project
    return header


def _arrays(archive: zipfile.ZipFile, where: str) -> dict[str, AnyArray]:
    """Every array by its name, which is checked against what is in it."""
    arrays: dict[str, AnyArray] = {}
    for entry in archive.namelist():
        if not entry.startswith(_ARRAYS):
            continue
        name = entry.removeprefix(_ARRAYS).removesuffix(".npy")
        try:
            array = array_of(_unpacked_entry(archive, entry))
        except (OSError, *DAMAGE):
            array = None
        if array is None or name_of(array) != name:
            raise InputError("an array in it is damaged", where=where, mend="Take an earlier copy.")
        arrays[name] = array
    return arrays
