"""What edges' cameras see, as textures for the corner of the window."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import UInt8
from enliven.wire import CameraMessage

_TINT = np.array([0.66, 0.73, 0.82])
"""sRGB of what is nearest: a performer's skeleton, in its colour, stands out from it."""
_CURVE = 1.7
"""Power of the nearness: who stands two metres from a wall stands out from it."""
_DARK = np.array([0.05, 0.06, 0.08])
"""sRGB of what is far away, or not known: the ground of panels."""


class GlancePictures:
    """A texture for each edge; a picture is sent to the graphics card once.

    Args:
        ctx: the window's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._made: dict[str, tuple[CameraMessage, moderngl.Texture]] = {}

    def of(self, name: str, camera: CameraMessage | None) -> int | None:
        """OpenGL's number of the texture of what an edge told last; None for one without a picture."""
        if camera is None or not camera.height:
            return None
        known = self._made.get(name)
        if known is not None and known[0] is camera:
            return int(known[1].glo)
        size, pixels = (camera.width, camera.height), picture_of(camera).tobytes()
        if known is not None and known[1].size == size:
            texture = known[1]
            texture.write(pixels, alignment=1)
        else:
            texture = self._ctx.texture(size, 3, pixels, alignment=1)
        self._made[name] = camera, texture
        return int(texture.glo)


def picture_of(camera: CameraMessage) -> UInt8:
    """(height, width, 3) sRGB: near things light, far ones and what is unknown dark."""
    near = np.frombuffer(camera.nearness, np.uint8).reshape(camera.height, camera.width, 1) / 255.0
    return np.asarray(np.round(255 * (_DARK + near**_CURVE * (_TINT - _DARK))), np.uint8)
