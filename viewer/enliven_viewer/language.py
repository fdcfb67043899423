"""The language of the window: every text goes through :func:`tr` and is translated with gettext catalogues.

The English text is the key and is written in the code. A catalogue is a file such as ``locale/de.po`` next to
this module; polib reads it, and the standard library's gettext looks texts up. The language can change at any
time.
"""

from __future__ import annotations

import gettext
import io
import locale
from collections.abc import Iterator, Mapping
from pathlib import Path

import polib

CATALOGUES = Path(__file__).parent / "locale"
"""The folder with a file for each language, named by its ISO 639 code."""
LANGUAGES: dict[str, str] = {"en": "English", "de": "Deutsch"}
"""The name of each language, written in that language, by its code."""


class _ActiveCatalogue:
    """The catalogue in use."""

    language = "en"
    catalogue: gettext.NullTranslations = gettext.NullTranslations()


def set_language(language: str) -> None:
    """Switches to a language, or to English if the catalogue is missing."""
    path = CATALOGUES / f"{language}.po"
    if language not in LANGUAGES or not path.exists():
        _ActiveCatalogue.language, _ActiveCatalogue.catalogue = "en", gettext.NullTranslations()
        return
    _ActiveCatalogue.catalogue = gettext.GNUTranslations(io.BytesIO(polib.pofile(str(path)).to_binary()))
    _ActiveCatalogue.language = language


def find_language(requested: str) -> str:
    """Returns the code of a requested language. If it is empty, returns the computer's language if there is a
    catalogue for it, otherwise English.
    """
    if requested:
        return requested
    name = (locale.getlocale()[0] or "en").lower()
    return next((code for code in LANGUAGES if name.startswith((code, LANGUAGES[code].lower()))), "en")


def language_in_use() -> str:
    """Returns the code of the language in use."""
    return _ActiveCatalogue.language


class LazyText(str):
    """An English text with its inserted values. :func:`tr` translates it when it is drawn."""

    pattern: str
    values: tuple[object, ...]


def later(text: str, *values: object) -> LazyText:
    """Returns an English text that keeps its pattern and values for a later translation, for example the name
    of an undo step.
    """
    message = LazyText(text.format(*values) if values else text)
    message.pattern, message.values = text, values
    return message


def tr(text: str, *values: object) -> str:
    """Returns a text in the language in use, with values inserted for ``{0}``, ``{1}``, ..."""
    if isinstance(text, LazyText):
        return tr(text.pattern, *(values or text.values))
    translated = _ActiveCatalogue.catalogue.gettext(text) if text else ""
    texts = (tr(value) if isinstance(value, LazyText) else value for value in values)
    return translated.format(*texts) if values else translated


def tr_n(singular: str, plural: str, count: int, *values: object) -> str:
    """Returns the singular or plural form of a text for a count. ``{0}`` in the text is the count, ``{1}``,
    ``{2}``, ... are the values.
    """
    return _ActiveCatalogue.catalogue.ngettext(singular, plural, count).format(count, *values)


def labelled(text: str, name: str) -> str:
    """Returns an ImGui label with the id ``name``, so that the id is the same in every language."""
    return f"{text}###{name}"


class Texts(Mapping[str, str]):
    """A table of English texts. Reading an entry returns it in the language in use."""

    def __init__(self, english: Mapping[str, str]) -> None:
        self.english = dict(english)

    def __getitem__(self, key: str) -> str:
        return tr(self.english[key])

    def __iter__(self) -> Iterator[str]:
        return iter(self.english)

    def __len__(self) -> int:
        return len(self.english)
