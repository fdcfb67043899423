"""Provides profiles for the tests of the kiosk's window."""

from __future__ import annotations

import pytest

from enliven.kiosk.profile import KioskCharacter, KioskEdge, KioskProfile, StorySettings


@pytest.fixture
def profile() -> KioskProfile:
    """Returns a kiosk profile with a chair and a lamp. Its edge does not run."""
    return KioskProfile(
        edges={"floor": KioskEdge(port=9)},
        characters={"chair": KioskCharacter("chair", "chair"), "lamp": KioskCharacter("lamp", "lamp")},
        story=StorySettings(language="en"),
    )
