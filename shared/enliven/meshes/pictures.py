"""Opens the encoded image of a texture. Its size is known before memory is allocated."""

from __future__ import annotations

import io
import warnings

from PIL import Image

_TEXTURE_FORMATS = ("PNG", "JPEG", "WEBP")
"""Allowed image formats of a texture. Pillow's other decoders start programs or are not hardened against
hostile bytes."""


def opened_picture(data: bytes) -> Image.Image:
    """Returns an image that is not decoded yet. The caller must check its size.

    Raises:
        Exception: any exception of the library that reads foreign bytes.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        return Image.open(io.BytesIO(data), formats=_TEXTURE_FORMATS)
