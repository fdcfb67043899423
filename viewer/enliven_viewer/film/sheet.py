"""A contact sheet: images of a film side by side, each with its time, below a title."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from enliven.arrays import UInt8
from enliven.files import write_picture
from enliven_viewer.live.hud import format_time

BACKGROUND_COLOUR = (19, 21, 27)
"""sRGB of the background. It is as dark as the stage, so that the images are the brightest part."""
TITLE_COLOUR = (240, 241, 244)
"""sRGB of titles."""
SUBTITLE_COLOUR = (160, 167, 180)
"""sRGB of subtitles: dimmer than titles."""
_GAP = 10
"""Gap in pixels between two images, and around all of them."""
_TITLE_HEIGHT = 64
"""Height in pixels above the images for one title line."""
_PNG_COMPRESSION = 3
"""PNG compression level from 0 to 9. Compared with level 6, files are 11 % larger and take a third of the
time to write.
"""


@dataclass(frozen=True)
class Tile:
    """One image, (H, W, 3) sRGB, and its time in the film in seconds."""

    seconds: float
    picture: UInt8


class Tiles:
    """A selection of images, evenly spaced over a film of unknown length, in bounded memory.

    Every ``stride``-th image is kept. If there are more than four times the wanted number, every second one
    is dropped.

    Args:
        wanted: number of images on the sheet.
        width: width of each image in pixels.
    """

    def __init__(self, wanted: int, width: int) -> None:
        self._wanted, self._width = wanted, width
        self._kept: list[Tile] = []
        self._stride, self._seen = 1, 0

    def add(self, seconds: float, picture: UInt8) -> None:
        """Considers the next image of the film for the selection. It is (H, W, 3), or (H, W, 4) with the
        fourth channel ignored.
        """
        if self._seen % self._stride == 0:
            # Most stored images are dropped later. So only reduce their size by an integer factor here, which
            # is fast.
            factor = max(picture.shape[1] // self._width, 1)
            reduced = Image.fromarray(np.ascontiguousarray(picture)).reduce(factor).convert("RGB")
            self._kept.append(Tile(seconds, np.asarray(reduced, np.uint8)))
            if len(self._kept) >= 4 * self._wanted:
                self._kept = self._kept[::2]
                self._stride *= 2
        self._seen += 1

    def choose_tiles(self) -> list[Tile]:
        """Returns the tiles: at most the wanted number, including the first and the last image."""
        count = min(self._wanted, len(self._kept))
        last = len(self._kept) - 1
        numbers = [round(k * last / max(count - 1, 1)) for k in range(count)]
        return [
            Tile(tile.seconds, self._resize(tile.picture)) for tile in map(self._kept.__getitem__, numbers)
        ]

    def _resize(self, picture: UInt8) -> UInt8:
        height = max(round(picture.shape[0] * self._width / picture.shape[1]), 1)
        resized = Image.fromarray(picture).resize((self._width, height), Image.Resampling.LANCZOS)
        return np.asarray(resized, np.uint8)


def write_sheet(path: Path, tiles: list[Tile], columns: int, title: str, subtitle: str) -> None:
    """Writes the sheet as PNG.

    Raises:
        ResourceError: if the file cannot be written.
    """
    if not tiles:
        return
    height, width = tiles[0].picture.shape[:2]
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    size = (columns * (width + _GAP) + _GAP, _TITLE_HEIGHT + rows * (height + _GAP))
    sheet = Image.new("RGB", size, BACKGROUND_COLOUR)
    draw = ImageDraw.Draw(sheet)
    draw.text((_GAP + 4, 16), title, fill=TITLE_COLOUR, font=ImageFont.load_default(28))
    quiet = ImageFont.load_default(18)
    draw.text(
        (size[0] - _GAP - 4 - quiet.getlength(subtitle), 24), subtitle, fill=SUBTITLE_COLOUR, font=quiet
    )
    for index, tile in enumerate(tiles):
        x, y = _GAP + index % columns * (width + _GAP), _TITLE_HEIGHT + index // columns * (height + _GAP)
        sheet.paste(Image.fromarray(tile.picture), (x, y))
        _draw_time(draw, x + 8, y + height - 30, format_time(tile.seconds))
    write_picture(path, sheet, "Choose another path with --sheet.", compress_level=_PNG_COMPRESSION)


def _draw_time(draw: ImageDraw.ImageDraw, x: float, y: float, text: str) -> None:
    """Draws a time on a dark background."""
    font = ImageFont.load_default(15)
    draw.rounded_rectangle((x, y, x + font.getlength(text) + 14, y + 22), 6, fill=(12, 14, 19))
    draw.text((x + 7, y + 2), text, fill=TITLE_COLOUR, font=font)
