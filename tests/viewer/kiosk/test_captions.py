"""Tests of the kiosk's texts: readable from 4 m, translated into every language, and never still on the
screen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from enliven.kiosk.profile import KioskProfile, StorySettings
from enliven.kiosk.story import Story, StoryInput
from enliven.kiosk.story_table import PHASE_TEXTS, Phase
from enliven_viewer.kiosk.captions import HINT_SIZE, TEXTS, Captions, wrap_words
from enliven_viewer.kiosk.show import ShowFrame
from enliven_viewer.language import LANGUAGES, set_language, tr
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.render.scene import Scene

SIZES = ((1920, 1080), (1080, 1920))


@pytest.fixture(scope="module")
def canvas(gl):
    """Returns a canvas, which lays out text with the real typeface."""
    canvas = Canvas(gl)
    yield canvas
    canvas.release()


@pytest.fixture(autouse=True)
def english():
    """Switches back to English after each test."""
    yield
    set_language("en")


def draw(gl, canvas, size, letters, text) -> np.ndarray:
    """Returns (H, W) the brightness of a text drawn on black."""
    target = gl.simple_framebuffer(size, 4)
    target.clear()
    with canvas.draw_over(target):
        canvas.text(4, 4, text, letters, (1.0, 1.0, 1.0, 1.0))
    width, height = size
    return np.frombuffer(target.read(components=1), np.uint8).reshape(height, width)


@pytest.mark.parametrize("height", [720, 1080, 1920])
def test_small_letters_are_readable_from_four_metres(gl, canvas, height):
    picture = draw(gl, canvas, (300, 220), round(HINT_SIZE * height), "x")
    rows = np.flatnonzero(picture.max(1) > 100)
    assert len(rows) >= 0.025 * height


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", SIZES)
def test_words_fit_the_screen_in_three_lines(canvas, gl, language, size):
    set_language(language)
    target = gl.simple_framebuffer((64, 64), 4)
    with canvas.draw_over(target):
        for english in TEXTS.english.values():
            rows = wrap_words(canvas, tr(english, "chair"), round(HINT_SIZE * size[1]), 0.88 * size[0])
            assert len(rows) <= 3, english
            assert max(canvas.extent(row, round(HINT_SIZE * size[1]))[0] for row in rows) <= size[0]


def test_every_text_of_the_story_has_words_in_german():
    set_language("de")
    for texts in PHASE_TEXTS.values():
        for key in filter(None, (texts.title, texts.hint)):
            assert TEXTS[key] != TEXTS.english[key] or key == "choose.title"


def make_frame(phase=Phase.ATTRACT, **changes) -> ShowFrame:
    """Returns a frame in a given state of the story."""
    story = Story(StorySettings(), KioskProfile().zone, ["chair"])
    view = story.advance(StoryInput(0.0))
    spot = replace(view.spots[0], phase=phase, **changes)
    texts = PHASE_TEXTS[phase]
    hint = "possessed.ending" if changes.get("remaining_s") else texts.hint
    view = replace(view, phase=phase, title=texts.title, hint=hint, spots=(spot,))
    return ShowFrame(Scene(), view, "chair", 100.0)


def test_words_fade_from_one_state_to_the_next(profile):
    captions = Captions(profile)
    for _ in range(60):
        captions.advance(make_frame(), 1 / 30)
    assert captions.words == ("Bring me to life!", "Step into the circle")
    captions.advance(make_frame(Phase.NOTICED), 1 / 30)
    assert captions.words[0] == "Bring me to life!", "the old words fade before the new ones appear"
    for _ in range(60):
        captions.advance(make_frame(Phase.NOTICED), 1 / 30)
    assert captions.words[0] == "Hello!"


def test_words_exchange_their_places_during_attract(profile):
    captions, places = Captions(profile), set()
    for _ in range(100):
        captions.advance(make_frame(), 1.0)
        places.add(captions._title.at_top)
    assert places == {True, False}


def test_performing_visitor_sees_the_title_and_later_only_the_remaining_time(profile):
    captions = Captions(profile)
    for _ in range(60):
        captions.advance(make_frame(Phase.POSSESSED, since_s=99.0), 1 / 30)
    assert captions.words == ("You are the chair. Move!", "")
    for _ in range(60):
        captions.advance(make_frame(Phase.POSSESSED, since_s=20.0, remaining_s=7.2), 1 / 30)
    assert captions.words == ("", "8 seconds left")
