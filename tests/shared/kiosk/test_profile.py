"""Tests of kiosk profiles: defaults, values and mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from enliven.errors import EnlivenError, InputError
from enliven.kiosk.profile import KioskEdge, load_profile


def _write(folder: Path, text: str) -> Path:
    path = folder / "profile.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_an_empty_profile_has_an_edge_and_a_chair(tmp_path: Path) -> None:
    profile = load_profile(_write(tmp_path, ""))
    assert profile.edges == {"edge": KioskEdge()}
    assert profile.characters["chair"].mesh == "chair"


def test_values_of_all_tables_are_read(tmp_path: Path) -> None:
    profile = load_profile(
        _write(
            tmp_path,
            'version = 1\nname = "foyer"\n[edges.floor]\narguments = ["--sensor", "oak"]\n'
            '[characters.squid]\nmesh = "squid.glb"\ntitle = "Squid"\n[story]\ndwell = 2.0\n'
            "[zone]\ncenter = [0.5, 3.0]\n",
        )
    )
    assert profile.edges["floor"].arguments == ("--sensor", "oak")
    assert profile.characters["squid"].title == "Squid"
    assert (profile.story.dwell, profile.zone.center) == (2.0, (0.5, 3.0))


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("[storry]", "did you mean story"),
        ("[story]\ndwel = 1", "story.dwel"),
        ("[story]\ndwell = -1", "outside"),
        ("[screen]\nturn = 45", "screen.turn"),
        ("[edges.a]\nport = 5580\n[edges.b]\nport = 5581", "ports 5580 and 5581"),
        ("version = 99", "version"),
    ],
    ids=["table", "key", "range", "turn", "ports", "later version"],
)
def test_a_mistake_is_named_with_its_place(tmp_path: Path, text: str, part: str) -> None:
    with pytest.raises(EnlivenError) as caught:
        load_profile(_write(tmp_path, text))
    assert part.lower() in str(caught.value).lower()
    assert "profile.toml" in str(caught.value)


def test_edges_of_other_computers_may_have_the_same_port(tmp_path: Path) -> None:
    profile = load_profile(
        _write(tmp_path, '[edges.a]\naddress = "10.0.0.5"\n[edges.b]\naddress = "10.0.0.6"\n')
    )
    assert sorted(profile.edges) == ["a", "b"]


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file does not exist"):
        load_profile(tmp_path / "none.toml")
