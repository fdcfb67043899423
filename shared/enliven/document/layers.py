"""Layers: references to takes. A bone keeps spans of them; nothing is baked before export.

A layer says which chain of a take's skeleton drives, in which basis, and when. A bone holds *spans*: shares
of its length, each with the interval [start, end] of every layer's arc length that falls on it. Inserting a
node splits a span in proportion; removing a node puts the spans of two bones one after the other. So a bone
between two different takes keeps both of them, exactly, where AniMesh (section 8, Figure 13) drops them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, freeze
from enliven.document.time_map import Playing
from enliven.errors import InputError
from enliven.rotation import IDENTITY

MODES: tuple[str, ...] = ("turns", "end")
"""What of a take a layer gives: the turns along its chain, or the place of the chain's end."""
FEET: tuple[str, ...] = ("auto", "always", "never", "ground")
"""How the pinned feet stand while a layer plays: held where they are low and slow; held wherever they are
low; let go; or only kept above the floor."""


@dataclass(frozen=True, eq=False)
class Layer(Playing):
    """A take with the chain, basis and time by which it drives bones.

    Attributes:
        id: its name in the project.
        take: the id of a clip.
        chain: joints of the take's skeleton, neighbours in its tree; arc length s runs from 0 at the first to
            1 at the last. The turns are relative to what carries the first joint: the bone that ends there.
            A chain of one joint stands for the turn of that entry itself (the root's: (0,)), from nothing at
            s = 0 to the whole at s = 1.
        basis: (4,) unit quaternion target_from_source: a turn Q of the source becomes basis Q basis^-1.
        weight: 0 to leave the bone as modeled, 1 for the whole turn; the turn of each source bone is scaled.
        muted: true leaves the layer out.
        mirrored: the source seen in a mirror: its turns q = (w, x, y, z) are taken as (w, x, -y, -z) and its
            displacements (x, y, z) as (-x, y, z), the reflection in the plane x = 0, before the basis.
        mode: "turns", the bones turn as the take's polyline does (AniMesh, 5); or "end", they turn so that
            the end of their chain is, from its start, where the end of the take's is, scaled by the lengths;
            see :mod:`enliven.motion.layers.end_effector`.
        stretch: whether the bones take the lengths and stretches of the take too, and not its turns alone: so
            plays a model's own clip, while a take of another body leaves the model its proportions.
        feet: how the pinned feet of its legs stand while it plays; see :mod:`enliven.motion.layers.footing`.
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
            problem = f"the basis {self.basis} is no unit quaternion"
        elif not self.chain:
            problem = "its chain has no joint"
        elif not 0.0 <= self.weight <= 1.0:
            problem = f"the weight is {self.weight}"
        elif self.mode not in MODES:
            problem = f"there is no mode {self.mode!r} (known: {', '.join(MODES)})"
        elif self.feet not in FEET:
            problem = f"feet cannot stand {self.feet!r} (known: {', '.join(FEET)})"
        if problem:
            raise InputError(problem, where=f"layer {self.id!r}", mend="Give the layer again.")
        self.check_time(f"layer {self.id!r}")


@dataclass(frozen=True, eq=False)
class RootLayer(Playing):
    """A clip by which a whole character is turned and moved in the world, over all that it plays.

    With the clip's turn r and place d at a time, x in the world becomes R (x - about) + about + m, where
    R = L r L^-1 and m = size L d, with L = basis S where it is mirrored, S = diag(-1, 1, 1), else L = basis.
    Of several the first is the innermost.

    Attributes:
        take: the id of a clip; the turn of its whole and the place of its joint 0 are played.
        about: (3,) metres in the world, what it turns about.
        basis, size, mirrored: how the character was turned, scaled and mirrored since.
        weight: from 0 to 1, how much of it is played.
        muted: true leaves it out.
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
            what = f"it cannot be turned by {self.basis} about {self.about}"
            raise InputError(what, where=where, mend="Set its keys again.")
        if not (0.0 < self.size < np.inf and 0.0 <= self.weight <= 1.0):
            what = f"it cannot be {self.size} times as large, with a weight of {self.weight}"
            raise InputError(what, where=where, mend="Give a size above 0, and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """What it is called: as its clip."""
        return self.take


@dataclass(frozen=True)
class Ref:
    """The part of a layer's arc length that falls on a span: from ``start`` to ``end``, within [0, 1].

    One that begins where it ends turns nothing; a bone that goes on rigidly takes the stretches of that
    place.
    """

    layer: str
    start: float
    end: float


@dataclass(frozen=True)
class Span:
    """A part of a bone: its ``share`` of the bone's length, and the layers that turn it, the first outermost.

    Its own turn is C(0)^-1 C(1), with C(u) the product, in order, of every layer's q(start + u (end -
    start)): a product of functions of the place telescopes along a chain, so the total turn is kept whatever
    is inserted, however many layers lie on one another. The turn of a bone is the product over its spans of
    ``before`` and the span's own turn: a_j = before_0 turn_0 before_1 turn_1 ...

    Attributes:
        share: of the bone's length, in [0, 1]; those of a bone sum to one. A share of 0 is a turn at the
            joint itself: that of a root which was grafted onto another shape.
        refs: the parts of layers that fall on it.
        before: unit quaternion (w, x, y, z), a fixed turn at the beginning of the span: the modeling rotation
            of a bone that was joined to the one before it when the node between them was removed.
    """

    share: float = 1.0
    refs: tuple[Ref, ...] = ()
    before: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


STILL: tuple[Span, ...] = (Span(),)
"""The spans of a bone that no take moves."""
