"""A glTF document under construction: skinned meshes and one animation."""

from __future__ import annotations

import numpy as np
import pygltflib

from enliven.arrays import Float, Int
from enliven.document import CubicKeys, SkinWeights
from enliven.exporters.joints import json_numbers, normalize_float32, normalize_skin
from enliven.meshes import Mesh
from enliven.meshes.gltf.motion import JUMP_DURATION_S
from enliven.meshes.gltf.scene import MeshScene
from enliven.rotation import IDENTITY

_MAX_STILL_CHANGE = 1e-7
"""Maximum change over all frames of a static quaternion or position (metres). It is below the resolution of
float32."""


class GltfScene(MeshScene):
    """A scene with skins and one animation."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._animation = pygltflib.Animation(name=name, channels=[], samplers=[])
        self._known: dict[bytes, int] = {}

    def bytes(self) -> bytes:
        """Returns the bytes of the file."""
        if self._animation.channels:
            self.document.animations = [self._animation]
        return super().bytes()

    def add_skinned(
        self,
        name: str,
        mesh: Mesh,
        skin: SkinWeights,
        tree: int,
        joints: list[int],
        pivots: Float,
        axes: Float | None = None,
    ) -> None:
        """Adds a mesh that is skinned to joints.

        Args:
            tree: the common ancestor node of the joints.
            pivots: (J, 3) positions of the joints at rest.
            axes: (J, 3, 3) rotations of the joints at rest. None means the identity.
        """
        document = self.document
        inverse = np.tile(np.eye(4), (len(joints), 1, 1))
        # The format stores matrices by columns, so the translation is the last row here.
        inverse[:, :3, :3] = np.eye(3) if axes is None else axes
        inverse[:, 3, :3] = -np.einsum("ja,jab->jb", pivots, inverse[:, :3, :3])
        matrices = self.blob.add(inverse.reshape(-1, 16).astype(np.float32))
        document.skins.append(
            pygltflib.Skin(name=name, joints=joints, skeleton=tree, inverseBindMatrices=matrices)
        )
        indices, weights = normalize_skin(skin.indices, skin.weights)
        packed_indices = indices.astype(np.uint8) if len(joints) <= 256 else indices
        array, primitives = pygltflib.ARRAY_BUFFER, []
        for primitive, vertices in self.add_primitives(name, mesh):
            primitive.attributes.JOINTS_0 = self.blob.add(packed_indices[vertices], array)
            primitive.attributes.WEIGHTS_0 = self.blob.add(weights[vertices], array)
            primitives.append(primitive)
        document.meshes.append(pygltflib.Mesh(name=name, primitives=primitives))
        node = self.node(name=name, mesh=len(document.meshes) - 1, skin=len(document.skins) - 1)
        self.add_roots(tree, node)

    def animate(self, times: Float, node: int, path: str, values: Float, keys: Int | None = None) -> None:
        """Adds an animation channel for values (T, C).

        Constant values need no channel if they equal the node's rest value, and otherwise only two keys.

        Args:
            keys: indices of the frames that become keys. None means all frames.
        """
        is_still = np.abs(values - values[0]).max() <= _MAX_STILL_CHANGE
        if is_still and (len(times) == 1 or _is_rest(self.document.nodes[node], path, values[0])):
            stored_value = normalize_float32(values[:1])[0] if path == "rotation" else values[0]
            setattr(self.document.nodes[node], path, json_numbers(stored_value))
            return
        jumps = None if is_still else find_jumps(times, values)
        if jumps is not None:
            stored_value = (
                normalize_float32(values[jumps]) if path == "rotation" else values[jumps].astype(np.float32)
            )
            self.add_channel(times[jumps], node, path, self.blob.add(stored_value), "STEP")
            return
        kept_frames = np.arange(len(times)) if keys is None else keys
        kept_frames = np.array([0, len(times) - 1]) if is_still else kept_frames
        stored_value = (
            normalize_float32(values[kept_frames])
            if path == "rotation"
            else values[kept_frames].astype(np.float32)
        )
        self.add_channel(times[kept_frames], node, path, self.blob.add(stored_value))

    def add_curve(self, node: int, path: str, keys: CubicKeys) -> None:
        """Adds a channel of cubic keys. A key is stored as incoming tangent, value and outgoing tangent."""
        rows = np.stack([keys.slopes[:, 0], keys.values, keys.slopes[:, 1]], 1)
        rows = rows.reshape(-1, rows.shape[2])
        if keys.turns:
            rows = np.roll(rows, -1, -1)  # glTF stores the component w last.
        self.add_channel(keys.seconds, node, path, self.blob.add(rows.astype(np.float32)), "CUBICSPLINE")

    def add_channel(self, times: Float, node: int, path: str, output: int, how: str = "LINEAR") -> None:
        """Adds a channel with the given interpolation for values in an existing accessor."""
        sampler = pygltflib.AnimationSampler(input=self._key_times(times), output=output, interpolation=how)
        self._animation.samplers.append(sampler)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        channel = pygltflib.AnimationChannel(sampler=len(self._animation.samplers) - 1, target=target)
        self._animation.channels.append(channel)

    def _key_times(self, times: Float) -> int:
        """Returns the accessor of key times. Equal time arrays are stored once."""
        stored_times = times.astype(np.float32)
        key = stored_times.tobytes()
        if key not in self._known:
            self._known[key] = self.blob.add(stored_times)
        return self._known[key]


def find_jumps(times: Float, values: Float) -> Int | None:
    """Returns the frames (K,) of ``values`` (T, C) that reproduce a channel with STEP interpolation.

    Returns None if values also change gradually.
    """
    is_changed = np.abs(np.diff(values, axis=0)).max(1) > _MAX_STILL_CHANGE
    if not is_changed.any() or (is_changed & (np.diff(times) > 1.5 * JUMP_DURATION_S)).any():
        return None
    kept_frames = np.unique([0, *(np.flatnonzero(is_changed) + 1), len(times) - 1])
    held_values = values[kept_frames[np.searchsorted(kept_frames, np.arange(len(times)), "right") - 1]]
    return kept_frames if np.abs(held_values - values).max() <= len(times) * _MAX_STILL_CHANGE else None


def _is_rest(node: pygltflib.Node, path: str, value: Float) -> bool:
    """Returns True if the node's rest value for this channel is ``value``."""
    if path == "translation":
        rest_value = np.zeros(3) if node.translation is None else np.array(node.translation)
    elif path == "rotation":
        rest_value = np.roll(IDENTITY, -1) if node.rotation is None else np.array(node.rotation)
    else:
        rest_value = np.ones(3)
    return bool(np.abs(value - rest_value).max() <= _MAX_STILL_CHANGE)
