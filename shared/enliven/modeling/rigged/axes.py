"""Turned and mirrored axes of rest, and the change of rest poses, rotations, spans and layers to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Layer
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.rigged.spans import Spans, as_before
from enliven.rotation import IDENTITY, conjugate, multiply, normalized, rotate

_MIRRORED = np.array([1.0, 1.0, -1.0, -1.0])
"""What the reflection in the plane x = 0 does to a quaternion: S q S, S = diag(-1, 1, 1)."""


_AS_THEY_ARE: Mapping[str, str] = {}
"""No layer has a new id."""


@dataclass(frozen=True, eq=False)
class Axes:
    """New axes of rest: a vector v becomes L v, with L = turn S where ``mirrored``, else L = turn.

    A rotation q becomes L q L^-1; a mirrored one turns about the mirrored axis, the other way round.

    Attributes:
        turn: (4,) unit quaternion.
        mirrored: reflect in the plane x = 0 first (S).
    """

    turn: Float
    mirrored: bool = False

    @staticmethod
    def mirror(normal: AnyArray) -> Axes:
        """The reflection in the plane through the origin at right angles to ``normal`` (3,).

        A reflection is minus the half turn about its normal, so M = (half turn about n)(half turn about x) S.
        """
        length = float(np.linalg.norm(normal))
        if np.shape(normal) != (3,) or not np.isfinite(length) or length == 0.0:
            raise InputError(f"{normal} is no direction", where="mirror", mend="Give the plane's normal.")
        half = np.concatenate([[0.0], np.asarray(normal, np.float64) / length])
        return Axes(multiply(half, np.array([0.0, 1.0, 0.0, 0.0])), True)

    @property
    def same(self) -> bool:
        """Whether nothing changes."""
        return not self.mirrored and bool(np.array_equal(self.turn, IDENTITY))

    def vectors(self, v: AnyArray) -> Float:
        """(..., 3) L v."""
        v = np.asarray(v, np.float64)
        return rotate(self.turn, v * np.array([-1.0, 1.0, 1.0]) if self.mirrored else v)

    def rotations(self, q: AnyArray) -> Float:
        """(..., 4) L q L^-1."""
        q = np.asarray(q, np.float64) * _MIRRORED if self.mirrored else np.asarray(q, np.float64)
        return multiply(multiply(self.turn, q), conjugate(self.turn))

    def layer(self, layer: Layer) -> Layer:
        """The layer with the turns L q L^-1, for ``layer``'s turns q, and the displacements L d."""
        basis = layer.basis * _MIRRORED if self.mirrored else layer.basis
        basis = normalized(multiply(self.turn, basis))
        return replace(layer, basis=basis, mirrored=layer.mirrored != self.mirrored)

    def spans(self, spans: Spans, layers: Mapping[str, str] = _AS_THEY_ARE) -> Spans:
        """The spans with what is fixed in them in the new axes; ``layers``: the new id of each layer."""
        return tuple(
            replace(
                span,
                refs=tuple(replace(ref, layer=layers.get(ref.layer, ref.layer)) for ref in span.refs),
                before=span.before if self.same else as_before(self.rotations(np.array(span.before))),
            )
            for span in spans
        )


def moved_mesh(mesh: Mesh, root: Float, axes: Axes, to: Float) -> Mesh:
    """The mesh in other axes about ``root`` (3,), which comes to ``to`` (3,)."""
    vertices = to + axes.vectors(mesh.vertices - root)
    return replace(mesh, vertices=vertices, faces=mesh.faces[:, ::-1] if axes.mirrored else mesh.faces)
