"""Checks the entries of a kiosk's profile that only the viewer knows, before any program starts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from enliven.errors import EnlivenError, InputError
from enliven.kiosk.profile import KioskProfile
from enliven_viewer.language import LANGUAGES


def find_language_mistakes(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields a mistake if the language of a kiosk's profile is unknown. ``path`` is the profile's file."""
    language = profile.story.language
    if language and language not in LANGUAGES:
        yield InputError(
            f"the language {language!r} in story.language is not known",
            where=str(path),
            remedy=f"Known languages: {', '.join(LANGUAGES)}.",
        )
