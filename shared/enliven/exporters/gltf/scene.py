"""A glTF document under construction: nodes, skinned and plain meshes, and one animation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygltflib

from enliven import __version__
from enliven.arrays import Float, Int
from enliven.document import SkinWeights
from enliven.exporters.gltf.blob import Blob
from enliven.exporters.gltf.joints import clean_skin, linear16, listed, unit32, unit_normals
from enliven.meshes import Mesh
from enliven.rotation import IDENTITY

_STILL = 1e-7
"""Largest change of a quaternion or a place (metres) over all frames that counts as no motion: below
float32's resolution."""


class GltfScene:
    """Takes nodes, meshes and channels, and gives the bytes of a GLB.

    Attributes:
        document: the glTF document so far.
        blob: its binary half.
    """

    def __init__(self, name: str) -> None:
        self.document, self.blob = pygltflib.GLTF2(), Blob()
        self.document.asset = pygltflib.Asset(version="2.0", generator=f"enliven {__version__}")
        self.document.scenes, self.document.scene = [pygltflib.Scene(name=name, nodes=[])], 0
        self._animation = pygltflib.Animation(name=name, channels=[], samplers=[])
        self._known: dict[bytes, int] = {}

    def bytes(self) -> bytes:
        """Returns the file."""
        document = self.document
        if self._animation.channels:
            document.animations = [self._animation]
        document.bufferViews, document.accessors = self.blob.views, self.blob.accessors
        data = self.blob.bytes()
        document.buffers = [pygltflib.Buffer(byteLength=len(data))]
        document.set_binary_blob(data)
        return b"".join(document.save_to_bytes())

    def node(self, parent: int | None = None, **attributes: Any) -> int:
        """Adds a node below another and returns its number."""
        self.document.nodes.append(pygltflib.Node(**attributes))
        number = len(self.document.nodes) - 1
        if parent is not None:
            self.document.nodes[parent].children.append(number)
        return number

    def put(self, *nodes: int) -> None:
        """Adds nodes without a parent."""
        self.document.scenes[0].nodes += list(nodes)

    def skinned(
        self,
        name: str,
        mesh: Mesh,
        skin: SkinWeights,
        tree: int,
        joints: list[int],
        pivots: Float,
        axes: Float | None = None,
    ) -> None:
        """Adds a mesh that follows joints.

        Args:
            tree: the node that all of them hang on.
            pivots: (J, 3) where they are at rest.
            axes: (J, 3, 3) how they are turned at rest; None for not at all.
        """
        document = self.document
        inverse = np.tile(np.eye(4), (len(joints), 1, 1))
        # Column after column, as the format has matrices: the translation is the last row here.
        inverse[:, :3, :3] = np.eye(3) if axes is None else axes
        inverse[:, 3, :3] = -np.einsum("ja,jab->jb", pivots, inverse[:, :3, :3])
        matrices = self.blob.add(inverse.reshape(-1, 16).astype(np.float32))
        document.skins.append(
            pygltflib.Skin(name=name, joints=joints, skeleton=tree, inverseBindMatrices=matrices)
        )
        indices, weights = clean_skin(skin.indices, skin.weights)
        array = pygltflib.ARRAY_BUFFER
        primitive = self.primitive(name, mesh)
        small = indices.astype(np.uint8) if len(joints) <= 256 else indices
        primitive.attributes.JOINTS_0 = self.blob.add(small, array)
        primitive.attributes.WEIGHTS_0 = self.blob.add(weights, array)
        document.meshes.append(pygltflib.Mesh(name=name, primitives=[primitive]))
        made = self.node(name=name, mesh=len(document.meshes) - 1, skin=len(document.skins) - 1)
        self.put(tree, made)

    def animate(self, times: Float, node: int, path: str, values: Float, keys: Int | None = None) -> None:
        """Adds a channel for values that change; constant values are written at the node, or with two keys on
        request.

        Args:
            keys: frames that are enough; None for all.
        """
        still = np.abs(values - values[0]).max() <= _STILL
        if still and (len(times) == 1 or _is_rest(self.document.nodes[node], path, values[0])):
            stored = unit32(values[:1])[0] if path == "rotation" else values[0]
            setattr(self.document.nodes[node], path, listed(stored))
            return
        kept = np.arange(len(times)) if keys is None else keys
        kept = np.array([0, len(times) - 1]) if still else kept
        stored = unit32(values[kept]) if path == "rotation" else values[kept].astype(np.float32)
        self.channel(times[kept], node, path, self.blob.add(stored))

    def channel(self, times: Float, node: int, path: str, output: int) -> None:
        """Adds a channel that reads its values from an existing accessor."""
        sampler = pygltflib.AnimationSampler(input=self._times(times), output=output, interpolation="LINEAR")
        self._animation.samplers.append(sampler)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        channel = pygltflib.AnimationChannel(sampler=len(self._animation.samplers) - 1, target=target)
        self._animation.channels.append(channel)

    def primitive(self, name: str, mesh: Mesh) -> pygltflib.Primitive:
        """Adds the triangles of a mesh with normals, colours and a plain material."""
        blob = self.blob
        faces = mesh.faces.astype(np.uint16 if len(mesh.vertices) < 65535 else np.uint32)
        array, elements = pygltflib.ARRAY_BUFFER, pygltflib.ELEMENT_ARRAY_BUFFER
        attributes = pygltflib.Attributes(
            POSITION=blob.add(mesh.vertices.astype(np.float32), array),
            NORMAL=blob.add(unit_normals(mesh.vertex_normals()), array),
        )
        if mesh.colours is not None:
            attributes.COLOR_0 = blob.add(linear16(mesh.colours), array, normalised=True)
        plain = pygltflib.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=0.9)
        self.document.materials.append(
            pygltflib.Material(name=name, pbrMetallicRoughness=plain, doubleSided=True)
        )
        return pygltflib.Primitive(
            attributes=attributes,
            indices=blob.add(faces.reshape(-1), elements),
            material=len(self.document.materials) - 1,
            mode=pygltflib.TRIANGLES,
        )

    def _times(self, times: Float) -> int:
        """Returns the accessor of key times; equal times are stored once."""
        stored = times.astype(np.float32)
        key = stored.tobytes()
        if key not in self._known:
            self._known[key] = self.blob.add(stored)
        return self._known[key]


def _is_rest(node: pygltflib.Node, path: str, value: Float) -> bool:
    """Returns whether a node without the channel has this value already."""
    if path == "translation":
        rest = np.zeros(3) if node.translation is None else np.array(node.translation)
    elif path == "rotation":
        rest = np.roll(IDENTITY, -1) if node.rotation is None else np.array(node.rotation)
    else:
        rest = np.ones(3)
    return bool(np.abs(value - rest).max() <= _STILL)
