"""What the nodes of a graph shape play: parts with a stream each, and layers over them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from enliven.arrays import Float, Int, freeze
from enliven.document.body_take import Possession
from enliven.document.time_map import Playing
from enliven.errors import InputError
from enliven.rotation import IDENTITY


@dataclass(frozen=True, eq=False)
class Ride:
    """A part of a graph shape that is carried by a node of another part, as it was put there.

    The carried motion y becomes R(t) R_0^-1 (y - x_0) + x(t), with x the node's position and R the rotation
    nearest to its linear map, x_0 and R_0 those at the moment of the merge.

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


class Solved(Playing):
    """What plays a stream that was solved from performers, and can be solved from them again.

    Attributes:
        possession: what the stream was solved from; None: from nothing.
    """

    source = "streams"
    if TYPE_CHECKING:

        @property
        def nodes(self) -> Int: ...
        @property
        def possession(self) -> Possession | None: ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """Its stream, and the bodies that it was solved from."""
        solved = self.possession
        return (*super().needs(), *(() if solved is None else (("bodies", solved.take),)))

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """The same with other ids of its stream and its bodies."""
        solved, named = self.possession, super().with_takes_named(names)
        if solved is None:
            return named
        return replace(named, possession=replace(solved, take=names["bodies", solved.take]))  # type: ignore[call-arg]


@dataclass(frozen=True, eq=False)
class GraphPart(Solved):
    """Nodes that play one stream.

    Attributes:
        take: the id of the stream.
        nodes: (K,) int64 which of the stream's nodes.
        axes: (4,) how the rest pose was turned since the recording: linear becomes linear axes^-1.
        turn: (4,) and
        place: (3,) metres, how the whole motion was moved in the world: x becomes turn x + place.
        size: how many times as large it is as recorded: x becomes size x, before it is moved.
        mirrored: whether it was reflected in the plane x = 0 before that: x becomes S x, linear S linear S,
            S = diag(-1, 1, 1); so is the rest pose.
        ride: what carries it, or None for the world.
        muted: true lets it stand still, as at its stream's first frame.
        possession: what the stream was solved from, and can be solved from again; None: from nothing.
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
        if not self.size > 0.0:
            raise InputError(f"it cannot be {self.size} times as large", where=f"part {self.take!r}")

        known = np.inf if self.possession is None else len(self.possession.rest)
        if self.nodes.size and not self.nodes.max() < known:
            what = f"it plays node {self.nodes.max()} of {known} that were solved"
            raise InputError(what, where=f"part {self.take!r}", mend="Possess the mesh again.")


@dataclass(frozen=True, eq=False)
class GraphLayer(Solved):
    """What was performed over the motion of a graph shape: how far each node goes from its rest.

    With the base taking a point near a node from rest to the world by B, and the layer taking it within the
    rest by D, the node takes it by B D; of several layers the first is the outermost.

    Attributes:
        take: the id of the stream: where the nodes were, and their linear maps, with the mesh standing as it
            does at rest.
        nodes: (K,) int64 which of the stream's nodes.
        own: (K,) int64 the nodes of the shape that they move.
        rest: (N, 3) metres, the stream's nodes at rest.
        axes, size, mirrored: how the shape's rest was turned, scaled and reflected since: a displacement d
            becomes size axes S d, as of :class:`GraphPart`.
        weight: from 0 to 1, how much of it is played.
        muted: true leaves it out.
        possession: of :class:`Solved`.
        feet: how feet stand by it, of a layer that holds them: see :mod:`enliven.modeling.edits.graph_feet`;
            empty for any other.
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
            what = f"{self.nodes.shape} nodes of {self.rest.shape} move {self.own.shape}"
            raise InputError(what, where=where, mend="Record it again.")
        if not (self.size > 0.0 and 0.0 <= self.weight <= 1.0):
            what = f"it cannot be {self.size} times as large, with a weight of {self.weight}"
            raise InputError(what, where=where, mend="Give a size above 0, and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """What it is called: as its stream."""
        return self.take
