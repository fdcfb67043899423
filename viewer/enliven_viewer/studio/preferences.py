"""The artist's preferences: shortcuts, recent files, text size and more, stored in a file between runs.

Programs of several versions share the file. Unknown entries are preserved, and a file of a later format is
not changed.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import msgspec

from enliven.errors import EnlivenError, InputError, ResourceError, refuse_later_version
from enliven.files import DECODE_ERRORS, read_file, user_data_folder, write_file
from enliven_viewer.language import language_in_use, set_language, tr
from enliven_viewer.theme import get_theme, use_theme

log = logging.getLogger(__name__)

_FILE_NAME = "preferences.json"
_DAMAGED_SUFFIX = ".damaged"
"""Suffix that is added to the name of a damaged file."""
_VERSION = 1
"""Version of the file format. It must increase if the meaning of a field changes, but not if fields or values
are added.
"""
_VERSION_KEY = "version"
"""Key of the version. The file of enliven 0.1 lacks it and counts as version 1."""
_MAX_FILE_BYTES = 1 << 20
"""Maximum number of bytes read from the file. A valid file contains a few hundred short lines."""
TEXT_SIZES = (0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)
"""The available text sizes, relative to the default."""
_MAX_RECENT_FILES = 10
"""Maximum number of recent files. A longer list would be hard to read."""


class _StoredPreferences(msgspec.Struct):
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
    """An artist's preferences, stored in a file.

    A damaged file is renamed, and the defaults apply. A file of a later version is not changed. Then the
    defaults and new choices apply until the program ends. Unknown entries are preserved.

    Args:
        folder: folder of the file. None means the user's own data folder.

    Attributes:
        keys: changed shortcuts, by the ids of their actions.
        recent: paths of the projects and models opened or saved most recently, newest first.
        text_size: size of text and layout relative to the default.
        less_motion: if True, the view turns instantly, without animation.
        toured: True if the tour was finished or closed. tour_step: number of the step at which the tour
            resumes.
        performer: whether the camera previews of performers are shown in a corner of the view.
        theme: "dark" or "light". colours: the palette that distinguishes limbs, performers and takes.
        language: the code of the window's language.
        timeline_height: height of the timeline in pixels; 0 for the default.
        refusal: the reason why the file is not used; None if it is used.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = (folder or user_data_folder()) / _FILE_NAME
        self.refusal: EnlivenError | None = None
        self._stored: dict[str, Any] = {}
        stored = self._read()
        self.keys, self.recent = dict(stored.keys), list(stored.recent)
        self.text_size, self.toured, self.tour_step = (
            stored.text_size,
            stored.toured,
            max(stored.tour_step, 0),
        )
        self.less_motion, self.performer = stored.less_motion, stored.performer
        self.timeline_height = stored.timeline_height
        set_language(stored.language)
        self.language = language_in_use()
        use_theme(stored.theme, stored.colours)
        self.theme, self.colours = get_theme()
        self._initial_choices = self._current_choices()

    def save(self) -> None:
        """Writes the file. If that fails, the choices apply until the program ends."""
        if self.refusal is not None:
            return
        chosen = self._current_choices()
        # Write unchanged values back exactly, because a later version may have stored values that this
        # version does not know.
        changed = {name: value for name, value in chosen.items() if value != self._initial_choices[name]}
        stored = {_VERSION_KEY: _VERSION, **chosen, **self._stored, **changed}
        try:
            write_file(self.path, msgspec.json.format(msgspec.json.encode(stored), indent=2))
        except ResourceError as error:
            log.warning("preferences cannot be saved: %s", error)

    def resize(self, steps: int) -> None:
        """Makes text and layout larger by some steps, or smaller if negative."""
        nearest = min(range(len(TEXT_SIZES)), key=lambda k: abs(TEXT_SIZES[k] - self.text_size))
        self.text_size = TEXT_SIZES[min(max(nearest + steps, 0), len(TEXT_SIZES) - 1)]
        self.save()

    def set_less_motion(self) -> None:
        """Switches camera animation on or off."""
        self.less_motion = not self.less_motion
        self.save()

    def set_colours(self, theme: str = "", colours: str = "") -> None:
        """Changes the theme or the palette immediately. An empty argument keeps the current value."""
        use_theme(theme or self.theme, colours or self.colours)
        self.theme, self.colours = get_theme()
        self.save()

    def set_language(self, language: str) -> None:
        """Changes the language immediately."""
        set_language(language)
        self.language = language_in_use()
        self.save()

    def watch_performer(self) -> None:
        """Shows or hides the camera previews of performers."""
        self.performer = not self.performer
        self.save()

    def remember_file(self, path: Path) -> None:
        """Moves a file to the top of the recent files."""
        name = str(path.resolve())
        self.recent = [name, *(other for other in self.recent if other != name)][:_MAX_RECENT_FILES]
        self.save()

    def _current_choices(self) -> dict[str, Any]:
        """Returns the current choices by their names in the file, as JSON values."""
        choices = _StoredPreferences(
            **{name: getattr(self, name) for name in _StoredPreferences.__struct_fields__}
        )
        return dict(msgspec.json.decode(msgspec.json.encode(choices)))

    def _read(self) -> _StoredPreferences:
        if not self.path.exists():
            return _StoredPreferences()
        try:
            data = read_file(self.path, _MAX_FILE_BYTES)
            stored = msgspec.json.decode(data, type=dict[str, Any])
            self._refuse_later(stored.get(_VERSION_KEY, _VERSION))
            if self.refusal is not None:
                return _StoredPreferences()
            stored_values = msgspec.json.decode(data, type=_StoredPreferences)
        except (InputError, OSError, *DECODE_ERRORS) as error:
            log.warning("preferences cannot be read, so their file is renamed: %s", error)
            self._put_aside()
            return _StoredPreferences()
        self._stored = stored
        return stored_values

    def _refuse_later(self, version: Any) -> None:
        """Stores the reason if a file of a later version cannot be used.

        Raises:
            InputError: if the version is not a whole number.
        """
        if not isinstance(version, int) or isinstance(version, bool):
            raise InputError(tr("the field version is not a whole number"), where=str(self.path))
        try:
            refuse_later_version(version, _VERSION, str(self.path))
        except InputError as error:
            log.warning("the preferences file is ignored and left unchanged: %s", error)
            self.refusal = error

    def _put_aside(self) -> None:
        """Renames a damaged file. If that fails, the file is neither used nor replaced."""
        try:
            self.path.replace(self.path.with_suffix(_DAMAGED_SUFFIX))
        except OSError as error:
            problem = tr(
                "the preferences cannot be read ({0})", error.strerror or tr("the system refused access")
            )
            self.refusal = ResourceError(
                problem, where=str(self.path), remedy=tr("Check that you have permission to read the file.")
            )
