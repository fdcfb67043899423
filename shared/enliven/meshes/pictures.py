"""Opens the encoded image of a texture without decoding it, so that its size can be checked before memory is
allocated.
"""

from __future__ import annotations

import io
import warnings

from PIL import Image

_TEXTURE_FORMATS = ("PNG", "JPEG", "WEBP")
"""Allowed image formats of a texture. Pillow's other decoders start programs or are not hardened against
hostile bytes."""


def open_picture(data: bytes) -> Image.Image:
    """Returns an image that is not decoded yet. The caller must check its size.

    Raises:
        Exception: any exception of the image library, if the bytes are damaged.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        return Image.open(io.BytesIO(data), formats=_TEXTURE_FORMATS)
