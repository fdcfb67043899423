"""Tests that every film of the gallery is made by the script below it, opens, moves, and is small."""

import re
from itertools import pairwise

import numpy as np
import pytest
from blocks import ROOT, blocks_of
from PIL import Image, ImageSequence

PAGE = ROOT / "docs" / "gallery.md"
FILMS = re.findall(r"!\[[^\]]+\]\((gallery/[\w/]+\.webp)\)", PAGE.read_text(encoding="utf-8"))
MAX_BYTES = 400_000
"""Maximum size of a film in bytes, so that it loads within a second on a slow connection."""
MAX_TOTAL_BYTES = 2_500_000
"""Maximum total size of the page's films in bytes. Every clone of the repository contains them."""
MIN_SECONDS = 1.9
"""Minimum length of a film in seconds. A shorter loop is hard to watch."""
MAX_SECONDS = 4.0
"""Maximum length of a film in seconds, so that a person who scrolls past sees all of it."""


def test_the_page_shows_every_film_once():
    stored = sorted(path.relative_to(PAGE.parent).as_posix() for path in (ROOT / "docs/gallery").iterdir())
    assert sorted(FILMS) == stored and 6 <= len(FILMS) <= 9


def test_each_film_has_a_sentence_and_the_command_of_the_script_that_makes_it():
    sections = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    commands = [block.commands[-1] for block in blocks_of(PAGE)]
    assert len(sections) == len(commands) == len(FILMS)
    for section, film, words in zip(sections, FILMS, commands, strict=True):
        name = film.removeprefix("gallery/").removesuffix(".webp")
        assert film in section and words[:2] == [".venv/bin/python", f"examples/{name}.py"]
        assert f'"{name}.webp"' in (ROOT / words[1]).read_text(encoding="utf-8")
        caption = [line for line in section.splitlines()[1:] if line and line[0] not in "! "]
        assert len(caption) == 1 and caption[0].count(". ") == 0


@pytest.mark.parametrize("film", FILMS)
def test_a_film_opens_and_moves(film):
    with Image.open(PAGE.parent / film) as opened:
        images, seconds = [], 0.0
        for image in ImageSequence.Iterator(opened):
            images.append(np.asarray(image.convert("L"), float))
            seconds += opened.info["duration"] / 1000
        assert opened.size == (480, 300) and opened.info["loop"] == 0
    assert MIN_SECONDS <= seconds <= MAX_SECONDS
    moved = [(np.abs(after - before) > 8).mean() for before, after in pairwise(images)]
    assert len(images) > 20 and np.median(moved) > 2e-4 and max(moved) > 5e-3


def test_the_films_are_small():
    sizes = [(PAGE.parent / film).stat().st_size for film in FILMS]
    assert max(sizes) < MAX_BYTES and sum(sizes) < MAX_TOTAL_BYTES
