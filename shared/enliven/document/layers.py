"""Layers: references to takes that move bones. Motion is evaluated from the takes, and baked only at export.

A layer defines the joint chain of a take's skeleton that drives bones, its basis, and its timing. A bone is
divided into *spans*, which are fractions of its length. A span contains, for each layer, the interval [start,
end] of the layer's arc length that moves it. Inserting a node splits a span in proportion. Removing a node
concatenates the spans of two bones. So a bone between two bones with different takes keeps both takes
exactly. AniMesh drops them in that case (section 8, Figure 13).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, freeze
from enliven.document.time_map import LayerBase
from enliven.errors import InputError
from enliven.rotation import IDENTITY

MODES: tuple[str, ...] = ("turns", "end")
"""The data of a take that a layer uses: the rotations along its chain ("turns"), or the position of the
chain's end ("end")."""
FEET: tuple[str, ...] = ("auto", "always", "never", "ground")
"""Foot lock modes of a layer. "auto" locks a foot while it is low and slow, "always" whenever it is low, and
"never" not at all. "ground" only keeps it above the floor."""


@dataclass(frozen=True, eq=False)
class Layer(LayerBase):
    """A layer: a take that drives bones, with its chain, its basis and its timing.

    Attributes:
        id: its name in the project.
        take: the id of a clip.
        chain: consecutive joints of the take's skeleton. Arc length s increases from 0 at the first to 1 at
            the last joint. The rotations are relative to the bone that ends at the first joint. If the chain
            has a single joint, such as (0,) for the root, it stands for the rotation of this joint's bone.
            This rotation increases from none at s = 0 to the full rotation at s = 1.
        basis: (4,) unit quaternion, the rotation from the source's axes to the target's axes. A rotation Q of
            the source becomes basis Q basis^-1.
        weight: factor on the rotation of each source bone. 0 leaves the bone as modeled, and 1 applies the
            full rotation.
        muted: True leaves the layer out.
        mirrored: reflects the source in the plane x = 0, before the basis: its rotations q = (w, x, y, z)
            become (w, x, -y, -z) and its displacements (x, y, z) become (-x, y, z).
        mode: "turns": the bones rotate like the polyline of the take (AniMesh, 5). "end": the end of the
            bones' chain, relative to its start, follows the end of the take's chain, scaled by the lengths;
            see :mod:`enliven.motion.layers.end_effector`.
        stretch: True if the bones also get the lengths and stretches of the take, not only its rotations. A
            model's own clip uses this. It is False for a take of another body, so that the model keeps its
            proportions.
        feet: foot lock mode of the pinned feet while the layer plays; see
            :mod:`enliven.motion.layers.footing`.
    """

    id: str
    take: str
    chain: tuple[int, ...]
    basis: Float = field(default_factory=lambda: IDENTITY)
    weight: float = 1.0
    muted: bool = False
    mirrored: bool = False
    mode: str = "turns"
    feet: str = "auto"
    stretch: bool = False

    def __post_init__(self) -> None:
        freeze(self, "basis")
        basis = self.basis
        object.__setattr__(self, "chain", tuple(int(joint) for joint in self.chain))
        problem = ""
        if basis.shape != (4,) or not np.isclose(np.linalg.norm(basis), 1.0, atol=1e-6):
            problem = f"the rotation {self.basis} of the layer is not a unit quaternion"
        elif not self.chain:
            problem = "the layer's chain has no joint"
        elif not 0.0 <= self.weight <= 1.0:
            problem = f"the weight {self.weight} of the layer is not between 0 and 1"
        elif self.mode not in MODES:
            problem = f"the layer mode {self.mode!r} does not exist (known modes: {', '.join(MODES)})"
        elif self.feet not in FEET:
            problem = f"the foot lock mode {self.feet!r} does not exist (known modes: {', '.join(FEET)})"
        if problem:
            raise InputError(problem, where=f"layer {self.id!r}", remedy="Correct this value of the layer.")
        self.check_time(f"layer {self.id!r}")


@dataclass(frozen=True, eq=False)
class RootLayer(LayerBase):
    """A layer with a clip that rotates and moves a whole character in the world, in addition to its other
    layers.

    Let r be the clip's rotation and d its position at a time. Then a point x in the world becomes R (x -
    about) + about + m, with R = L r L^-1 and m = size L d. If the layer is mirrored, L = basis S with S =
    diag(-1, 1, 1), and otherwise L = basis. If there are several root layers, the first is the innermost.

    Attributes:
        take: the id of a clip, which provides the rotation of the whole character and the position of joint
            0.
        about: (3,) metres in the world, centre of the rotation.
        basis, size, mirrored: rotation, scale and reflection of the character since the layer was added.
        weight: strength of the layer, 0 to 1.
        muted: True leaves the layer out.
    """

    take: str
    about: Float = field(default_factory=lambda: np.zeros(3))
    basis: Float = field(default_factory=lambda: IDENTITY)
    size: float = 1.0
    mirrored: bool = False
    weight: float = 1.0
    muted: bool = False

    def __post_init__(self) -> None:
        freeze(self, "about", "basis")
        where = f"layer {self.take!r}"
        self.check_time(where)
        unit = self.basis.shape == (4,) and np.isclose(np.linalg.norm(self.basis), 1.0, atol=1e-6)
        if not (unit and self.about.shape == (3,) and np.isfinite(self.about).all()):
            problem = f"the rotation {self.basis} or the centre {self.about} of the layer is not valid"
            raise InputError(problem, where=where, remedy="Set the keys of the layer again.")
        if not (0.0 < self.size < np.inf and 0.0 <= self.weight <= 1.0):
            problem = f"the scale {self.size} or the weight {self.weight} of the layer is not valid"
            raise InputError(problem, where=where, remedy="Set a scale above 0 and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """The name of the layer: the id of its clip."""
        return self.take


@dataclass(frozen=True)
class Ref:
    """A reference to the interval of a layer's arc length, from ``start`` to ``end`` within [0, 1], that
    moves a span.

    A reference with equal start and end causes no rotation. It only applies the stretch at this position, to
    a bone that rigidly continues another bone.
    """

    layer: str
    start: float
    end: float


@dataclass(frozen=True)
class Span:
    """A part of a bone: its fraction (``share``) of the bone's length, and the layers that rotate it. The
    first layer is the outermost.

    Its own rotation is C(0)^-1 C(1), with C(u) the product, in order, of every layer's q(start + u (end -
    start)). Such a product telescopes along a chain, so inserting nodes never changes the total rotation, for
    any number of layers. The rotation of a bone is the product over its spans of ``before`` and the span's
    own rotation: a_j = before_0 turn_0 before_1 turn_1 ...

    Attributes:
        share: fraction of the bone's length, in [0, 1]. The shares of a bone sum to one. A share of 0 is a
            rotation at the joint itself, for example the rotation of a root that was grafted onto another
            shape.
        refs: the intervals of layers that fall on the span.
        before: unit quaternion (w, x, y, z), a fixed rotation at the start of the span. If a node was
            removed, it is the modeling rotation of the lower bone, which was joined to its parent.
    """

    share: float = 1.0
    refs: tuple[Ref, ...] = ()
    before: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


STILL: tuple[Span, ...] = (Span(),)
"""The spans of a bone that no take moves."""
