"""Images as libcamera's cameras lay them into memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import UInt8


class Layout(NamedTuple):
    """How an image lies in its first plane: bytes a pixel, and which are grey, or red, green and blue."""

    bytes: int
    channels: tuple[int, ...]


GREY = {
    "R8": Layout(1, (0,)),
    "YUV420": Layout(1, (0,)),
    "NV12": Layout(1, (0,)),
    "YUYV": Layout(2, (0,)),
    "BGR888": Layout(3, (1,)),
    "RGB888": Layout(3, (1,)),
    "XBGR8888": Layout(4, (1,)),
    "XRGB8888": Layout(4, (1,)),
}
"""Formats that grey is read from, the best first; of red, green and blue the green: most light is there."""
COLOUR = {
    "BGR888": Layout(3, (0, 1, 2)),
    "RGB888": Layout(3, (2, 1, 0)),
    "XBGR8888": Layout(4, (0, 1, 2)),
    "XRGB8888": Layout(4, (2, 1, 0)),
}
"""Formats that colour is read from; libcamera names them from the highest byte down."""


def image_of(plane: UInt8, size: tuple[int, int], stride: int, layout: Layout) -> UInt8 | None:
    """(H, W) or (H, W, 3) a copy of the image in a plane's bytes; None where they are too few.

    Args:
        size: (width, height) of the image.
        stride: bytes from one row to the next.
    """
    width, height = size
    if len(plane) < height * stride or stride < width * layout.bytes:
        return None
    rows = plane[: height * stride].reshape(height, stride)[:, : width * layout.bytes]
    pixels = rows.reshape(height, width, layout.bytes)
    if len(layout.channels) == 1:
        return pixels[..., layout.channels[0]].copy()
    return np.array(pixels[..., :3] if layout.channels[0] == 0 else pixels[..., 2::-1], order="C")
