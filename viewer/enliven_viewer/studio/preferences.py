"""What an artist chose for good: keys, recent files, the size of text; kept in a file between runs.

Programs of several versions share the file. What this version does not know stays in it, and a file of a
later format is left alone.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import msgspec

from enliven.errors import EnlivenError, InputError, ResourceError, refuse_later_version
from enliven.files import own_folder, read_file, write_file
from enliven_viewer.language import language_in_use, speak, tr
from enliven_viewer.theme import theme_in_use, use_theme

log = logging.getLogger(__name__)

_NAME = "preferences.json"
_DAMAGED = ".damaged"
"""Ending of a damaged file that was put aside."""
_VERSION = 1
"""Version of the file's format. An added field or value needs no new version; a changed meaning does."""
_VERSION_KEY = "version"
"""Key of the version; the file of enliven 0.1 lacks it and is of version 1."""
_MOST = 1 << 20
"""Bytes of the file that are read: it holds a few hundred short lines."""
SIZES = (0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)
"""Sizes of text that are offered, over the usual: steps that are seen, up to twice."""
_RECENT = 10
"""Files that are remembered: as many as are read at a glance."""


class _Kept(msgspec.Struct):
    """The contents of the file."""

    keys: dict[str, tuple[str, ...]] = {}
    recent: list[str] = []
    text_size: float = 1.0
    less_motion: bool = False
    toured: bool = False
    tour_step: int = 0
    performer: bool = True
    timeline_height: float = 0.0
    theme: str = "dark"
    colours: str = "usual"
    language: str = "en"


class Preferences:
    """What an artist chose, as it is in a file.

    A damaged file is put aside, and the defaults hold. A file of a later version is kept unchanged: the
    defaults and new choices hold until the program ends. Entries that this version does not know are kept.

    Args:
        folder: where the file is; None takes the user's own place.

    Attributes:
        keys: the keys of actions by their ids, of those that have others than their own.
        recent: paths of projects and models that were opened or saved last, the newest first.
        text_size: size of the text and of the layout over the usual.
        less_motion: the view turns at once, without gliding.
        toured: whether the tour was finished or put away; tour_step: the number of the step it resumes at.
        performer: performers are seen in a corner of the picture as their camera sees them.
        theme: "dark" or "light"; colours: the set that tells limbs, performers and takes apart.
        language: the code of the window's language.
        timeline_height: pixels that the timeline was given; 0 for the usual height.
        refusal: why the file is not used; None if it is.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = (folder or own_folder()) / _NAME
        self.refusal: EnlivenError | None = None
        self._stored: dict[str, Any] = {}
        kept = self._read()
        self.keys, self.recent = dict(kept.keys), list(kept.recent)
        self.text_size, self.toured, self.tour_step = kept.text_size, kept.toured, max(kept.tour_step, 0)
        self.less_motion, self.performer = kept.less_motion, kept.performer
        self.timeline_height = kept.timeline_height
        speak(kept.language)
        self.language = language_in_use()
        use_theme(kept.theme, kept.colours)
        self.theme, self.colours = theme_in_use()
        self._begun = self._chosen()

    def save(self) -> None:
        """Writes the file; where it cannot be written, the choices hold until the program ends."""
        if self.refusal is not None:
            return
        chosen = self._chosen()
        # A value that was not changed is written as it was read: only a later version may know it.
        changed = {name: value for name, value in chosen.items() if value != self._begun[name]}
        kept = {_VERSION_KEY: _VERSION, **chosen, **self._stored, **changed}
        try:
            write_file(self.path, msgspec.json.format(msgspec.json.encode(kept), indent=2))
        except ResourceError as error:
            log.warning("preferences are not kept: %s", error)

    def resize(self, steps: int) -> None:
        """Makes text, and the layout with it, some steps larger; below 0 smaller."""
        nearest = min(range(len(SIZES)), key=lambda k: abs(SIZES[k] - self.text_size))
        self.text_size = SIZES[min(max(nearest + steps, 0), len(SIZES) - 1)]
        self.save()

    def calm(self) -> None:
        """Lets the view turn at once, or let it glide again."""
        self.less_motion = not self.less_motion
        self.save()

    def paint(self, theme: str = "", colours: str = "") -> None:
        """Uses another theme, or another set of colours, at once; empty leaves it unchanged."""
        use_theme(theme or self.theme, colours or self.colours)
        self.theme, self.colours = theme_in_use()
        self.save()

    def speak(self, language: str) -> None:
        """Uses another language at once."""
        speak(language)
        self.language = language_in_use()
        self.save()

    def watch_performer(self) -> None:
        """Shows the performers in a corner of the picture, or no longer."""
        self.performer = not self.performer
        self.save()

    def opened(self, path: Path) -> None:
        """Puts a file first among the recent ones."""
        name = str(path.resolve())
        self.recent = [name, *(one for one in self.recent if one != name)][:_RECENT]
        self.save()

    def _chosen(self) -> dict[str, Any]:
        """Returns the present choices by the names in the file, as JSON has them."""
        kept = _Kept(**{name: getattr(self, name) for name in _Kept.__struct_fields__})
        return dict(msgspec.json.decode(msgspec.json.encode(kept)))

    def _read(self) -> _Kept:
        if not self.path.exists():
            return _Kept()
        try:
            data = read_file(self.path, _MOST)
            stored = msgspec.json.decode(data, type=dict[str, Any])
            self._refuse_later(stored.get(_VERSION_KEY, _VERSION))
            if self.refusal is not None:
                return _Kept()
            kept = msgspec.json.decode(data, type=_Kept)
        except (InputError, msgspec.MsgspecError, OSError, RecursionError) as error:
            log.warning("preferences cannot be read, and are put aside: %s", error)
            self._put_aside()
            return _Kept()
        self._stored = stored
        return kept

    def _refuse_later(self, version: Any) -> None:
        """Notes why a file of a later version is not used.

        Raises:
            InputError: if the version is not a whole number.
        """
        if not isinstance(version, int) or isinstance(version, bool):
            raise InputError(tr("the version is not a whole number"), where=str(self.path))
        try:
            refuse_later_version(version, _VERSION, str(self.path))
        except InputError as error:
            log.warning("preferences are not used, and their file is kept: %s", error)
            self.refusal = error

    def _put_aside(self) -> None:
        """Renames a damaged file; one that cannot be renamed is not used and not replaced."""
        try:
            self.path.replace(self.path.with_suffix(_DAMAGED))
        except OSError as error:
            what = tr("the preferences cannot be read ({0})", error.strerror or tr("the system refused"))
            self.refusal = ResourceError(what, where=str(self.path), mend=tr("Check who may read the file."))
