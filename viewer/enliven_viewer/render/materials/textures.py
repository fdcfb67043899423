"""The textures of characters on the GPU: decoded once, shared by all meshes that name them, with mipmaps."""

from __future__ import annotations

import json
import logging
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import moderngl
import numpy as np
from PIL import Image

from enliven.arrays import UInt8
from enliven.errors import InputError, plain_reason
from enliven.meshes import Texture, opened_picture

log = logging.getLogger(__name__)
_MOST_PIXELS = 1 << 26
"""Pixels of one picture, 8192 x 8192: a few kilobytes can state more than the memory holds."""
_SRGB8_ALPHA8 = 0x8C43
"""GL_SRGB8_ALPHA8: read as linear light, filtered in it."""
_NEAREST = 9728
"""OpenGL's number in a glTF sampler: no smoothing between texels."""
_CLAMP = 33071
"""OpenGL's number in a glTF sampler: the edge goes on."""
_MIRROR = 33648
"""OpenGL's number in a glTF sampler: the picture goes on mirrored."""
_COLOURS = ("base", "emissive")
"""Textures of colours, which are in sRGB; the others are numbers."""
_SOFTWARE = ("llvmpipe", "softpipe", "swiftshader")
"""Renderers without a GPU, for which more samples of a texture took a third of the time of a picture."""
_WHITE = np.full((1, 1, 4), 255, np.uint8)

_Key = tuple[int, bool]


@dataclass
class HeldTexture:
    """A texture on the GPU, how many meshes use it, and what its key was made of, which lives as long.

    Attributes:
        texture: white until the picture is decoded.
        decoding: the picture on its way; None once it is there.
    """

    texture: moderngl.Texture
    source: Texture
    users: int = 0
    decoding: Future[UInt8] | None = None


class Textures:
    """The textures of one OpenGL context.

    Args:
        most: pixels of a side; a larger picture is made smaller.
        anisotropy: samples along the direction in which a texture is seen at a slant; 1 for none.

    Attributes:
        beside: whether pictures are decoded in threads while white is drawn; a window sets it.
    """

    def __init__(self, ctx: moderngl.Context, most: int, anisotropy: int) -> None:
        self.ctx = ctx
        limit = int(ctx.info.get("GL_MAX_TEXTURE_SIZE", most) or most)
        self._most = min(most, limit)
        by_hand = any(name in ctx.info.get("GL_RENDERER", "").lower() for name in _SOFTWARE)
        self._anisotropy = 1.0 if by_hand else min(float(anisotropy), ctx.max_anisotropy or 1.0)
        self._held: dict[_Key, HeldTexture] = {}
        self.beside = False
        self._pool: ThreadPoolExecutor | None = None

    def take(self, source: Texture, name: str) -> HeldTexture:
        """Returns the texture for a map of a material, which is used until it is given back."""
        key = id(source), name in _COLOURS
        if key not in self._held:
            self._held[key] = self._begun(source, key[1])
        self._held[key].users += 1
        return self._held[key]

    def arrive(self) -> None:
        """Takes the pictures that were decoded meanwhile; to be called once per frame."""
        for (_, colours), held in self._held.items():
            if held.decoding is not None and held.decoding.done():
                pixels, held.decoding = held.decoding.result(), None
                held.texture.release()
                held.texture = self._uploaded(held.source, colours, pixels)

    def _begun(self, source: Texture, colours: bool) -> HeldTexture:
        if not self.beside:
            return HeldTexture(self._uploaded(source, colours, _pixels(source, self._most)), source)
        self._pool = self._pool or ThreadPoolExecutor(2, "textures")
        decoding = self._pool.submit(_pixels, source, self._most)
        return HeldTexture(self._uploaded(source, colours, _WHITE), source, decoding=decoding)

    def give_back(self, source: Texture, name: str) -> None:
        """Counts one user less; a texture without any leaves the GPU."""
        key = id(source), name in _COLOURS
        held = self._held[key]
        held.users -= 1
        if not held.users:
            del self._held[key]
            held.texture.release()

    def __len__(self) -> int:
        return len(self._held)

    def _uploaded(self, source: Texture, colours: bool, decoded: UInt8) -> moderngl.Texture:
        sampler = _sampler(source)
        pixels = _unfolded(decoded, sampler)
        options = {"internal_format": _SRGB8_ALPHA8} if colours else {}
        texture = self.ctx.texture(pixels.shape[1::-1], 4, pixels.tobytes(), **options)
        texture.build_mipmaps()
        sharp = sampler.get("magFilter") == _NEAREST
        texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.NEAREST if sharp else moderngl.LINEAR
        texture.repeat_x, texture.repeat_y = (sampler.get(way) != _CLAMP for way in ("wrapS", "wrapT"))
        texture.anisotropy = 1.0 if sharp else self._anisotropy
        return texture


def mirrored(source: Texture) -> tuple[bool, bool]:
    """Returns True if a texture goes on mirrored across and down: it is kept unfolded, twice as long."""
    sampler = _sampler(source)
    return sampler.get("wrapS") == _MIRROR, sampler.get("wrapT") == _MIRROR


def _sampler(source: Texture) -> dict[str, object]:
    return json.loads(source.sampler) if source.sampler else {}


def _unfolded(pixels: UInt8, sampler: dict[str, object]) -> UInt8:
    """Returns the picture and its mirror image in a row, in the ways in which it goes on mirrored."""
    for axis, way in ((1, "wrapS"), (0, "wrapT")):
        if sampler.get(way) == _MIRROR:
            pixels = np.concatenate([pixels, np.flip(pixels, axis)], axis)
    return np.ascontiguousarray(pixels)


def _pixels(source: Texture, most: int) -> UInt8:
    """Returns (H, W, 4) a decoded texture, its sides at most so long; white where it cannot be read."""
    try:
        with opened_picture(np.asarray(source.image, np.uint8).tobytes()) as picture:
            if picture.width * picture.height > _MOST_PIXELS:
                raise InputError(f"it has {picture.width} x {picture.height} pixels")
            picture.draft("RGB", (most, most))
            whole = picture.convert("RGBA")
            whole.thumbnail((most, most), Image.Resampling.BOX)
            return np.asarray(whole, np.uint8)
    except Exception as error:  # a library that reads strangers' bytes raises whatever it likes
        log.warning("a texture cannot be read (%s): it is drawn white", plain_reason(error))
        return _WHITE
