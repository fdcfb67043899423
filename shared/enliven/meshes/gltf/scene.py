"""Builds a glTF document with meshes: nodes, triangles, colours and materials, without animation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pygltflib

from enliven import __version__
from enliven.arrays import Float, Float32, Int
from enliven.meshes.gltf.blob import Blob
from enliven.meshes.gltf.scene_materials import SceneMaterials, split_by_material
from enliven.meshes.gltf.srgb import linear16_from_srgb
from enliven.meshes.mesh import Mesh


class MeshScene:
    """Collects nodes and meshes, and returns the bytes of a GLB.

    Attributes:
        document: the current glTF document.
        blob: the binary chunk of the document.
    """

    def __init__(self, name: str) -> None:
        self.document, self.blob = pygltflib.GLTF2(), Blob()
        self.document.asset = pygltflib.Asset(version="2.0", generator=f"enliven {__version__}")
        self.document.scenes, self.document.scene = [pygltflib.Scene(name=name, nodes=[])], 0
        self._materials = SceneMaterials(self.blob)

    def bytes(self) -> bytes:
        """Returns the bytes of the GLB file."""
        document = self.document
        self._materials.write_to(document)
        document.bufferViews, document.accessors = self.blob.views, self.blob.accessors
        data = self.blob.bytes()
        document.buffers = [pygltflib.Buffer(byteLength=len(data))]
        document.set_binary_blob(data)
        return b"".join(document.save_to_bytes())

    def node(self, parent: int | None = None, **attributes: Any) -> int:
        """Adds a node with these ``attributes`` as a child of ``parent``, and returns its number."""
        self.document.nodes.append(pygltflib.Node(**attributes))
        number = len(self.document.nodes) - 1
        if parent is not None:
            self.document.nodes[parent].children.append(number)
        return number

    def add_roots(self, *nodes: int) -> None:
        """Adds nodes (by number) to the roots of the scene."""
        self.document.scenes[0].nodes += list(nodes)

    def add_primitives(self, name: str, mesh: Mesh) -> Iterator[tuple[pygltflib.Primitive, Int]]:
        """Adds the triangles of a mesh with normals, colours and materials.

        Yields:
            For each material: its primitive, and (N,) the mesh vertex of each of the primitive's vertices.
        """
        blob, array = self.blob, pygltflib.ARRAY_BUFFER
        normals = unit_normals(mesh.vertex_normals())
        numbers = self._materials.add_all(mesh.materials) if mesh.materials is not None else []
        for number, vertices, faces, corners in split_by_material(mesh):
            attributes = pygltflib.Attributes(
                POSITION=blob.add(mesh.vertices[vertices].astype(np.float32), array),
                NORMAL=blob.add(normals[vertices], array),
            )
            for attribute, values in corners.items():
                setattr(attributes, attribute, blob.add(values, array))
            if number < 0 and mesh.colours is not None:
                attributes.COLOR_0 = blob.add(
                    linear16_from_srgb(mesh.colours[vertices]), array, normalised=True
                )
            stored = faces.astype(np.uint16 if len(vertices) < 65535 else np.uint32)
            primitive = pygltflib.Primitive(
                attributes=attributes,
                indices=blob.add(stored.reshape(-1), pygltflib.ELEMENT_ARRAY_BUFFER),
                material=self._materials.add_plain(name) if number < 0 else numbers[number],
                mode=pygltflib.TRIANGLES,
            )
            yield primitive, vertices


def mesh_glb(mesh: Mesh) -> bytes:
    """Returns the bytes of a GLB with one static mesh."""
    scene = MeshScene(mesh.name)
    primitives = [primitive for primitive, _ in scene.add_primitives(mesh.name, mesh)]
    scene.document.meshes.append(pygltflib.Mesh(name=mesh.name, primitives=primitives))
    scene.add_roots(scene.node(name=mesh.name, mesh=0))
    return scene.bytes()


def unit_normals(normals: Float) -> Float32:
    """Returns normals (V, 3) with unit length. The zero normal of a vertex with only zero-area faces becomes
    +Y."""
    missing = np.linalg.norm(normals, axis=1) < 0.5
    unit_length = np.where(missing[:, None], [0.0, 1.0, 0.0], normals).astype(np.float32)
    return np.asarray(
        unit_length / np.linalg.norm(unit_length.astype(np.float64), axis=1, keepdims=True), np.float32
    )
