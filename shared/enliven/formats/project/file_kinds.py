"""Detects the kind of a file from its first bytes, for error messages about files with a wrong ending."""

from __future__ import annotations

import codecs
import zipfile
from io import BytesIO

_FILE_KINDS: tuple[tuple[int, bytes, str, str], ...] = (
    (0, b"\x89PNG\r\n\x1a\n", "a PNG picture", ""),
    (0, b"\xff\xd8\xff", "a JPEG picture", ""),
    (0, b"GIF8", "a GIF picture", ""),
    (0, b"BM", "a BMP picture", ""),
    (0, b"%PDF", "a PDF document", ""),
    (0, b"glTF", "a glTF model", ".glb"),
    (0, b"ply\n", "a PLY mesh", ".ply"),
    (0, b"ply\r", "a PLY mesh", ".ply"),
    (0, b"Kaydara FBX", "an FBX model", ""),
    (0, b"BLENDER", "a Blender scene", ""),
    (0, b"\x89MCAP", "a recording", ".mcap"),
    (0, b"HIERARCHY", "a motion capture", ".bvh"),
    (4, b"ftyp", "a film", ""),
    (0, b"RIFF", "a sound or film", ""),
    (0, b"\x1aE\xdf\xa3", "a film", ""),
    (0, b"fLaC", "a sound", ""),
    (0, b"OggS", "a sound", ""),
    (0, b"ID3", "a sound", ""),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", ""),
    (0, b"\x1f\x8b", "a gzip archive", ""),
    (0, b"Rar!", "a RAR archive", ""),
    (0, b"\x7fELF", "a program", ""),
    (0, b"MZ", "a program", ""),
    (0, b"SQLite format 3", "a database", ""),
)
"""The known kinds of files: the offset of the magic bytes, the magic bytes, the name, and the suffix with
which enliven opens the kind."""
_ARCHIVE_KIND_BY_ENTRY = {
    "[Content_Types].xml": "an Office document",
    "mimetype": "an OpenDocument file or e-book",
    "META-INF/MANIFEST.MF": "a Java program",
    "AndroidManifest.xml": "an Android app",
}
"""Names of entries that identify special kinds of ZIP archives."""
_SAMPLE_BYTES = 4096
"""Number of bytes that are examined to distinguish text from other data."""
_MAX_SHOWN_LETTERS = 40
"""Maximum number of characters of an entry's name that a message shows."""


def describe_file_kind(data: bytes) -> tuple[str, str]:
    """Returns the kind of a file, such as "a PNG picture", and its usual ending.

    The ending is empty for files that enliven does not open.
    """
    if not data:
        return "an empty file", ""
    for offset, mark, name, ending in _FILE_KINDS:
        if data[offset : offset + len(mark)] == mark:
            return name, ending
    if data.startswith(b"PK"):
        return _archive_kind(data), ""
    if not any(data[:_SAMPLE_BYTES]):
        return "a file of zeros", ""
    return _text_kind(data)


def _archive_kind(data: bytes) -> str:
    """Describes a ZIP archive by its entries."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return "a ZIP archive that is truncated or damaged"
    for name, kind in _ARCHIVE_KIND_BY_ENTRY.items():
        if name in names:
            return kind
    if not names:
        return "an empty ZIP archive"
    shown = "".join(letter if letter.isprintable() else "?" for letter in names[0][:_MAX_SHOWN_LETTERS])
    return f"a ZIP archive with {len(names)} file{'s' * (len(names) != 1)}, such as {shown}"


def _text_kind(data: bytes) -> tuple[str, str]:
    """Returns the kind of a text file, or "data of an unknown kind"."""
    sample = data[:_SAMPLE_BYTES].removeprefix(codecs.BOM_UTF8)
    if b"\0" in sample or sum(byte < 9 or 13 < byte < 32 for byte in sample) > len(sample) // 20:
        return "data of an unknown kind", ""
    begin = sample.lstrip()
    if begin.startswith((b"{", b"[")):
        return ("a glTF model", ".gltf") if b'"asset"' in data[:65536] else ("JSON text", "")
    if begin.startswith(b"<"):
        return "a web page or XML text", ""
    return "text", ""
