"""Records of supervised programs on disk: their current state, and the causes of their restarts.

Each program writes its own state to the runtime folder, which a restart of the computer empties:

- ``services/NAME.json``: a :class:`ServiceRecord`
- ``screen.png``: a recent picture of the window, if it is a kiosk

Restarts are lines of ``restarts.jsonl`` in the user's data folder, so that they survive a restart of the
computer. The health page reads both.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import TypeVar

import msgspec

from enliven.errors import InputError
from enliven.files import DECODE_ERRORS, read_file, user_data_folder, write_file

RUNTIME_VARIABLE = "ENLIVEN_RUNTIME"
"""Environment variable with the runtime folder. All programs of a kiosk must agree on it."""
SCREEN_PICTURE_FILE = "screen.png"
"""Name in the runtime folder of a recent picture of the kiosk's window."""
MAX_RESTARTS = 1000
"""Maximum number of stored restarts. Because of the back-off, a program that always fails writes one line
every 30 s."""
_MAX_RECORD_BYTES = 1 << 20
"""Maximum size in bytes of a file of records that is read. A file with :data:`MAX_RESTARTS` lines has about
150,000 bytes."""
_MAX_CAUSE_LENGTH = 500
"""Maximum length of a cause in characters. Longer error messages are truncated."""
_SERVICES_FOLDER = "services"
"""Name of the folder for program states in the runtime folder."""
_RESTARTS_FILE = "restarts.jsonl"
"""Name of the file with the history of restarts in the user's data folder."""

T = TypeVar("T", bound=msgspec.Struct)


class ServiceRecord(msgspec.Struct, frozen=True):
    """The state of one supervised program.

    Attributes:
        name: the program's name, such as "edge floor" or "window".
        pid: its process id.
        started_s: Unix time of its start, in seconds.
        progress_s: Unix time of its last visible progress, in seconds. 0 if there was none yet.
        status: one sentence for operators.
        figures: measured values by name, with the unit at the end of the name: ``fps``, ``rss_mb``.
    """

    name: str
    pid: int
    started_s: float
    progress_s: float = 0.0
    status: str = ""
    figures: dict[str, float] = {}


class RestartRecord(msgspec.Struct, frozen=True):
    """One restart of a supervised program.

    Attributes:
        name: name of the program.
        at_s: Unix time of its end, in seconds.
        cause: one sentence about the reason why it ended.
    """

    name: str
    at_s: float
    cause: str


def runtime_folder() -> Path:
    """Returns the folder for files that describe running programs. Creates it with access for its owner
    only.
    """
    configured = os.environ.get(RUNTIME_VARIABLE)
    session = os.environ.get("XDG_RUNTIME_DIR")
    if configured:
        folder = Path(configured)
    elif session:
        folder = Path(session) / "enliven"
    else:
        owner = "" if sys.platform == "win32" else f"-{os.getuid()}"
        folder = Path(tempfile.gettempdir()) / f"enliven{owner}-runtime"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


def write_service(record: ServiceRecord, folder: Path | None = None) -> None:
    """Writes a program's state, completely or not at all.

    Does not wait until the data is on the disk, because the state is irrelevant after a restart of the
    computer.

    Args:
        folder: the runtime folder. None uses :func:`runtime_folder`.

    Raises:
        ResourceError: if it cannot be written.
    """
    services = (folder or runtime_folder()) / _SERVICES_FOLDER
    services.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_file(services / f"{_make_file_name(record.name)}.json", msgspec.json.encode(record), durable=False)


def read_services(folder: Path | None = None) -> list[ServiceRecord]:
    """Returns the states of all programs, sorted by name. Damaged files are left out."""
    services = (folder or runtime_folder()) / _SERVICES_FOLDER
    records = []
    for path in services.glob("*.json"):
        try:
            records.append(_decode_record(read_file(path, _MAX_RECORD_BYTES), ServiceRecord))
        except InputError:
            # The file is missing, because the program has ended since the folder was listed, or it is too
            # large for a record.
            continue
    return sorted((record for record in records if record is not None), key=lambda record: record.name)


def append_restart(record: RestartRecord, folder: Path | None = None) -> None:
    """Adds a restart to the history. If there are more than :data:`MAX_RESTARTS`, drops the oldest.

    Args:
        folder: folder of the history. None uses the user's data folder.

    Raises:
        ResourceError: if it cannot be written.
    """
    place = (folder or user_data_folder()) / _RESTARTS_FILE
    place.parent.mkdir(parents=True, exist_ok=True)
    record = RestartRecord(record.name, record.at_s, record.cause[:_MAX_CAUSE_LENGTH])
    kept_restarts = [*read_restarts(folder), record][-MAX_RESTARTS:]
    write_file(place, b"".join(msgspec.json.encode(entry) + b"\n" for entry in kept_restarts))


def read_restarts(folder: Path | None = None) -> list[RestartRecord]:
    """Returns the history of restarts, the oldest first. Lines damaged by a power cut are left out."""
    try:
        lines = read_file((folder or user_data_folder()) / _RESTARTS_FILE, _MAX_RECORD_BYTES).splitlines()
    except InputError:
        return []
    records = (_decode_record(line, RestartRecord) for line in lines)
    return [record for record in records if record is not None]


def _make_file_name(name: str) -> str:
    """Returns a program's name as a valid file name, without path separators."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", name).lstrip(".") or "unnamed"


def _decode_record(data: bytes, kind: type[T]) -> T | None:
    """Returns a record, or None if the data is damaged."""
    try:
        return msgspec.json.decode(data, type=kind)
    except DECODE_ERRORS:
        return None
