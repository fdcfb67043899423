"""A performance: one character's surface and its transforms over time, whatever kind of rig moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton, SkinWeights
from enliven.errors import InputError
from enliven.examples.baking import BakedMorphs, BakeError
from enliven.meshes import Mesh
from enliven.rotation import from_matrix, to_matrix


@dataclass(frozen=True, eq=False)
class Performance:
    """A mesh with transforms over time: v' = sum_k w_k (linear_k (v - pivot_k) + position_k), then the frame.

    Attributes:
        name: the character's.
        times: (T,) seconds, rising evenly, from 0.
        pivots: (J, 3) metres, where the transforms are at rest.
        linear: (T, J, 3, 3); rotations where there is a skeleton.
        positions: (T, J, 3) metres, where the pivots are.
        mesh: at rest, or None for a skeleton alone.
        skin: which transforms each vertex follows, or None without a mesh.
        skeleton: the joints, where transform j is that of bone j about its parent joint; None where the
            transforms hang on nothing, as the nodes of a deformation graph do.
        axes: (J, 3, 3) rotations: the axes along which each transform stretches; None for those of the mesh.
        turns, places: (T, 4) and (T, 3), where the frame of all this is: x is at turn x + place in the world.
            None: it is the world.
        morphs: morph targets in place of the skin, or None.
        keys: metres that an exporter may add to the error by leaving out keys.
        error: how far the baked surface is from the one on the screen, or None where nothing was baked.
    """

    name: str
    times: Float
    pivots: Float
    linear: Float
    positions: Float
    mesh: Mesh | None = None
    skin: SkinWeights | None = None
    skeleton: Skeleton | None = None
    axes: Float | None = None
    turns: Float | None = None
    places: Float | None = None
    morphs: BakedMorphs | None = None
    keys: float = 0.0
    error: BakeError | None = None

    @property
    def lost(self) -> float:
        """The largest part of a map that a turn and a scale along ``axes`` cannot express."""
        axes = np.eye(3) if self.axes is None else self.axes
        turns, scales = stretches_of(self.linear @ axes)
        said = to_matrix(turns) * scales[..., None, :] @ np.swapaxes(axes, -1, -2)
        return float(np.abs(said - self.linear).max())

    @property
    def surface(self) -> tuple[Mesh, SkinWeights]:
        """The mesh and its skin.

        Raises:
            InputError: where it has none.
        """
        if self.mesh is None or self.skin is None or not len(self.mesh.faces):
            mend = "Give it one, or leave it out."
            raise InputError("it has no mesh", where=f"character {self.name!r}", mend=mend)
        return self.mesh, self.skin


def stretches_of(linear: Float) -> tuple[Float, Float]:
    """(T, N, 4) turns and (T, N, 3) scales of (T, N, 3, 3) maps: R, and the diagonal of S in linear = R S."""
    turns = from_matrix(linear)
    scales = np.einsum("tnji,tnji->tni", to_matrix(turns), linear)
    return continuous(turns), scales


def continuous(turns: Float) -> Float:
    """The same (T, N, 4) turns, each of the sign that is nearest to the one before it in time."""
    flips = np.sign(np.einsum("tnc,tnc->tn", turns[1:], turns[:-1]))
    flips[flips == 0] = 1.0
    start = np.where(turns[:1, :, 0] < 0, -1.0, 1.0)
    signs = np.concatenate([start, start * np.cumprod(flips, 0)])
    return np.asarray(turns * signs[..., None])
