"""What an artist chose for good: keys, recent files, the size of text; kept in a file between runs."""

from __future__ import annotations

import logging
from pathlib import Path

import msgspec

from enliven.errors import InputError, ResourceError
from enliven.files import own_folder, read_file, write_file

log = logging.getLogger(__name__)

_NAME = "preferences.json"
_MOST = 1 << 20
"""Bytes of the file that are read: it holds a few hundred short lines."""
_RECENT = 10
"""Files that are remembered: as many as are read at a glance."""


class _Kept(msgspec.Struct):
    """The contents of the file."""

    keys: dict[str, tuple[str, ...]] = {}
    recent: list[str] = []
    text_size: float = 1.0
    safe_colours: bool = False
    less_motion: bool = False
    toured: bool = False


class Preferences:
    """What an artist chose, as it is in a file; a damaged file is put aside and nothing is chosen then.

    Args:
        folder: where the file is; None takes the user's own place.

    Attributes:
        keys: the keys of actions by their ids, of those that have others than their own.
        recent: paths of projects and models that were opened or saved last, the newest first.
        text_size: size of the text and of the layout over the usual.
        safe_colours: colours that people with any kind of colour vision tell apart.
        less_motion: the camera and messages do not glide.
        toured: whether the tour was finished or put away.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = (folder or own_folder()) / _NAME
        kept = self._read()
        self.keys, self.recent = dict(kept.keys), list(kept.recent)
        self.text_size, self.toured = kept.text_size, kept.toured
        self.safe_colours, self.less_motion = kept.safe_colours, kept.less_motion

    def save(self) -> None:
        """Write the file; where it cannot be written, the choices hold until the program ends."""
        kept = _Kept(**{name: getattr(self, name) for name in _Kept.__struct_fields__})
        try:
            write_file(self.path, msgspec.json.format(msgspec.json.encode(kept), indent=2))
        except ResourceError as error:
            log.warning("preferences are not kept: %s", error)

    def opened(self, path: Path) -> None:
        """Put a file first among the recent ones."""
        name = str(path.resolve())
        self.recent = [name, *(one for one in self.recent if one != name)][:_RECENT]
        self.save()

    def _read(self) -> _Kept:
        if not self.path.exists():
            return _Kept()
        try:
            return msgspec.json.decode(read_file(self.path, _MOST), type=_Kept)
        except (InputError, msgspec.MsgspecError, OSError) as error:
            log.warning("preferences cannot be read, and are put aside: %s", error)
            self.path.replace(self.path.with_suffix(".damaged"))
            return _Kept()
