"""The QR code of a souvenir on the kiosk's picture: black on white, with text above and below."""

from __future__ import annotations

from collections.abc import Sequence

from enliven.kiosk.profile import SouvenirSettings
from enliven_viewer.kiosk.captions import HINT_SIZE, TEXTS, wrap_words
from enliven_viewer.language import tr
from enliven_viewer.render.overlay.canvas import Pen

QUIET_ZONE = 4
"""Width of the white border in modules, as ISO/IEC 18004 requires."""
_SIDE = 0.42
"""Side length of the code with its border, as a fraction of the picture's shorter side. On a screen of 50
inches the code is 26 cm wide, and phones read it from 2.5 m.
"""
_MARGIN = 0.04
"""Distance of the code from the picture's left or right border, as a fraction of the picture's width."""
_PADDING = 0.02
"""Distance of the text from the code, as a fraction of the picture's height."""
_LINE_HEIGHT = 1.1
"""Line spacing as a multiple of the font size."""
_PAPER = (1.0, 1.0, 1.0, 1.0)
"""RGBA of the code's light modules and border. Phones read black on white best."""
_INK = (0.0, 0.0, 0.0, 1.0)
"""RGBA of the code's dark modules and of the text."""


class SouvenirCode:
    """The QR code of one souvenir.

    Args:
        address: the address of the souvenir. settings: its kind, and the time until its deletion.

    Attributes:
        address: the address of the souvenir.
        modules: rows of the code, top row first. 1 is black.
    """

    def __init__(self, address: str, settings: SouvenirSettings) -> None:
        import segno  # Imported here, because only kiosks with souvenirs need it.

        self.address = address
        self.modules: Sequence[Sequence[int]] = segno.make(address, error="m", micro=False).matrix
        self._title, self._minutes = f"souvenir.{settings.kind}", round(settings.keep)

    def draw(self, pen: Pen, size: tuple[int, int], *, at_left: bool = False) -> None:
        """Draws the code at the right or left of an area with a width and height in pixels."""
        count = len(self.modules) + 2 * QUIET_ZONE
        module = max(round(_SIDE * min(size) / count), 1)
        side = count * module
        letters = round(HINT_SIZE * min(size))
        title = wrap_words(pen, TEXTS[self._title], letters, side)
        hint = wrap_words(pen, tr(TEXTS.english["souvenir.minutes"], self._minutes), letters, side)
        line, padding = _LINE_HEIGHT * letters, _PADDING * size[1]
        height = round(side + (len(title) + len(hint)) * line + 2 * padding)
        margin = _MARGIN * size[0]
        left = round(margin if at_left else size[0] - margin - side)
        top = (size[1] - height) // 2
        pen.rectangle(left, top, side, height, _PAPER, 0.5 * padding)
        y = _draw_lines(pen, title, left + side / 2, top + padding, letters)
        y = self._draw_modules(pen, left, round(y), module)
        _draw_lines(pen, hint, left + side / 2, y, letters)

    def _draw_modules(self, pen: Pen, left: int, top: int, module: int) -> int:
        """Draws the black modules, and returns the lower end of the border in pixels.

        Adjacent black modules of a row are drawn as one rectangle, so that no seam is visible between them.
        """
        for row, modules in enumerate(self.modules):
            y = top + (row + QUIET_ZONE) * module
            begin = 0
            for end in range(1, len(modules) + 1):
                if end < len(modules) and modules[end] == modules[begin]:
                    continue
                if modules[begin]:
                    x = left + (begin + QUIET_ZONE) * module
                    pen.rectangle(x, y, (end - begin) * module, module, _INK)
                begin = end
        return top + (len(self.modules) + 2 * QUIET_ZONE) * module


def _draw_lines(pen: Pen, lines: Sequence[str], x: float, y: float, letters: int) -> float:
    """Draws centred lines below ``y``. Returns the lower end of the last one in pixels."""
    for text in lines:
        pen.text(x, y, text, letters, _INK, align=0.5)
        y += _LINE_HEIGHT * letters
    return y
