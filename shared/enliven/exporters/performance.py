"""A performance: one character's surface and its transforms over time, for any kind of rig."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.skinning import skin_vertices
from enliven.document import Character, CubicKeys, Pose, Skeleton, SkinWeights, bones_to_draw
from enliven.errors import InputError
from enliven.examples.baking.bake import Frames
from enliven.examples.baking.morphs import BakedMorphs
from enliven.examples.baking.settings import BakeError
from enliven.meshes import Mesh
from enliven.rotation import from_matrix, remove_sign_jumps, rotate, to_matrix

_RIGID_TOLERANCE = 1e-6
"""Maximum stretch of a rigid bone, and maximum motion of its joint as a fraction of the length of all bones.
It allows for rounding errors in long chains."""


@dataclass(frozen=True, eq=False)
class Performance:
    """A mesh with transforms over time. Vertex v moves to v' = sum_k w_k (linear_k (v - pivot_k) +
    position_k). Then the pose of the coordinate frame is applied.

    Attributes:
        name: the character's name.
        times: (T,) seconds, increasing from 0. They are evenly spaced, unless they include key times of the
            character's clips.
        pivots: (J, 3) metres, positions of the transforms at rest.
        linear: (T, J, 3, 3) linear parts of the transforms. With a skeleton they are rotations, unless its
            takes stretch bones.
        positions: (T, J, 3) metres, positions of the pivots.
        mesh: the mesh at rest. None for a skeleton without a mesh.
        skin: the skin weights, that is, the transforms that each vertex follows. None without a mesh.
        skeleton: the joints. Transform j moves bone j about its parent joint. None if the transforms have no
            hierarchy, like the nodes of a deformation graph.
        joints: (T, J, 3) metres, positions of the skeleton's joints. None without a skeleton.
        axes: (J, 3, 3) rotations, the stretch axes of each transform. None means the axes of the mesh.
        turns, places: (T, 4) and (T, 3) metres, the pose of the coordinate frame of the arrays above. A point
            x of this frame is at turn x + place in the world. If None, the frame is the world.
        morphs: morph targets instead of the skin, or None.
        solved: a function that returns an iterator over the surfaces (V, 3) of all frames. It is used instead
            of the skin. None if the skin is used.
        keys: maximum additional error in metres that an exporter may cause by key reduction.
        cubic: the cubic keys of bones and of the root's position, with times as in ``times``. If there are
            any, they contain the complete motion of the character.
        error: deviation of the baked surface from the displayed one, or None if nothing was baked.
    """

    name: str
    times: Float
    pivots: Float
    linear: Float
    positions: Float
    mesh: Mesh | None = None
    skin: SkinWeights | None = None
    skeleton: Skeleton | None = None
    joints: Float | None = None
    axes: Float | None = None
    turns: Float | None = None
    places: Float | None = None
    morphs: BakedMorphs | None = None
    solved: Frames | None = None
    keys: float = 0.0
    error: BakeError | None = None
    cubic: tuple[CubicKeys, ...] = ()

    @property
    def character(self) -> Character:
        """The character in the format for viewers: its vertices follow transforms in the world.

        Raises:
            InputError: if it has no mesh.
        """
        mesh, skin = self.surface
        vertices, pivots = mesh.vertices.astype(np.float32), self.pivots.astype(np.float32)
        kind, edges, names = "graph", np.zeros((0, 2), np.int32), None
        if self.skeleton is not None:
            kind, edges, names = "bones", bones_to_draw(self.skeleton), self.skeleton.names
        arguments = self.name, vertices, mesh.faces, skin, pivots, edges, kind, mesh.colours
        return Character(*arguments, names=names, materials=mesh.materials)

    def poses(self) -> Iterator[Pose]:
        """Yields the character's pose in the world at each time, in nanoseconds from 0."""
        linear, positions = self.linear, self.positions
        if self.turns is not None and self.places is not None:
            linear = to_matrix(self.turns)[:, None] @ linear
            positions = rotate(self.turns[:, None], positions) + self.places[:, None]
        for time, maps, places in zip(self.times, linear, positions, strict=True):
            stored_maps = maps.astype(np.float32), places.astype(np.float32)
            yield Pose(self.name, round(time * 1e9), *stored_maps)

    def surfaces(self) -> Iterator[Float32]:
        """Yields (V, 3) metres in the world, the vertices of the mesh at each time.

        Raises:
            InputError: if it has no mesh.
        """
        mesh, character = self.surface[0], self.character
        if self.solved is None and self.morphs is None:
            for pose in self.poses():
                yield skin_vertices(character, pose)
            return
        if self.solved is not None:
            frames = iter(self.solved())
        else:
            assert self.morphs is not None
            targets = self.morphs.targets
            frames = (mesh.vertices + np.tensordot(row, targets, 1) for row in self.morphs.weights)
        for number, vertices in enumerate(frames):
            if self.turns is not None and self.places is not None:
                vertices = vertices @ to_matrix(self.turns[number]).T + self.places[number]
            yield vertices.astype(np.float32)

    @property
    def stretches(self) -> bool:
        """True if bones of its skeleton are stretched, or moved relative to each other."""
        if self.skeleton is None or self.joints is None:
            return False
        skeleton, gram = self.skeleton, np.einsum("tnba,tnbc->tnac", self.linear, self.linear)
        if np.abs(gram - np.eye(3)).max() > _RIGID_TOLERANCE or (np.linalg.det(self.linear) < 0).any():
            return True
        offsets = self.joints[:, 1:] - self.positions[:, 1:]
        bone_offsets = np.einsum("tnba,tnb->tna", self.linear[:, 1:], offsets)
        return bool(
            np.abs(bone_offsets - skeleton.vectors[1:]).max(initial=0.0)
            > _RIGID_TOLERANCE * skeleton.lengths.sum()
        )

    @property
    def surface(self) -> tuple[Mesh, SkinWeights]:
        """The mesh and its skin weights.

        Raises:
            InputError: if the performance has no mesh.
        """
        if self.mesh is None or self.skin is None or not len(self.mesh.faces):
            remedy = "Add a mesh to the character, or leave the character out."
            raise InputError("the character has no mesh", where=f"character {self.name!r}", remedy=remedy)
        return self.mesh, self.skin


def split_stretch(linear: Float) -> tuple[Float, Float]:
    """Splits linear maps R S (T, N, 3, 3) into rotations R (T, N, 4) and scales (T, N, 3), the diagonal of S.

    A map that mirrors has negative scales.
    """
    rotations = from_matrix(linear * np.where(np.linalg.det(linear) < 0, -1.0, 1.0)[..., None, None])
    scales = np.einsum("tnji,tnji->tni", to_matrix(rotations), linear)
    return remove_sign_jumps(rotations), scales
