"""Opens the encoded picture of a texture; its size is known before memory is taken for it."""

from __future__ import annotations

import io
import warnings

from PIL import Image

_KINDS = ("PNG", "JPEG", "WEBP")
"""Allowed image formats of a texture; Pillow's other decoders start programs or are not hardened against
hostile bytes."""


def opened_picture(data: bytes) -> Image.Image:
    """Returns a picture that is not decoded yet; whether its size is bearable is for the caller to say.

    Raises:
        Exception: whatever a library that reads strangers' bytes raises.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        return Image.open(io.BytesIO(data), formats=_KINDS)
