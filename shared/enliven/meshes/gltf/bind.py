"""The bind pose of a glTF file: the world transforms of its nodes when the mesh was bound to its skeleton.

A vertex v of a skin is drawn at sum_k w_k G_k(t) IBM_k v. G is world_from_joint, and IBM is the inverse bind
matrix: the inverse of mesh_from_joint at binding. The file does not contain the pose of the mesh in the world
at binding. The rest pose of the mesh's node is assumed, unless the joints contradict it.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.motion import bind_locals, world_matrices
from enliven.meshes.gltf.parts import GltfPart, find_moving_nodes

_MAX_SCALE_ROUNDING = 1e-3
"""Maximum relative difference between a joint's scale and its scale at binding that counts as rounding. With
a larger difference, the joint was scaled."""
_MAX_JOINT_DISTANCE = 0.1
"""Maximum distance of a mesh node from its joints, as a fraction of the model's size. A node that is farther
away is not used for the bind pose."""


class Bind:
    """The bind pose.

    Args:
        still: True if no animation moves the surface. Mirrored joints are then mirrored in the bind pose,
            even if vertices are only partly bound to them.

    Attributes:
        world: (n, 4, 4) world_from_node of every node in the bind pose.
        rest: (n, 4, 4) world_from_node of every node in the file's rest pose. A scale of 0, which hides a
            part, is replaced.
        inverse: for each used skin, the inverse bind matrix of each of its joints.
    """

    def __init__(self, file: GltfFile, parts: list[GltfPart], still: bool = False) -> None:
        self._file, self._still = file, still
        standing = bind_locals(file, still)
        self.rest, self._scale = world_matrices(file, standing)[0], standing.scale[0]
        self._order = find_moving_nodes(file, parts)
        self.world = self.rest.copy()
        self.inverse: dict[int, dict[int, Float]] = {}
        bound_nodes: set[int] = set()
        used = {part.skin: part.carrier for part in parts if part.skin >= 0}
        for skin in sorted(used, key=lambda s: -len(file.document.skins[s].joints)):
            self.inverse[skin] = self._inverse_of(skin)
            world_from_skin = self._world_from_mesh(skin, used[skin], bound_nodes)
            for node, inverse in self.inverse[skin].items():
                if node not in bound_nodes:
                    self.world[node] = world_from_skin @ np.linalg.inv(inverse)
                    bound_nodes.add(node)
        self._move_skinless_nodes(bound_nodes)
        self._rescale_joints(bound_nodes, parts)

    def vertices(self, part: GltfPart) -> Float:
        """Returns the vertices (V, 3) in metres of a part in the bind pose, by its own skinning."""
        if part.skin < 0:
            matrix = self.world[part.carrier]
            return np.asarray(part.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        transforms = {n: self.world_from_mesh(part, n) for n in np.unique(part.nodes)}
        vertices_in_world = np.zeros_like(part.vertices)
        for k in range(4):
            matrices = np.stack([transforms[n] for n in part.nodes[:, k]])
            transformed = np.einsum("vab,vb->va", matrices[:, :3, :3], part.vertices) + matrices[:, :3, 3]
            vertices_in_world += part.weights[:, k, None] * transformed
        return vertices_in_world

    def world_from_mesh(self, part: GltfPart, node: int) -> Float:
        """Returns the (4, 4) transform world_from_mesh of a vertex that follows only ``node``, in the bind
        pose."""
        return (
            self.world[node]
            if part.skin < 0
            else np.asarray(self.world[node] @ self.inverse[part.skin][node])
        )

    def _inverse_of(self, skin: int) -> dict[int, Float]:
        """Returns the inverse bind matrix (4, 4) of each joint of a skin, by the joint's node. It is the
        identity if the file contains none."""
        skin_entry = self._file.document.skins[skin]
        if skin_entry.inverseBindMatrices is None:
            matrices = np.tile(np.eye(4), (len(skin_entry.joints), 1, 1))
        else:
            stored = np.asarray(self._file.accessor(skin_entry.inverseBindMatrices), np.float64)
            matrices = stored.reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(matrices) < len(skin_entry.joints) or not np.isfinite(matrices).all():
            raise self._file.create_error(f"skin {skin} has no valid inverse bind matrices for its joints")
        flat = [
            self._file.name(n)
            for n, m in zip(skin_entry.joints, matrices, strict=False)
            if not _is_invertible(m)
        ]
        if flat:
            raise self._file.create_error(
                f"the inverse bind matrices of these joints cannot be inverted: {', '.join(flat[:5])}"
            )
        return {int(n): m for n, m in zip(skin_entry.joints, matrices, strict=False)}

    def _world_from_mesh(self, skin: int, carrier: int, known: set[int]) -> Float:
        """Returns (4, 4) world_from_mesh of a skin at the time of binding."""
        inverse = self.inverse[skin]
        shared = [node for node in inverse if node in known]
        if shared:
            return np.asarray(self.world[shared[0]] @ inverse[shared[0]])
        top = min(inverse, key=lambda node: (self._node_depth(node), node))
        by_joint, by_node = self.rest[top] @ inverse[top], self.rest[carrier]
        if self._has_joint_clips and not _is_even(by_joint):
            by_joint = self._compute_uniform_rest(top) @ inverse[top]
        bound = np.stack([np.linalg.inv(m)[:3, 3] for m in inverse.values()])
        rest_positions = bound @ by_joint[:3, :3].T + by_joint[:3, 3]
        bound_positions = bound @ by_node[:3, :3].T + by_node[:3, 3]
        size = max(float(np.ptp(rest_positions, axis=0).max()), 1e-9)
        # Compare rotation and scale too, because a difference in either would change the whole bind pose.
        lever = size * np.abs(np.linalg.solve(by_joint[:3, :3], by_node[:3, :3]) - np.eye(3)).max()
        is_plausible = (
            np.abs(rest_positions - bound_positions).max() < _MAX_JOINT_DISTANCE * size
            and lever < _MAX_JOINT_DISTANCE * size
        )
        return np.asarray(by_node if is_plausible else by_joint)

    @property
    def _has_joint_clips(self) -> bool:
        """True if the file has animations, unless the surface is read as a ``still``."""
        return bool(self._file.document.animations) and not self._still

    def _compute_uniform_rest(self, node: int) -> Float:
        """Returns a node's rest transform (4, 4) with a uniform scale. The animations contain the actual
        scale.
        """
        transform: Float = self.rest[node].copy()
        size = np.abs(self._scale[node])
        transform[:3, :3] /= size / np.cbrt(size.prod())
        return transform

    def _node_depth(self, node: int) -> int:
        depth = 0
        while self._file.parents[node] >= 0:
            node, depth = self._file.parents[node], depth + 1
        return depth

    def _move_skinless_nodes(self, known: set[int]) -> None:
        """Moves each node that is not a joint of a skin together with its nearest ancestor joint."""
        for node in self._order:
            parent = self._file.parents[node]
            if node in known or parent not in known:
                continue
            # The node is not a joint. A node above all joints stays unchanged. A node below a joint keeps its
            # pose relative to the joint.
            self.world[node] = self.world[parent] @ np.linalg.solve(self.rest[parent], self.rest[node])
            known.add(node)

    def _rescale_joints(self, known: set[int], parts: list[GltfPart]) -> None:
        """Scales and mirrors joints if their scale in the file differs from their scale at binding.

        A scale that is never animated is applied to the node and its whole subtree in the rest pose. The same
        applies to mirroring, because bones cannot be mirrored during an animation.
        """
        document = self._file.document
        animated = {
            channel.target.node
            for animation in document.animations or []
            for channel in animation.channels
            if channel.target is not None and channel.target.path == "scale"
        }
        bound = self.world.copy()
        sizes = {
            node: _compute_uniform_scale(self.rest[node]) / _compute_uniform_scale(bound[node])
            for node in known
        }
        # Mark nodes that are mirrored at rest relative to the bind pose.
        mirrored = {node: _is_mirrored(self.rest[node]) != _is_mirrored(bound[node]) for node in known}
        moving = set[int]()
        if document.animations and not self._still and _blends_mirrored(parts, mirrored):
            # A vertex that is only partly bound to a mirrored joint would move wrongly. In this case, the
            # animation clips mirror the bones instead.
            for node in self._order:
                if node in known and (mirrored[node] or self._file.parents[node] in moving):
                    moving.add(node)
            mirrored = dict.fromkeys(known, False)
        for node in self._order:
            parent = self._file.parents[node]
            if node not in known or parent not in known:
                continue
            self.world[node] = self.world[parent] @ np.linalg.solve(bound[parent], bound[node])
            scale_change = sizes[node] / sizes[parent] * self._uneven_scale(bound, parent, node)
            if node not in animated | moving and np.abs(scale_change - 1.0).max() > _MAX_SCALE_ROUNDING:
                self.world[node][:3, :3] *= scale_change
            if mirrored[node] != mirrored[parent]:
                self.world[node][:3, :3] *= self._mirror_signs(node)

    def _uneven_scale(self, bound: Float, parent: int, node: int) -> Float:
        """Returns the non-uniform part (3,), per axis, of a node's scale in the file relative to its scale at
        binding.

        For a model with animations, all three values are 1, and the animation clips contain the scale
        instead. Otherwise rotating children would be sheared.
        """
        if self._has_joint_clips:
            return np.ones(3)
        rest, at_binding = (
            np.linalg.solve(matrices[parent], matrices[node]) for matrices in (self.rest, bound)
        )
        scale_change = np.linalg.norm(rest[:3, :3], axis=0) / np.linalg.norm(at_binding[:3, :3], axis=0)
        scale_change = scale_change / np.cbrt(scale_change.prod())
        return scale_change if np.abs(scale_change - 1.0).max() > _MAX_SCALE_ROUNDING else np.ones(3)

    def _mirror_signs(self, node: int) -> Float:
        """Returns (3,) signs: -1 for each axis along which the file mirrors a node.

        If the axis cannot be determined from the file, the first axis is used.
        """
        signs = np.sign(self._scale[node])
        return signs if signs.prod() < 0 else np.array([-1.0, 1.0, 1.0])


def _compute_uniform_scale(matrix: Float) -> float:
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def _is_even(matrix: Float) -> bool:
    """Returns True if a transform (4, 4) scales uniformly."""
    sizes = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    return bool(sizes[0] - sizes[2] <= _MAX_SCALE_ROUNDING * sizes[0])


def _blends_mirrored(parts: list[GltfPart], mirrored: dict[int, bool]) -> bool:
    """Returns True if a vertex follows both mirrored and unmirrored joints."""
    for part in parts:
        mirrored_mask = np.zeros(max(int(part.nodes.max(initial=0)), *mirrored, 0) + 1, bool)
        mirrored_mask[[node for node, flag in mirrored.items() if flag]] = True
        moved_weight = np.where(mirrored_mask[part.nodes], part.weights, 0.0).sum(1)
        if ((moved_weight > 1e-4) & (moved_weight < 1.0 - 1e-4)).any():
            return True
    return False


def _is_mirrored(matrix: Float) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


def _is_invertible(matrix: Float) -> bool:
    return bool(abs(np.linalg.det(matrix[:3, :3])) > 1e-24)
