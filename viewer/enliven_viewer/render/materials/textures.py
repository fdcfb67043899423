"""The textures of characters on the GPU: decoded once, shared by all meshes that use them, with mipmaps."""

from __future__ import annotations

import json
import logging
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import moderngl
import numpy as np
from PIL import Image

from enliven.arrays import UInt8
from enliven.errors import InputError, find_plain_reason
from enliven.meshes import Texture, open_picture

_ANISOTROPY = 4.0
"""Number of samples of anisotropic filtering. More samples make no visible difference on characters."""


log = logging.getLogger(__name__)
_MAX_IMAGE_PIXELS = 1 << 26
"""Maximum number of pixels of one image, 8192 x 8192. A file of a few kilobytes can declare more than fits
into memory.
"""
_SRGB8_ALPHA8 = 0x8C43
"""GL_SRGB8_ALPHA8: a texture format that the GPU converts to linear light before filtering."""
_GL_NEAREST = 9728
"""OpenGL constant in a glTF sampler: no smoothing between texels."""
_GL_CLAMP_TO_EDGE = 33071
"""OpenGL constant in a glTF sampler: clamp to the edge."""
_GL_MIRRORED_REPEAT = 33648
"""OpenGL constant in a glTF sampler: mirrored repeat."""
_SRGB_MAPS = ("base", "emissive")
"""Names of colour textures, which are in sRGB. The others contain numbers."""
_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swiftshader")
"""Software renderers. On these, anisotropic filtering took a third of the frame time."""
_WHITE_PIXEL = np.full((1, 1, 4), 255, np.uint8)

_Key = tuple[int, bool]


@dataclass
class SharedTexture:
    """A texture on the GPU with its number of users.

    The object keeps the source alive, because the cache key contains the source's ``id()``.

    Attributes:
        texture: white until the image is decoded.
        decoding: the future of the decoded image; None once it is uploaded.
    """

    texture: moderngl.Texture
    source: Texture
    users: int = 0
    decoding: Future[UInt8] | None = None


class Textures:
    """The textures of one OpenGL context.

    Args:
        max_side: maximum side in pixels; larger images are scaled down.

    Attributes:
        decodes_in_background: whether images are decoded in threads while white is drawn; a window sets it.
    """

    def __init__(self, ctx: moderngl.Context, max_side: int) -> None:
        self.ctx = ctx
        limit = int(ctx.info.get("GL_MAX_TEXTURE_SIZE", max_side) or max_side)
        self._most = min(max_side, limit)
        by_hand = any(name in ctx.info.get("GL_RENDERER", "").lower() for name in _SOFTWARE_RENDERERS)
        self._anisotropy = 1.0 if by_hand else min(_ANISOTROPY, ctx.max_anisotropy or 1.0)
        self._held: dict[_Key, SharedTexture] = {}
        self.decodes_in_background = False
        self._pool: ThreadPoolExecutor | None = None

    def acquire_texture(self, source: Texture, name: str) -> SharedTexture:
        """Returns the texture for a map of a material. The caller must call :meth:`release_texture` later."""
        key = id(source), name in _SRGB_MAPS
        if key not in self._held:
            self._held[key] = self._create_texture(source, key[1])
        self._held[key].users += 1
        return self._held[key]

    def upload_decoded(self) -> None:
        """Uploads the images that have been decoded since the last call. Call once per frame."""
        for (_, colours), shared_texture in self._held.items():
            if shared_texture.decoding is not None and shared_texture.decoding.done():
                pixels, shared_texture.decoding = shared_texture.decoding.result(), None
                shared_texture.texture.release()
                shared_texture.texture = self._upload(shared_texture.source, colours, pixels)

    def _create_texture(self, source: Texture, colours: bool) -> SharedTexture:
        if not self.decodes_in_background:
            return SharedTexture(self._upload(source, colours, decode_pixels(source, self._most)), source)
        self._pool = self._pool or ThreadPoolExecutor(2, "textures")
        decoding = self._pool.submit(decode_pixels, source, self._most)
        return SharedTexture(self._upload(source, colours, _WHITE_PIXEL), source, decoding=decoding)

    def release_texture(self, source: Texture, name: str) -> None:
        """Removes one user of a texture. A texture without users is freed."""
        key = id(source), name in _SRGB_MAPS
        shared_texture = self._held[key]
        shared_texture.users -= 1
        if not shared_texture.users:
            del self._held[key]
            shared_texture.texture.release()

    def __len__(self) -> int:
        return len(self._held)

    def _upload(self, source: Texture, colours: bool, decoded: UInt8) -> moderngl.Texture:
        sampler = _read_sampler(source)
        pixels = _unfold_mirrored(decoded, sampler)
        options = {"internal_format": _SRGB8_ALPHA8} if colours else {}
        texture = self.ctx.texture(pixels.shape[1::-1], 4, pixels.tobytes(), **options)
        texture.build_mipmaps()
        sharp = sampler.get("magFilter") == _GL_NEAREST
        texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.NEAREST if sharp else moderngl.LINEAR
        texture.repeat_x, texture.repeat_y = (
            sampler.get(wrap_key) != _GL_CLAMP_TO_EDGE for wrap_key in ("wrapS", "wrapT")
        )
        texture.anisotropy = 1.0 if sharp else self._anisotropy
        return texture


def find_mirrored_axes(source: Texture) -> tuple[bool, bool]:
    """Returns whether a texture uses mirrored repeat in x and in y. It is then stored together with its
    mirror image along that axis.
    """
    sampler = _read_sampler(source)
    return sampler.get("wrapS") == _GL_MIRRORED_REPEAT, sampler.get("wrapT") == _GL_MIRRORED_REPEAT


def _read_sampler(source: Texture) -> dict[str, object]:
    return json.loads(source.sampler) if source.sampler else {}


def _unfold_mirrored(pixels: UInt8, sampler: dict[str, object]) -> UInt8:
    """Returns the image together with its mirror image, along each axis with mirrored repeat."""
    for axis, wrap_key in ((1, "wrapS"), (0, "wrapT")):
        if sampler.get(wrap_key) == _GL_MIRRORED_REPEAT:
            pixels = np.concatenate([pixels, np.flip(pixels, axis)], axis)
    return np.ascontiguousarray(pixels)


def decode_pixels(source: Texture, max_side: int) -> UInt8:
    """Returns (H, W, 4): a decoded texture with limited sides, or white if it cannot be read."""
    try:
        with open_picture(np.asarray(source.image, np.uint8).tobytes()) as picture:
            if picture.width * picture.height > _MAX_IMAGE_PIXELS:
                raise InputError(
                    f"the texture has {picture.width} x {picture.height} pixels, which is too large"
                )
            picture.draft("RGB", (max_side, max_side))
            rgba_picture = picture.convert("RGBA")
            rgba_picture.thumbnail((max_side, max_side), Image.Resampling.BOX)
            return np.asarray(rgba_picture, np.uint8)
    except Exception as error:  # Third-party decoders may raise any exception for untrusted bytes.
        log.warning("a texture cannot be read, so it is drawn white: %s", find_plain_reason(error))
        return _WHITE_PIXEL
