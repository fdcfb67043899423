"""Draws the kiosk's picture off-screen or in a window: the mirrored scene with captions over it."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import UInt8
from enliven.kiosk.profile import KioskProfile
from enliven_viewer.kiosk.captions import Captions
from enliven_viewer.kiosk.picture_copy import PictureCopy
from enliven_viewer.kiosk.show import KioskShow, ShowFrame
from enliven_viewer.kiosk.souvenir_maker import SouvenirMaker
from enliven_viewer.render.gl.targets import Size
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.settings import RenderSettings

_PROBE_SIZE = (96, 54)
"""Size in pixels of the small copy that shows whether the picture has changed. Every moving figure covers
some of its pixels."""


class Painter:
    """The painter of a kiosk's pictures.

    Args:
        ctx: an OpenGL context that is current in this thread.
        size: width and height of the picture in pixels, before its rotation for an upright monitor.
    """

    def __init__(
        self, ctx: moderngl.Context, size: Size, profile: KioskProfile, settings: RenderSettings | None = None
    ) -> None:
        self._ctx, self.size = ctx, size
        self._renderer = Renderer(ctx, size, settings)
        self._texture = ctx.texture(size, 4)
        self._picture = ctx.framebuffer([self._texture])
        self._probe = ctx.simple_framebuffer(_PROBE_SIZE, 4)
        self._copies: dict[Size, moderngl.Framebuffer] = {}
        self._copy = PictureCopy(ctx)
        self._canvas = Canvas(ctx)
        self.captions = Captions(profile)

    def draw(
        self, show: KioskShow, frame: ShowFrame, seconds: float, souvenirs: SouvenirMaker | None = None
    ) -> None:
        """Draws a picture, ``seconds`` after the previous one.

        Args:
            souvenirs: takes its pictures before the captions are drawn, and provides QR codes to show; None
                for none.
        """
        self._renderer.draw(frame.scene, show.get_camera_view(self.size[0] / self.size[1]))
        self._copy.draw(self._renderer.picture.texture, self._picture, self.size, mirrored=True)
        self.captions.advance(frame, seconds)
        if souvenirs is not None:
            souvenirs.advance(frame, self.grab)
        with self._canvas.draw_over(self._picture):
            self.captions.draw(self._canvas, self.size)
            if souvenirs is not None:
                souvenirs.draw(self._canvas, self.size)

    def present(self, screen: moderngl.Framebuffer, size: Size, turn: int) -> None:
        """Copies the picture to a window of ``size`` pixels, rotated by ``turn`` degrees."""
        self._copy.draw(self._texture, screen, size, turn=turn)

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the picture, top row first."""
        return _read_pixels(self._picture, self.size)

    def grab(self, longest: int) -> UInt8:
        """Returns (H, W, 3) sRGB of a reduced copy of the picture, top row first.

        Args:
            longest: maximum length of its longer side in pixels.
        """
        factor = min(longest / max(self.size), 1.0)
        size = (round(factor * self.size[0]), round(factor * self.size[1]))
        if size not in self._copies:
            self._copies[size] = self._ctx.simple_framebuffer(size, 4)
        self._copy.draw(self._texture, self._copies[size], size)
        return _read_pixels(self._copies[size], size)

    def probe(self) -> bytes:
        """Returns the pixels of a small copy of the picture. They show if two pictures differ."""
        self._copy.draw(self._texture, self._probe, _PROBE_SIZE)
        return self._probe.read(components=3)

    def release(self) -> None:
        """Frees the GPU memory of the picture."""
        self._canvas.release()
        for copy in self._copies.values():
            copy.release()
        self._picture.release()
        self._texture.release()
        self._renderer.picture.release()


def _read_pixels(picture: moderngl.Framebuffer, size: Size) -> UInt8:
    """Returns (H, W, 3) sRGB of a picture, top row first."""
    raw = np.frombuffer(picture.read(components=3, alignment=1), np.uint8)
    return np.ascontiguousarray(raw.reshape(size[1], size[0], 3)[::-1])
