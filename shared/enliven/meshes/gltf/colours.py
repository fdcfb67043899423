"""Vertex colours of a glTF primitive: the product of base colour, texture and vertex colour."""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import Float, UInt8
from enliven.errors import InputError, find_plain_reason
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.srgb import linear_from_srgb, srgb_from_linear
from enliven.meshes.pictures import open_picture

_WHITE = np.ones(3)
_MAX_PIXELS = 1 << 28
"""Maximum total number of pixels of all textures of a file: four textures of 8192 x 8192, or 0.8 GB. A limit
is needed, because even a file of a few kilobytes can declare more."""


class Colours:
    """The vertex colours of a file's primitives. Each texture image is decoded once.

    Attributes:
        notes: sentences about textures that could not be read.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._pictures: dict[int, UInt8 | None] = {}
        self._pixels = 0
        self.notes: list[str] = []

    def compute_vertex_colours(self, primitive: Any) -> UInt8 | None:
        """Returns (V, 3) sRGB of the vertices: the product of factor, texture at the vertex, and vertex
        colour.

        Returns None if the primitive has no colour of any of these kinds.
        """
        file = self._file
        count = file.document.accessors[primitive.attributes.POSITION].count
        linear = np.tile(_WHITE, (count, 1))
        vertex_colours = getattr(primitive.attributes, "COLOR_0", None)
        if vertex_colours is not None:
            linear = linear * np.asarray(file.accessor(vertex_colours), np.float64)[:, :3]
        shading = None
        if primitive.material is not None and 0 <= primitive.material < len(file.document.materials):
            shading = file.document.materials[primitive.material].pbrMetallicRoughness
        if vertex_colours is None and (
            shading is None or (shading.baseColorFactor is None and not shading.baseColorTexture)
        ):
            return None
        if shading is not None and shading.baseColorFactor is not None:
            linear = linear * np.array(shading.baseColorFactor[:3], np.float64)
        if shading is not None and shading.baseColorTexture is not None:
            linear = linear * self._texture_colours(primitive, shading.baseColorTexture, count)
        return srgb_from_linear(linear)

    def _texture_colours(self, primitive: Any, texture: Any, count: int) -> Float:
        """Returns (V, 3) linear colours of the texture at each vertex. The texture repeats beyond its
        edges.
        """
        accessor = getattr(primitive.attributes, f"TEXCOORD_{texture.texCoord or 0}", None)
        picture = self._texture_image(texture.index)
        if accessor is None or picture is None:
            return np.tile(_WHITE, (count, 1))
        uv = np.nan_to_num(np.asarray(self._file.accessor(accessor), np.float64))
        height, width = picture.shape[:2]
        columns = np.floor(uv[:, 0] % 1.0 * width).astype(int) % width
        rows = np.floor(uv[:, 1] % 1.0 * height).astype(int) % height
        return linear_from_srgb(picture[rows, columns])

    def _texture_image(self, texture: int) -> UInt8 | None:
        """Returns the decoded image (H, W, 3) sRGB of a texture. If it cannot be read, adds a note and
        returns None."""
        if texture not in self._pictures:
            try:
                source = self._file.document.textures[texture].source
                image = self._file.document.images[source]
                if image.bufferView is not None:
                    data = self._file.data_of_view(image.bufferView)
                else:
                    data = self._file.data_of_uri(image.uri)
                self._pictures[texture] = self._decode_image(data)
            except Exception as error:  # Third-party decoders may raise any exception for damaged data.
                reason = find_plain_reason(error)
                self.notes.append(f"texture {texture} cannot be read ({reason}), so it is replaced by white")
                self._pictures[texture] = None
        return self._pictures[texture]

    def _decode_image(self, data: bytes) -> UInt8:
        """Decodes an image to (H, W, 3) sRGB after checking its declared size."""
        with open_picture(data) as picture:
            self._pixels += picture.width * picture.height
            if self._pixels > _MAX_PIXELS:
                raise InputError(
                    f"the textures have {self._pixels} pixels in total, but at most {_MAX_PIXELS} are allowed"
                )
            return np.asarray(picture.convert("RGB"))
