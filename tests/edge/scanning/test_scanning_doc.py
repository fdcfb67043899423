"""Tests that the options, error messages and numbers in docs/scanning.md are correct."""

import re
from pathlib import Path

import typer
from typer.testing import CliRunner

from enliven.scanning import VolumeSettings, tsdf_volume
from enliven.scanning.objects import moved_scanner, registration, rest
from enliven_edge.commands.scan import scan

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "scanning.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())
"""The page without line breaks."""
app = typer.Typer(pretty_exceptions_enable=False)
app.command()(scan)


def test_options_of_the_page_exist():
    help_text = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200", "TERM": "dumb"}).output
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", PAGE)) - {"--help"}
    assert {"--voxel", "--reach", "--whole", "--sheet", "--seconds", "--sensor", "--recording"} <= named
    assert {
        "--triangles",
        "--edge",
        "--within",
        "--box",
        "--before",
        "--add",
        "--memory",
        "--moved",
        "--thing",
        "--person",
    } <= named
    assert [option for option in named if option not in help_text] == []


def test_error_messages_of_the_page_exist():
    folders = (ROOT / "edge" / "enliven_edge", ROOT / "shared" / "enliven" / "scanning")
    code = "".join(
        path.read_text(encoding="utf-8")
        for path in [
            *folders[0].glob("commands/scan*.py"),
            *folders[0].glob("scanning/*.py"),
            *folders[1].glob("**/*.py"),
            *(ROOT / "shared" / "enliven" / "files").glob("*.py"),
        ]
    )
    table = PAGE.split("## What is refused")[1].split("## In a program")[0]
    quoted = [words for words in re.findall(r"`([^`]*)`", table) if not words.startswith("--")]
    assert len(quoted) == 18
    for sentence in quoted:
        assert re.sub(r"\d+", "", sentence).split(" (")[0].split("  ")[0] in re.sub(r"\{[^}]*\}", "", code), (
            sentence
        )


def test_numbers_of_the_page_are_the_defaults():
    settings = VolumeSettings()
    assert "Voxels of 4 mm" in PAGE and settings.voxel == 0.004
    assert "4 voxels in front of the surface to 3 voxels behind it" in SENTENCES
    assert settings.reach == 2.2
    assert (tsdf_volume.TRUNCATION_VOXELS, tsdf_volume.TRUNCATION_BEHIND_VOXELS) == (4.0, 3.0)


def test_search_numbers_of_the_page_are_the_defaults():
    assert "displaced by 15 mm or tilted by 15 mrad" in SENTENCES
    assert (rest.MIN_MOVED_DISTANCE_M, rest.MIN_MOVED_ANGLE_RAD) == (0.015, 0.015)
    assert "from 900 rotations" in SENTENCES and "24 best results" in SENTENCES
    assert (registration.START_ROTATIONS, registration.REFINED_CANDIDATES) == (900, 24)
    assert "half of its points agree" in SENTENCES and "at most one point in 25" in SENTENCES
    shares = (registration.MIN_AGREEING_FRACTION, registration.MAX_SEEN_THROUGH_FRACTION)
    assert shares == (0.5, 0.04)
    assert moved_scanner.MIN_REST_IMAGES == 10 and "begins after ten images" in SENTENCES
