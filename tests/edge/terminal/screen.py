"""Decoders of terminal images, written from the protocols and independent of the encoders."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
from PIL import Image


def png(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def drawn_by_kitty(text: str) -> np.ndarray:
    """Decodes kitty images. Keys are in the first chunk, and payloads have at most 4096 bytes until m=0."""
    payload, more = "", "1"
    for number, (head, piece) in enumerate(re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", text)):
        keys = dict(each.split("=") for each in head.split(","))
        assert more == "1" and len(piece) <= 4096 and len(piece) % 4 == 0
        if number == 0:
            assert (keys["a"], keys["f"]) == ("T", "100")
        more, payload = keys["m"], payload + piece
    assert more == "0"
    return png(base64.b64decode(payload, validate=True))


def drawn_by_iterm(text: str) -> np.ndarray:
    keys, payload = re.fullmatch(r"\x1b\]1337;File=([^:]*):([^\x07]*)\x07\n", text).groups()
    options = dict(each.split("=") for each in keys.split(";"))
    data = base64.b64decode(payload, validate=True)
    assert options["inline"] == "1" and int(options["size"]) == len(data)
    return png(data)


def drawn_by_sixel(text: str) -> np.ndarray:
    """Decodes sixel images to (H, W, 3). Pixels that are not drawn are black."""
    body = re.fullmatch(r"\x1bP[\d;]*q(.*)\x1b\\\n", text, re.DOTALL)[1]
    across, down = map(int, re.match(r'"\d+;\d+;(\d+);(\d+)', body).groups())
    screen = np.zeros((-(-down // 6) * 6, across, 3), np.uint8)
    colours, colour, x, y = {}, None, 0, 0
    pattern = r'"[\d;]*|#(\d+);2;(\d+);(\d+);(\d+)|#(\d+)|!(\d+)([?-~])|([?-~])|(\$)|(-)|(.)'
    for match in re.finditer(pattern, body, re.DOTALL):
        defined, *rgb, chosen, times, repeated, single, back, new, strange = match.groups()
        assert strange is None, f"{strange!r} is no part of a sixel picture"
        if defined is not None:
            colours[defined] = np.rint(np.array([int(each) for each in rgb]) * 2.55)
        elif chosen is not None:
            colour = colours[chosen]
        elif repeated is not None or single is not None:
            bits, count = ord(repeated or single) - 63, int(times or 1)
            for row in range(6):
                if bits >> row & 1:
                    screen[y + row, x : x + count] = colour
            x += count
            assert x <= across
        elif back:
            x = 0
        elif new:
            x, y = 0, y + 6
    return screen[:down]


def drawn_in_half_blocks(text: str) -> np.ndarray:
    """Decodes (H, W, 3) from 24-bit half blocks. Foreground is the upper pixel, background the lower one."""
    rows = []
    for line in text.splitlines():
        assert line.endswith("\x1b[0m")
        upper, lower = [], []
        for *numbers, blocks in re.findall(r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m(▀+)", line):
            values = [int(each) for each in numbers]
            upper += [values[:3]] * len(blocks)
            lower += [values[3:]] * len(blocks)
        rows += [upper, lower]
    return np.array(rows, np.uint8)
