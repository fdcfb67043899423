"""The folder of a kept stage: its state, the data of its characters, and the journal of the last start."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import re
from collections.abc import Collection
from pathlib import Path
from typing import TypeVar

import msgspec

from enliven.errors import EnlivenError, InputError
from enliven.files import DECODE_ERRORS, read_file, write_file
from enliven.wire import MAX_UPLOAD_BYTES
from enliven_edge.kept_stage.state import VERSION, StageState, StartJournal

log = logging.getLogger(__name__)

STATE_VARIABLE = "STATE_DIRECTORY"
"""Environment variable with the folder that systemd provides for a unit with ``StateDirectory=``."""
_STATE, _JOURNAL = "stage.json", "start.json"
"""Names of the state and of the journal."""
_SUFFIX = ".character"
"""Suffix of the file with the data of a character. The name before the suffix is the checksum."""
_CHARACTER_NAME = re.compile(r"[0-9a-f]{64}" + re.escape(_SUFFIX))
"""Pattern of the names of files that this module may delete."""
_MAX_STATE_BYTES = 1 << 20
"""Maximum bytes of a state file. The state of 256 characters has 60,000."""

T = TypeVar("T", bound=msgspec.Struct)


def stage_folder(option: Path | None, setting: str, base: Path | None, edge: str) -> Path | None:
    """Returns the folder of an edge's kept stage, or None if the stage is not kept.

    The command line comes first, then the settings, then the folder of the systemd unit.

    Args:
        option: the value of ``--keep-stage``.
        setting: the value of ``keep`` under ``[stage]``; empty if it is not set.
        base: folder of the settings file, for a relative setting.
        edge: name of the edge. Several edges may share a folder.
    """
    unit = os.environ.get(STATE_VARIABLE, "").partition(":")[0]
    if option is not None:
        folder = option
    elif setting:
        folder = (base or Path()) / setting
    elif unit:
        folder = Path(unit)
    else:
        return None
    return folder / f"stage-{re.sub(r'[^A-Za-z0-9_.-]+', '-', edge)}"


class StageFolder:
    """The files of one kept stage. The folder is created at the first write.

    A file is written completely or not at all. A damaged file is renamed, never deleted.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> StageState:
        """Returns the state. If it is missing, damaged or of a later version, returns an empty one."""
        path = self.path / _STATE
        try:
            data = read_file(path, _MAX_STATE_BYTES) if path.exists() else b""
        except EnlivenError as error:
            log.warning("the saved stage cannot be restored (%s)", error)
            return StageState()
        if not data:
            return StageState()
        try:
            version = msgspec.json.decode(data, type=_Version).version
            if version > VERSION:
                self._set_aside(path, f"a later version of enliven wrote the file (format {version})")
                return StageState()
            return msgspec.json.decode(data, type=StageState)
        except DECODE_ERRORS as error:
            self._set_aside(path, f"the file is damaged ({error})")
            return StageState()

    def write(self, state: StageState) -> None:
        """Writes the state.

        Raises:
            ResourceError: if it cannot be written.
        """
        write_file(self.path / _STATE, msgspec.json.format(msgspec.json.encode(state), indent=1))

    def read_journal(self) -> StartJournal:
        """Returns the journal of the last start, or an empty one if it is missing or damaged."""
        with contextlib.suppress(EnlivenError, *DECODE_ERRORS):
            return msgspec.json.decode(read_file(self.path / _JOURNAL, _MAX_STATE_BYTES), type=StartJournal)
        return StartJournal()

    def write_journal(self, journal: StartJournal) -> None:
        """Writes the journal of this start.

        Raises:
            ResourceError: if it cannot be written.
        """
        write_file(self.path / _JOURNAL, msgspec.json.encode(journal))

    def read_character(self, digest: str) -> bytes:
        """Returns the data of a character.

        Raises:
            InputError: if it is missing or damaged. A damaged file is renamed.
            ResourceError: if the disk fails.
        """
        path = self._data_path(digest)
        data = read_file(path, MAX_UPLOAD_BYTES)
        if hashlib.sha256(data).hexdigest() != digest:
            self._set_aside(path, "the checksum of the file is wrong")
            raise InputError(
                "the saved character is damaged", where=str(path), remedy="Send the character again."
            )
        return data

    def write_character(self, digest: str, data: bytes) -> None:
        """Writes the data of a character, if the file does not exist yet.

        Raises:
            ResourceError: if it cannot be written.
        """
        path = self._data_path(digest)
        if not path.exists() or path.stat().st_size != len(data):
            write_file(path, data)

    def set_character_aside(self, digest: str, reason: str) -> None:
        """Renames the data of a character that cannot be used, if the file exists."""
        path = self._data_path(digest)
        if path.exists():
            self._set_aside(path, reason)

    def delete_characters_except(self, digests: Collection[str]) -> None:
        """Deletes the data of all other characters."""
        with contextlib.suppress(OSError):
            for path in self.path.iterdir():
                if _CHARACTER_NAME.fullmatch(path.name) and path.name.removesuffix(_SUFFIX) not in digests:
                    path.unlink(missing_ok=True)

    def _data_path(self, digest: str) -> Path:
        return self.path / f"{digest}{_SUFFIX}"

    def _set_aside(self, path: Path, reason: str) -> None:
        """Renames a file that cannot be used, so that it can be examined."""
        renamed_path = path.with_name(f"{path.name}.aside")
        with contextlib.suppress(OSError):
            path.replace(renamed_path)
        log.warning("%s is not used, and was renamed to %s: %s", path, renamed_path.name, reason)


class _Version(msgspec.Struct):
    """The version of a state file. Files of all versions have this field."""

    version: int
