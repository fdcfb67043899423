"""The layers of a graph shape's nodes: parts with one stream each, and layers on top of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from enliven.arrays import Float, Int, freeze
from enliven.document.body_take import Possession
from enliven.document.time_map import LayerBase
from enliven.errors import InputError
from enliven.rotation import IDENTITY

_UNIT_TOLERANCE = 1e-3
"""Maximum deviation of a rotation's length from 1: rounding stays far below it."""


def _is_rotation(turn: Float) -> bool:
    """Returns True for a unit quaternion (4,)."""
    return turn.shape == (4,) and bool(abs(np.linalg.norm(turn) - 1.0) < _UNIT_TOLERANCE)


def _is_finite(values: Float, shape: tuple[int, ...]) -> bool:
    return values.shape == shape and bool(np.isfinite(values).all())


@dataclass(frozen=True, eq=False)
class Ride:
    """The attachment of a part of a graph shape to a node of another part, which carries it.

    The carried motion y becomes R(t) R_0^-1 (y - x_0) + x(t), with x the node's position and R the rotation
    nearest to its linear map. x_0 and R_0 are their values at the moment of the merge.

    Attributes:
        node: of the whole shape.
        turn: (4,) R_0.
        place: (3,) x_0.
    """

    node: int
    turn: Float
    place: Float

    def __post_init__(self) -> None:
        freeze(self, "turn", "place")
        if self.node < 0 or not (_is_rotation(self.turn) and _is_finite(self.place, (3,))):
            problem = f"node {self.node} cannot carry it with the rotation {self.turn} at {self.place}"
            raise InputError(problem, where="part of a merged mesh", mend="Merge the meshes again.")


class SolvedLayer(LayerBase):
    """A layer with a stream that was solved from performers, and can be solved from them again.

    Attributes:
        possession: the inputs of the solution; None if it was not solved.
    """

    source = "streams"
    if TYPE_CHECKING:

        @property
        def nodes(self) -> Int: ...
        @property
        def possession(self) -> Possession | None: ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """Returns the references to its stream, and to the bodies that it was solved from."""
        solved = self.possession
        return (*super().needs(), *(() if solved is None else (("bodies", solved.take),)))

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """Returns the layer with other ids of its stream and its bodies."""
        solved, named = self.possession, super().with_takes_named(names)
        if solved is None:
            return named
        return replace(named, possession=replace(solved, take=names["bodies", solved.take]))  # type: ignore[call-arg]


@dataclass(frozen=True, eq=False)
class GraphPart(SolvedLayer):
    """Nodes that play one stream.

    Attributes:
        take: the id of the stream.
        nodes: (K,) int64 numbers of the stream's nodes.
        axes: (4,) rotation of the rest pose since the recording: linear becomes linear axes^-1.
        turn: (4,) rotation of the whole motion in the world, and
        place: (3,) metres, its displacement: x becomes turn x + place.
        size: scale relative to the recording: x becomes size x, before it is moved.
        mirrored: whether it was reflected in the plane x = 0 before that, together with the rest pose: x
            becomes S x, and linear becomes S linear S, with S = diag(-1, 1, 1).
        ride: the node that carries it, or None for the world.
        muted: true holds its stream's first frame.
        possession: the inputs of the solution, for solving again; None if it was not solved.
    """

    take: str
    nodes: Int
    axes: Float = field(default_factory=lambda: IDENTITY)
    turn: Float = field(default_factory=lambda: IDENTITY)
    place: Float = field(default_factory=lambda: np.zeros(3))
    size: float = 1.0
    mirrored: bool = False
    ride: Ride | None = None
    muted: bool = False
    possession: Possession | None = None

    def __post_init__(self) -> None:
        freeze(self, "nodes", kind=np.int64)
        freeze(self, "axes", "turn", "place")
        self.check_time(f"part {self.take!r}")
        where = f"part {self.take!r}"
        if not 0.0 < self.size < np.inf:
            raise InputError(f"it cannot be {self.size} times as large", where=where)
        if not (_is_rotation(self.axes) and _is_rotation(self.turn) and _is_finite(self.place, (3,))):
            problem = (
                f"it cannot be turned by {self.turn}, its axes by {self.axes}, and moved by {self.place}"
            )
            raise InputError(
                problem, where=where, mend="Move the character again, or possess the mesh again."
            )
        node_count = np.inf if self.possession is None else len(self.possession.rest)
        if self.nodes.size and not self.nodes.max() < node_count:
            problem = f"it plays node {self.nodes.max()} of {node_count} that were solved"
            raise InputError(problem, where=where, mend="Possess the mesh again.")


@dataclass(frozen=True, eq=False)
class GraphLayer(SolvedLayer):
    """A layer performed on top of the motion of a graph shape: the displacement of each node from its rest
    position.

    Near a node, let B map rest to the world by the base motion, and D map rest to rest by the layer. Then the
    node maps points by B D. Of several layers the first is the outermost.

    Attributes:
        take: the id of the stream: positions and linear maps of the nodes, relative to the mesh at rest.
        nodes: (K,) int64 numbers of the stream's nodes.
        own: (K,) int64 the nodes of the shape that they move.
        rest: (N, 3) metres, the stream's nodes at rest.
        axes, size, mirrored: how the shape's rest pose was rotated, scaled and reflected since: a
            displacement d becomes size axes S d, as in :class:`GraphPart`.
        weight: from 0 to 1, its strength.
        muted: true leaves it out.
        possession: of :class:`SolvedLayer`.
        feet: foot lock mode, for a layer that locks feet: see :mod:`enliven.modeling.edits.graph_feet`; empty
            for any other.
    """

    take: str
    nodes: Int
    own: Int
    rest: Float
    axes: Float = field(default_factory=lambda: IDENTITY)
    size: float = 1.0
    mirrored: bool = False
    weight: float = 1.0
    muted: bool = False
    possession: Possession | None = None
    feet: str = ""

    def __post_init__(self) -> None:
        freeze(self, "nodes", "own", kind=np.int64)
        freeze(self, "rest", "axes")
        where = f"layer {self.take!r}"
        self.check_time(where)
        fits = self.nodes.shape == self.own.shape and self.nodes.size > 0 and self.rest.shape[1:] == (3,)
        if not (fits and self.nodes.max() < len(self.rest)):
            problem = f"{self.nodes.shape} nodes of {self.rest.shape} move {self.own.shape}"
            raise InputError(problem, where=where, mend="Record it again.")
        if not (np.isfinite(self.rest).all() and _is_rotation(self.axes)):
            problem = f"its nodes at rest, or its rotation {self.axes}, are no numbers that can be played"
            raise InputError(problem, where=where, mend="Record it again.")
        if not (0.0 < self.size < np.inf and 0.0 <= self.weight <= 1.0):
            problem = f"it cannot be {self.size} times as large, with a weight of {self.weight}"
            raise InputError(problem, where=where, mend="Give a size above 0, and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """Its name: the id of its stream."""
        return self.take
