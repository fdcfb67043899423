"""Preview images of the edges' cameras, as textures for the corner of the window."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import UInt8
from enliven.wire import CameraMessage
from enliven_viewer.theme import DEPTH_FAR, DEPTH_NEAR, get_theme

_NEARNESS_EXPONENT = 1.7
"""Exponent of the tone curve from depth to brightness. A person two metres in front of a wall contrasts with
the wall.
"""


class PreviewTextures:
    """One texture per edge. Each image is uploaded once.

    Args:
        ctx: the window's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._textures: dict[str, tuple[CameraMessage, moderngl.Texture, object]] = {}

    def get_texture(self, name: str, camera: CameraMessage | None) -> int | None:
        """Returns the OpenGL number of the texture with an edge's newest camera image.

        Returns None if there is no image.
        """
        if camera is None or not camera.height:
            return None
        cached = self._textures.get(name)
        if cached is not None and cached[0] is camera and cached[2] == get_theme():
            return int(cached[1].glo)
        size, pixels = (camera.width, camera.height), draw_depth_image(camera).tobytes()
        if cached is not None and cached[1].size == size:
            texture = cached[1]
            texture.write(pixels, alignment=1)
        else:
            texture = self._ctx.texture(size, 3, pixels, alignment=1)
        self._textures[name] = camera, texture, get_theme()
        return int(texture.glo)


def draw_depth_image(camera: CameraMessage) -> UInt8:
    """Returns (height, width, 3) sRGB. Near surfaces are bright, far surfaces and unknown pixels are dark."""
    near = np.frombuffer(camera.nearness, np.uint8).reshape(camera.height, camera.width, 1) / 255.0
    far = np.array(DEPTH_FAR) / 255.0
    return np.asarray(
        np.round(255 * (far + near**_NEARNESS_EXPONENT * (np.array(DEPTH_NEAR) / 255.0 - far))), np.uint8
    )
