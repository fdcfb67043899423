"""Changes of the rest axes by a rotation or reflection. They convert rest poses, rotations, spans and
layers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Layer
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.rigged.spans import Spans, compute_exact_rotation
from enliven.rotation import IDENTITY, conjugate, multiply, normalized, rotate

_MIRROR_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
"""Factors of a quaternion under reflection in the plane x = 0: S q S, S = diag(-1, 1, 1)."""


_UNCHANGED_IDS: Mapping[str, str] = {}
"""The empty mapping: all layers keep their ids."""


@dataclass(frozen=True, eq=False)
class Axes:
    """A change of the rest axes: a vector v becomes L v, with L = turn S if ``mirrored``, else L = turn.

    A rotation q becomes L q L^-1. If L reflects, this is a rotation about the reflected axis in the opposite
    direction.

    Attributes:
        turn: (4,) unit quaternion.
        mirrored: True to reflect in the plane x = 0 first (S).
    """

    turn: Float
    mirrored: bool = False

    @staticmethod
    def mirror(normal: AnyArray) -> Axes:
        """Returns the reflection in the plane through the origin perpendicular to ``normal`` (3,).

        A reflection is the negative of the half turn about its normal, and S is the negative of the half turn
        about x. So the result is (half turn about ``normal``) (half turn about x) S.
        """
        length = float(np.linalg.norm(normal))
        if np.shape(normal) != (3,) or not np.isfinite(length) or length == 0.0:
            raise InputError(
                f"{normal} is not a direction",
                where="mirror",
                remedy="Pass the normal of the mirror plane as three finite numbers that are not all 0.",
            )
        half = np.concatenate([[0.0], np.asarray(normal, np.float64) / length])
        return Axes(multiply(half, np.array([0.0, 1.0, 0.0, 0.0])), True)

    @property
    def is_identity(self) -> bool:
        """True if this change leaves the axes unchanged."""
        return not self.mirrored and bool(np.array_equal(self.turn, IDENTITY))

    def vectors(self, v: AnyArray) -> Float:
        """Returns the converted vectors L v (..., 3)."""
        v = np.asarray(v, np.float64)
        return rotate(self.turn, v * np.array([-1.0, 1.0, 1.0]) if self.mirrored else v)

    def rotations(self, q: AnyArray) -> Float:
        """Returns the converted rotations L q L^-1 (..., 4)."""
        q = np.asarray(q, np.float64) * _MIRROR_SIGNS if self.mirrored else np.asarray(q, np.float64)
        return multiply(multiply(self.turn, q), conjugate(self.turn))

    def layer(self, layer: Layer) -> Layer:
        """Converts a layer: its rotations q become L q L^-1, and its displacements d become L d."""
        basis = layer.basis * _MIRROR_SIGNS if self.mirrored else layer.basis
        basis = normalized(multiply(self.turn, basis))
        return replace(layer, basis=basis, mirrored=layer.mirrored != self.mirrored)

    def spans(self, spans: Spans, layers: Mapping[str, str] = _UNCHANGED_IDS) -> Spans:
        """Converts the fixed rotations of the spans to the new axes. ``layers`` maps each layer to its new
        id."""
        return tuple(
            replace(
                span,
                refs=tuple(replace(ref, layer=layers.get(ref.layer, ref.layer)) for ref in span.refs),
                before=span.before
                if self.is_identity
                else compute_exact_rotation(self.rotations(np.array(span.before))),
            )
            for span in spans
        )


def convert_mesh_axes(mesh: Mesh, root: Float, axes: Axes, to: Float) -> Mesh:
    """Converts a mesh to other axes about the point ``root`` (3,), and moves that point to ``to`` (3,). Both
    are in metres."""
    vertices = to + axes.vectors(mesh.vertices - root)
    moved = replace(mesh, vertices=vertices)
    return moved.flip_faces() if axes.mirrored else moved
