"""The captions on the kiosk's picture: large and centred. They fade and drift slowly to prevent screen
burn-in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.story_table import Phase
from enliven_viewer.kiosk.show import ShowFrame
from enliven_viewer.language import Texts, tr
from enliven_viewer.render.overlay.canvas import Pen

TEXTS = Texts(
    {
        "attract.title": "Bring me to life!",
        "spot": "Step into the circle",
        "noticed.title": "Hello!",
        "dwell.title": "Stand still",
        "dwell.hint": "Your body takes over",
        "choose.title": "{0}",
        "choose.step": "Step left or right for another character",
        "choose.hand": "Raise a hand for another character",
        "choose.button": "Press a button for another character",
        "choose.hint": "Step into the circle",
        "possessed.title": "You are the {0}. Move!",
        "possessed.ending": "{0} seconds left",
        "farewell.title": "Thank you!",
        "farewell.hint": "Come back soon",
        "farewell.next": "Next: step into the circle",
        "souvenir.photo": "Scan your photo",
        "souvenir.film": "Scan your film",
        "souvenir.minutes": "Ready for {0} minutes",
    }
)
"""All texts that visitors see, by the keys of the story. ``{0}`` is the character's name or a number of
seconds or minutes.
"""
HINT_SIZE = 0.057
"""Font size of the hint as a fraction of the picture's height. Its lowercase letters are 2.6 % of the height,
which is readable from 4 m on a screen of 50 inches.
"""
TITLE_SIZE = 0.088
"""Font size of the title as a fraction of the picture's height."""
TITLE_WIDTH = 0.105
"""Maximum font size of the title as a fraction of the picture's width. It leaves room for a few words per
line on an upright screen. A title is never smaller than a hint.
"""
_WIDTH = 0.88
"""Maximum width of a line as a fraction of the picture's width."""
_MARGIN = 0.055
"""Distance of the words from the upper and lower edge, as a fraction of the picture's height."""
_FADE_S = 0.45
"""Duration of a fade of the words in seconds."""
_TITLE_TIME_S = 4.0
"""Seconds for which a performing visitor sees the title. After that, the picture shows only the character."""
_DRIFT_FRACTION = 0.012
"""Amplitude of the captions' drift as a fraction of the picture's height. It exceeds the width of a letter's
stroke.
"""
_DRIFT_PERIODS_S = (19.0, 27.0)
"""Periods in seconds of the horizontal and the vertical drift."""
_EXCHANGE_S = 40.0
"""Seconds after which title and hint swap places in the attract state. Burn-in begins after minutes."""
_TEXT_COLOUR = (0.97, 0.975, 0.985)
"""sRGB of the words."""
_SHADOW = (0.0, 0.0, 0.0)
"""sRGB of the words' shadow, which keeps them readable on a bright picture."""
_LINE_HEIGHT = 1.12
"""Line spacing as a multiple of the font size."""


@dataclass
class _Line:
    """A text that fades in and out."""

    text: str = ""
    opacity: float = 0.0
    at_top: bool = True

    def advance(self, wanted: str, at_top: bool, seconds: float) -> None:
        """Fades towards a text and a place. Both change once the old text has faded out."""
        if (self.text, self.at_top) == (wanted, at_top) and wanted:
            self.opacity = min(self.opacity + seconds / _FADE_S, 1.0)
            return
        self.opacity = max(self.opacity - seconds / _FADE_S, 0.0)
        if self.opacity == 0.0:
            self.text, self.at_top = wanted, at_top


class Captions:
    """The title and the hint on the picture.

    Args:
        profile: the kiosk's profile.
    """

    def __init__(self, profile: KioskProfile) -> None:
        self._titles: Mapping[str, str] = {
            name: character.title or name for name, character in profile.characters.items()
        }
        self._now = 0.0
        self._title, self._hint = _Line(), _Line()

    @property
    def words(self) -> tuple[str, str]:
        """Returns the currently visible title and hint."""
        return self._title.text, self._hint.text

    def advance(self, frame: ShowFrame, seconds: float) -> None:
        """Advances the fades to the texts of a picture."""
        self._now += seconds
        title, hint = self._find_texts(frame)
        exchanged = frame.story.phase is Phase.ATTRACT and int(self._now / _EXCHANGE_S) % 2 == 1
        self._title.advance(title, not exchanged, seconds)
        self._hint.advance(hint, exchanged, seconds)

    def draw(self, pen: Pen, size: tuple[int, int]) -> None:
        """Draws the title and the hint into an area of ``size`` pixels (width, height)."""
        hint_size = round(HINT_SIZE * size[1])
        title_size = max(round(min(TITLE_SIZE * size[1], TITLE_WIDTH * size[0])), hint_size)
        for line in (self._title, self._hint):
            if line.opacity > 0.0:
                self._draw_line(pen, size, line, title_size if line.at_top else hint_size)

    def _draw_line(self, pen: Pen, size: tuple[int, int], line: _Line, letters: int) -> None:
        rows = wrap_words(pen, line.text, letters, _WIDTH * size[0])
        height = _LINE_HEIGHT * letters * len(rows)
        x = size[0] / 2 + self._compute_drift(0, size)
        y = _MARGIN * size[1] if line.at_top else (1 - _MARGIN) * size[1] - height
        y += self._compute_drift(1, size)
        shadow = max(letters / 24, 1.0)
        for k, row in enumerate(rows):
            top = y + k * _LINE_HEIGHT * letters
            for dx, dy in ((shadow, shadow), (-shadow / 2, shadow), (0.0, -shadow / 2)):
                pen.text(x + dx, top + dy, row, letters, (*_SHADOW, 0.35 * line.opacity), align=0.5)
            pen.text(x, top, row, letters, (*_TEXT_COLOUR, line.opacity), align=0.5)

    def _compute_drift(self, axis: int, size: tuple[int, int]) -> float:
        """Returns the current offset of the captions along an axis in pixels."""
        return _DRIFT_FRACTION * size[1] * math.sin(2 * math.pi * self._now / _DRIFT_PERIODS_S[axis])

    def _find_texts(self, frame: ShowFrame) -> tuple[str, str]:
        """Returns the title and the hint of a picture in the language in use."""
        story, spot = frame.story, frame.story.spot
        title = self._titles.get(frame.character, frame.character)
        if story.phase is Phase.POSSESSED:
            is_new = frame.now - spot.since_s < _TITLE_TIME_S
            seconds = math.ceil(spot.remaining_s or 0.0)
            hint = tr(TEXTS.english[story.hint], seconds) if story.hint else ""
            return tr(TEXTS.english[story.title], tr(title)) if is_new else "", hint
        if story.phase is Phase.CHOOSE:
            return tr(title), TEXTS[story.hint]
        return TEXTS[story.title], TEXTS[story.hint] if story.hint else ""


def wrap_words(pen: Pen, text: str, size: int, width: float) -> list[str]:
    """Breaks a text between words into lines of at most ``width`` pixels, and returns the lines."""
    rows: list[str] = []
    for word in text.split():
        if rows and pen.extent(f"{rows[-1]} {word}", size)[0] <= width:
            rows[-1] += f" {word}"
        else:
            rows.append(word)
    return rows
