"""Checks the settings files of a kiosk's edges before any program starts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from enliven.errors import EnlivenError
from enliven.files import is_file
from enliven.kiosk.profile import KioskProfile
from enliven.settings import load_settings
from enliven_edge.settings import EdgeSettings


def find_settings_mistakes(profile: KioskProfile, path: Path) -> Iterator[EnlivenError]:
    """Yields the mistakes in the settings files of a kiosk's profile. A missing file is not checked here.

    Args:
        profile: the profile.
        path: its file. The settings files are relative to its folder.
    """
    for edge in profile.edges.values():
        file = path.parent / edge.settings
        if edge.settings and is_file(file):
            try:
                load_settings(EdgeSettings, file)
            except EnlivenError as error:
                yield error
