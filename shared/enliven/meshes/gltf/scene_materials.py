"""Adds materials and textures to a glTF document under construction, and splits meshes by material."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pygltflib

from enliven.arrays import AnyArray, Float32, Int
from enliven.meshes.gltf.blob import Blob
from enliven.meshes.materials import MeshMaterials, renumber_textures
from enliven.meshes.mesh import Mesh

_DEFAULT_ROUGHNESS = 0.9
"""Roughness of a plain material: fully matt."""


class SceneMaterials:
    """The materials of all meshes of a scene. Equal materials are stored once."""

    def __init__(self, blob: Blob) -> None:
        self._blob = blob
        self._materials = list[dict[str, Any]]()
        self._textures: dict[tuple[int, int | None], int] = {}
        self._images: dict[bytes, tuple[int, dict[str, Any]]] = {}
        self._samplers: dict[str, int] = {}
        self._known: dict[str, int] = {}

    def add_plain(self, name: str) -> int:
        """Adds a plain white material, which shows a mesh's colours. Returns its number."""
        shading = {"metallicFactor": 0.0, "roughnessFactor": _DEFAULT_ROUGHNESS}
        definition = json.dumps({"name": name, "pbrMetallicRoughness": shading, "doubleSided": True})
        return self._material_number(definition)

    def add_all(self, materials: MeshMaterials) -> list[int]:
        """Adds the materials of a mesh with their textures. Returns their numbers in the file."""
        textures = list[int]()
        for texture in materials.textures:
            image = self._image_number(texture.image, texture.kind)
            sampler_text = texture.sampler
            sampler = self._samplers.setdefault(sampler_text, len(self._samplers)) if sampler_text else None
            textures.append(self._textures.setdefault((image, sampler), len(self._textures)))
        return [
            self._material_number(renumber_textures(definition, textures.__getitem__))
            for definition in materials.definitions
        ]

    def write_to(self, document: pygltflib.GLTF2) -> None:
        """Writes all added materials into the document."""
        document.materials = self._materials
        document.images = [image for _, image in self._images.values()]
        document.samplers = [json.loads(sampler_text) for sampler_text in self._samplers]
        for image, sampler in self._textures:
            document.textures.append(pygltflib.Texture(source=image, sampler=sampler))
        used = {name for material in self._materials for name in extensions_in(material)}
        document.extensionsUsed = sorted({*document.extensionsUsed, *used})

    def _material_number(self, definition: str) -> int:
        if definition not in self._known:
            self._known[definition] = len(self._materials)
            self._materials.append(json.loads(definition))
        return self._known[definition]

    def _image_number(self, data: AnyArray, kind: str) -> int:
        key = data.tobytes()
        if key not in self._images:
            view = self._blob.add_bytes(data)
            self._images[key] = (len(self._images), {"bufferView": view, "mimeType": kind})
        return self._images[key][0]


def extensions_in(value: Any) -> set[str]:
    """Returns the names of all extensions that a JSON value uses."""
    names = set[str]()
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        if key == "extensions" and isinstance(item, dict):
            names |= set(item)
        if isinstance(item, (dict, list)):
            names |= extensions_in(item)
    return names


def split_by_material(mesh: Mesh) -> Iterator[tuple[int, Int, Int, dict[str, Float32]]]:
    """Yields each material's part of a mesh.

    A vertex is duplicated if its corners have different texture coordinates.

    Yields:
        The material's number (-1 for none); (N,) the mesh vertex of each vertex of the part; (K, 3) faces;
        and a dictionary of the vertices' texture coordinates and colours by glTF's attribute names.
    """
    materials = mesh.materials
    if materials is None:
        yield -1, np.arange(len(mesh.vertices)), mesh.faces.astype(np.int64), {}
        return
    for number in np.unique(materials.of):
        material_faces = np.flatnonzero(materials.of == number)
        uvs = materials.uvs[material_faces].reshape(3 * len(material_faces), -1)
        tints = (
            np.ones((len(uvs), 4), np.float32)
            if materials.tints is None
            else materials.tints[material_faces].reshape(-1, 4)
        )
        if number < 0:
            uvs, tints = uvs[:, :0], np.ones_like(tints)
        is_uniform = uvs.shape[1] == 0 and bool((tints == tints[0]).all())
        rows = mesh.faces[material_faces].ravel().astype(np.float64)
        rows = rows if is_uniform else np.concatenate([rows[:, None], uvs, tints], 1)
        _, first_corners, vertex_of_corner = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        corners = {f"TEXCOORD_{k}": uvs[first_corners, 2 * k : 2 * k + 2] for k in range(uvs.shape[1] // 2)}
        if (tints != 1.0).any():
            corners["COLOR_0"] = tints[first_corners]
        yield (
            int(number),
            mesh.faces[material_faces].ravel()[first_corners].astype(np.int64),
            vertex_of_corner.reshape(-1, 3),
            corners,
        )
