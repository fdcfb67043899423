"""The glyphs of Pillow's own typeface, rasterised once a size into one texture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from enliven.arrays import UInt8

CHARACTERS = "".join(chr(code) for code in range(32, 127)) + "°·±é…"
_ATLAS_WIDTH = 1024
"""Pixels: the texture of glyphs is this wide, which every OpenGL 3.3 allows."""
_MISSING = "?"


@dataclass(frozen=True)
class Glyph:
    """One character in the atlas, pixels.

    Attributes:
        x, y, width, height: its rectangle in the atlas.
        left, top: from the pen on the text's upper line to the rectangle's corner.
        advance: how far the pen moves.
    """

    x: int
    y: int
    width: int
    height: int
    left: int
    top: int
    advance: float


@dataclass(frozen=True)
class Face:
    """All glyphs of one size; ``line`` is the distance between two lines of text, pixels."""

    glyphs: dict[str, Glyph]
    line: int

    def width(self, text: str) -> float:
        """Pixels that a line of text takes."""
        return sum(self.glyph(c).advance for c in text)

    def glyph(self, character: str) -> Glyph:
        """The glyph of a character, a question mark for one that the atlas lacks."""
        return self.glyphs.get(character) or self.glyphs[_MISSING]


def make_atlas(sizes: tuple[int, ...]) -> tuple[UInt8, dict[int, Face]]:
    """(H, W) coverage of the glyphs of several sizes (pixels), and where each is."""
    atlas = Image.new("L", (_ATLAS_WIDTH, 4096))
    draw = ImageDraw.Draw(atlas)
    faces, x, y = {}, 1, 1
    for size in sizes:
        font = ImageFont.load_default(size)
        glyphs, tallest = {}, 0
        for character in CHARACTERS:
            left, top, right, bottom = (int(v) for v in font.getbbox(character))
            width, height = right - left, bottom - top
            if x + width + 1 > _ATLAS_WIDTH:
                x, y, tallest = 1, y + tallest + 1, 0
            draw.text((x - left, y - top), character, fill=255, font=font)
            advance = float(font.getlength(character))
            glyphs[character] = Glyph(x, y, width, height, left, top, advance)
            x, tallest = x + width + 1, max(tallest, height)
        x, y = 1, y + tallest + 1
        faces[size] = Face(glyphs, round(1.32 * size))
    return np.asarray(atlas.crop((0, 0, _ATLAS_WIDTH, y + 1)), np.uint8).copy(), faces
