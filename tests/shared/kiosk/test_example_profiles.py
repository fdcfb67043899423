"""Tests of the example profiles in firmware_configs."""

from __future__ import annotations

from pathlib import Path

import pytest

from enliven.kiosk.profile import load_profile
from enliven.kiosk.story import Story, StoryInput, find_spot_places

FOLDER = Path(__file__).parents[3] / "firmware_configs" / "kiosk"
PROFILES = sorted(path.name for path in FOLDER.glob("*.toml"))


def test_profiles_for_a_foyer_a_duet_and_buttons_ship():
    assert PROFILES == ["buttons.toml", "duet.toml", "foyer.toml"]


@pytest.mark.parametrize("name", PROFILES)
def test_profile_can_be_used(name):
    profile = load_profile(FOLDER / name)
    story = Story(profile.story, profile.zone, list(profile.characters))
    view = story.advance(StoryInput(0.0))
    assert len(view.spots) == profile.story.performers
    half_width = profile.zone.width / 2
    for x, _ in find_spot_places(profile.zone, profile.story.performers):
        assert abs(x - profile.zone.center[0]) + profile.zone.spot <= half_width
    for edge in profile.edges.values():
        assert not edge.settings or (FOLDER / edge.settings).is_file()


def test_every_profile_is_described():
    page = (FOLDER.parent / "README.md").read_text(encoding="utf-8")
    assert all(name in page for name in PROFILES)
