"""Encodes an image for a terminal: as kitty graphics, iTerm2 image, sixels or half blocks.

An image moves the cursor only with the line feeds at its end, so that text continues below it.
"""

from __future__ import annotations

import base64
import io
import itertools
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
from PIL import Image

from enliven.arrays import UInt8

ImageProtocol = Literal["kitty", "iterm", "sixel", "blocks", "blocks256"]
IMAGE_PROTOCOLS = get_args(ImageProtocol)
_CHUNK_CHARACTERS = 4096
"""Maximum number of characters of a chunk in kitty's graphics protocol."""
_SIXEL_COLOURS = 256
"""Number of colours of a sixel image. It is the minimum that VT340 emulators support."""
_SIXEL_ROWS = 6
"""Number of pixel rows in one row of sixels."""
_MAX_WIDTH_PX = 480
"""Maximum width in pixels of an image in a pixel protocol (not half blocks)."""


def encode_image(picture: UInt8, protocol: ImageProtocol, columns: int = 80) -> str:
    """Returns an image encoded for a terminal.

    Args:
        picture: (H, W, 3) sRGB.
        columns: width of the terminal. An image is never wider.
    """
    encoders: dict[ImageProtocol, Callable[[UInt8], str]] = {
        "kitty": encode_kitty,
        "iterm": encode_iterm,
        "sixel": encode_sixel,
        "blocks": encode_half_blocks,
        "blocks256": lambda each: encode_half_blocks(each, exact=False),
    }
    return encoders[protocol](
        _downscale(picture, columns if protocol.startswith("blocks") else _MAX_WIDTH_PX)
    )


def encode_kitty(picture: UInt8) -> str:
    """Encodes an image in kitty's graphics protocol: a PNG in base64, split into chunks."""
    data = base64.standard_b64encode(_encode_png(picture)).decode()
    pieces = [data[offset : offset + _CHUNK_CHARACTERS] for offset in range(0, len(data), _CHUNK_CHARACTERS)]
    codes = []
    for number, piece in enumerate(pieces):
        # The options are a=T (transmit and show), f=100 (PNG) and q=2 (send no answer, because it would
        # appear at the user's prompt).
        head = "a=T,f=100,q=2," if number == 0 else ""
        codes.append(f"\x1b_G{head}m={int(number + 1 < len(pieces))};{piece}\x1b\\")
    return "".join(codes) + "\n"


def encode_iterm(picture: UInt8) -> str:
    """Encodes an image as iTerm2's inline image, which other terminals such as WezTerm also support."""
    data = _encode_png(picture)
    base64_text = base64.standard_b64encode(data).decode()
    return f"\x1b]1337;File=inline=1;size={len(data)};width={picture.shape[1]}px:{base64_text}\x07\n"


def encode_sixel(picture: UInt8) -> str:
    """Encodes an image as sixels with at most 256 colours.

    It encodes six rows at a time, with one pass over the row for each colour.
    """
    image = Image.fromarray(picture).quantize(_SIXEL_COLOURS, dither=Image.Dither.NONE)
    indices = np.asarray(image)
    height, width = indices.shape
    palette = np.asarray(image.getpalette(), np.float64).reshape(-1, 3)
    used_colours = np.unique(indices)
    codes = [f'\x1bP0;1;0q"1;1;{width};{height}']
    for colour in used_colours:
        red, green, blue = np.rint(palette[colour] * 100 / 255).astype(int)
        codes.append(f"#{colour};2;{red};{green};{blue}")
    for top in range(0, height, _SIXEL_ROWS):
        codes.append(_sixel_band(indices[top : top + _SIXEL_ROWS]))
    return "".join(codes) + "\x1b\\\n"


def encode_half_blocks(picture: UInt8, exact: bool = True) -> str:
    """Encodes two pixels in each character: the upper one as foreground colour, the lower one as background.

    Args:
        exact: whether to use 24-bit colours. If False, uses the 240 fixed colours of an older terminal.
    """
    if picture.shape[0] % 2:
        picture = np.vstack([picture, picture[-1:]])
    colour = _convert_to_exact_colour if exact else _find_nearest_palette_colour
    lines = []
    for upper, lower in zip(picture[::2].tolist(), picture[1::2].tolist(), strict=True):
        cells = [f"\x1b[38;{colour(*u)};48;{colour(*v)}m" for u, v in zip(upper, lower, strict=True)]
        line = "".join(cell + "▀" * sum(1 for _ in same) for cell, same in itertools.groupby(cells))
        lines.append(line + "\x1b[0m\n")
    return "".join(lines)


def _convert_to_exact_colour(red: int, green: int, blue: int) -> str:
    return f"2;{red};{green};{blue}"


def _find_nearest_palette_colour(red: int, green: int, blue: int) -> str:
    """Returns the palette number of the nearest of 24 greys (232 and up) or of a cube of 6 x 6 x 6 colours
    (16 and up).
    """
    if max(red, green, blue) - min(red, green, blue) < 16:
        return f"5;{232 + min(23, max(0, (green - 3) // 10))}"
    r, g, b = ((channel + 25) // 51 for channel in (red, green, blue))
    return f"5;{16 + 36 * r + 6 * g + b}"


def _sixel_band(rows: UInt8) -> str:
    """Encodes one row of sixels from (up to 6, W) colour indices."""
    weights = 1 << np.arange(len(rows))
    sixels = []
    for colour in np.unique(rows):
        bits = (rows == colour).T @ weights
        sixels.append(
            f"#{colour}" + "".join(_encode_repeat(chr(63 + bit), n) for bit, n in _run_lengths(bits.tolist()))
        )
    return "$".join(sixels) + "-"


def _run_lengths(values: list[int]) -> list[tuple[int, int]]:
    """Returns (value, length) of each run of equal values.

    A last run of 0 is left out, because it draws nothing.
    """
    runs = [(value, sum(1 for _ in same)) for value, same in itertools.groupby(values)]
    return runs[:-1] if runs and runs[-1][0] == 0 else runs


def _encode_repeat(character: str, count: int) -> str:
    """Returns a sixel ``count`` times, in the fewest characters."""
    return character * count if count < 4 else f"!{count}{character}"


def _downscale(picture: UInt8, width: int) -> UInt8:
    """Returns the image, downscaled if it is too wide. Nearest-neighbour sampling keeps holes in depth."""
    height, width_px = picture.shape[:2]
    if width_px <= width:
        return picture
    size = (width, max(1, round(height * width / width_px)))
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.NEAREST))


def _encode_png(picture: UInt8) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "PNG")
    return file.getvalue()
