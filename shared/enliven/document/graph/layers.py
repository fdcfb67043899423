"""The layers of a possessed mesh: parts (groups of nodes that play one pose stream each), and layers on top
of them.
"""

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
"""Maximum deviation of a quaternion's length from 1. Rounding errors are much smaller."""


def _is_rotation(turn: Float) -> bool:
    """Returns True for a unit quaternion (4,)."""
    return turn.shape == (4,) and bool(abs(np.linalg.norm(turn) - 1.0) < _UNIT_TOLERANCE)


def _is_finite(values: Float, shape: tuple[int, ...]) -> bool:
    return values.shape == shape and bool(np.isfinite(values).all())


@dataclass(frozen=True, eq=False)
class Ride:
    """The attachment of a part of a graph shape to a node of another part, which carries it.

    The carried motion y becomes R(t) R_0^-1 (y - x_0) + x(t), with x the carrying node's position and R the
    rotation nearest to its linear map. x_0 and R_0 are their values when the meshes were merged.

    Attributes:
        node: number of the carrying node in the whole shape.
        turn: (4,) R_0.
        place: (3,) x_0.
    """

    node: int
    turn: Float
    place: Float

    def __post_init__(self) -> None:
        freeze(self, "turn", "place")
        if self.node < 0 or not (_is_rotation(self.turn) and _is_finite(self.place, (3,))):
            problem = (
                f"a part cannot be attached to node {self.node} with the rotation {self.turn} at {self.place}"
            )
            raise InputError(problem, where="part of a merged mesh", remedy="Merge the meshes again.")


class SolvedLayer(LayerBase):
    """A layer with a stream that was solved from the motion of performers, and can be solved again.

    Attributes:
        possession: the inputs of the solution, or None if the stream was not solved.
    """

    source = "streams"
    if TYPE_CHECKING:

        @property
        def nodes(self) -> Int:
            """The (K,) int64 numbers of the stream's nodes that the layer plays."""
            ...

        @property
        def possession(self) -> Possession | None:
            """The inputs of the solution, or None if the stream was not solved."""
            ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """Returns the references of the layer: to its stream, and to the body take of its solution."""
        solved = self.possession
        return (*super().needs(), *(() if solved is None else (("bodies", solved.take),)))

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """Returns the layer with renamed ids of its stream and its body take."""
        solved, renamed = self.possession, super().with_takes_named(names)
        if solved is None:
            return renamed
        return replace(renamed, possession=replace(solved, take=names["bodies", solved.take]))  # type: ignore[call-arg]


@dataclass(frozen=True, eq=False)
class GraphPart(SolvedLayer):
    """A group of nodes that play one pose stream.

    Attributes:
        take: the id of the stream.
        nodes: (K,) int64 numbers of the stream's nodes.
        axes: (4,) rotation of the rest pose since the recording. A linear map becomes linear axes^-1.
        turn: (4,) rotation of the whole motion in the world. A position x becomes turn x + place.
        place: (3,) displacement of the whole motion, metres.
        size: scale relative to the recording. A position x becomes size x. The scale is applied before
            ``turn`` and ``place``.
        mirrored: True if motion and rest pose were reflected in the plane x = 0. A position x becomes S x,
            and a linear map becomes S linear S, with S = diag(-1, 1, 1). The reflection is applied first.
        ride: the attachment to the node that carries the part, or None if the part moves in the world.
        muted: True keeps the nodes in the first frame of the stream.
        possession: the inputs for solving the stream again, or None if it was not solved.
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
            raise InputError(f"the scale {self.size} of the part is not above 0", where=where)
        if not (_is_rotation(self.axes) and _is_rotation(self.turn) and _is_finite(self.place, (3,))):
            problem = (
                f"the rotation {self.turn}, the axes {self.axes} or the displacement {self.place} of "
                "the part is not valid"
            )
            raise InputError(
                problem, where=where, remedy="Move the character again, or possess the mesh again."
            )
        node_count = np.inf if self.possession is None else len(self.possession.rest)
        if self.nodes.size and not self.nodes.max() < node_count:
            problem = f"the part refers to node {self.nodes.max()}, but only {node_count} nodes were solved"
            raise InputError(problem, where=where, remedy="Possess the mesh again.")


@dataclass(frozen=True, eq=False)
class GraphLayer(SolvedLayer):
    """A layer that was recorded on top of the motion of a graph shape. It contains the displacement of each
    node from its rest position.

    Near a node, let B be the map from rest to world of the base motion, and D the layer's map within the rest
    space. The node maps points by B D. If there are several layers, the first is the outermost.

    Attributes:
        take: the id of the stream: positions and linear maps of the nodes, relative to the mesh at rest.
        nodes: (K,) int64 numbers of the stream's nodes.
        own: (K,) int64 numbers of the shape's nodes that these nodes move.
        rest: (N, 3) metres, the stream's nodes at rest.
        axes, size, mirrored: rotation, scale and reflection of the shape's rest pose since the recording. A
            displacement d becomes size axes S d, as in :class:`GraphPart`.
        weight: strength of the layer, 0 to 1.
        muted: True leaves the layer out.
        possession: see :class:`SolvedLayer`.
        feet: foot lock mode of a layer that locks feet, see :mod:`enliven.modeling.edits.graph_feet`; empty
            for all other layers.
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
            problem = (
                f"the node arrays of the layer do not match: {self.nodes.shape} nodes of "
                f"{self.rest.shape} move {self.own.shape} nodes"
            )
            raise InputError(problem, where=where, remedy="Record the layer again.")
        if not (np.isfinite(self.rest).all() and _is_rotation(self.axes)):
            problem = f"the rest positions of the layer's nodes or the rotation {self.axes} are not valid"
            raise InputError(problem, where=where, remedy="Record the layer again.")
        if not (0.0 < self.size < np.inf and 0.0 <= self.weight <= 1.0):
            problem = f"the scale {self.size} or the weight {self.weight} of the layer is not valid"
            raise InputError(problem, where=where, remedy="Set a scale above 0 and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """The name of the layer: the id of its stream."""
        return self.take
