"""What an artist chose for good: keys, recent files, the size of text; kept in a file between runs."""

from __future__ import annotations

import logging
from pathlib import Path

import msgspec

from enliven.errors import InputError, ResourceError
from enliven.files import own_folder, read_file, write_file
from enliven_viewer.language import language_in_use, speak
from enliven_viewer.theme import theme_in_use, use_theme

log = logging.getLogger(__name__)

_NAME = "preferences.json"
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
    """What an artist chose, as it is in a file; a damaged file is put aside and nothing is chosen then.

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
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.path = (folder or own_folder()) / _NAME
        kept = self._read()
        self.keys, self.recent = dict(kept.keys), list(kept.recent)
        self.text_size, self.toured, self.tour_step = kept.text_size, kept.toured, max(kept.tour_step, 0)
        self.less_motion, self.performer = kept.less_motion, kept.performer
        self.timeline_height = kept.timeline_height
        speak(kept.language)
        self.language = language_in_use()
        use_theme(kept.theme, kept.colours)
        self.theme, self.colours = theme_in_use()

    def save(self) -> None:
        """Write the file; where it cannot be written, the choices hold until the program ends."""
        kept = _Kept(**{name: getattr(self, name) for name in _Kept.__struct_fields__})
        try:
            write_file(self.path, msgspec.json.format(msgspec.json.encode(kept), indent=2))
        except ResourceError as error:
            log.warning("preferences are not kept: %s", error)

    def resize(self, steps: int) -> None:
        """Make text, and the layout with it, some steps larger; below 0 smaller."""
        nearest = min(range(len(SIZES)), key=lambda k: abs(SIZES[k] - self.text_size))
        self.text_size = SIZES[min(max(nearest + steps, 0), len(SIZES) - 1)]
        self.save()

    def calm(self) -> None:
        """Let the view turn at once, or let it glide again."""
        self.less_motion = not self.less_motion
        self.save()

    def paint(self, theme: str = "", colours: str = "") -> None:
        """Use another theme, or another set of colours, at once; empty leaves it unchanged."""
        use_theme(theme or self.theme, colours or self.colours)
        self.theme, self.colours = theme_in_use()
        self.save()

    def speak(self, language: str) -> None:
        """Use another language at once."""
        speak(language)
        self.language = language_in_use()
        self.save()

    def watch_performer(self) -> None:
        """Show the performers in a corner of the picture, or no longer."""
        self.performer = not self.performer
        self.save()

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
