"""Hard constraints on trajectories (eq. 22, 23), converted to independent ones.

    Position("left foot", frame=10, place=(0, 0, 0.2))            # or axes="y" for its height alone
    Velocity("left foot", frame=11, velocity=(0, 0, 0))           # from the frame before to this one
    Coupling("left foot", "right foot", frame=30, axes="y")       # equal heights: a change of anchor

Each constraint sets one coordinate, or the difference of two, axis by axis. So the coordinates form a forest
with constraints as edges (union-find). If a coordinate is linked to a known value, it becomes known too, and
is eliminated from its node. A constraint that would close a cycle is dropped if it agrees with the others,
and raises an error if it contradicts them. The remaining constraints are independent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import Constraint, Position, Velocity
from enliven.errors import InputError
from enliven.examples.poses import Examples

_AGREEMENT_TOLERANCE = 1e-9
"""Constraints agree if they differ by less than this fraction of the mesh's size."""
_ERROR_PLACE = "constraints"


@dataclass(frozen=True, eq=False)
class Conditions:
    """Independent constraints. The unit of length is the mesh's size.

    Attributes:
        held: (P, F, 3) bool, True for known coordinates.
        values: (P, F, 3) values of the known coordinates; 0 elsewhere.
        first, second: (R, 3) int64 (point, frame, axis) of the two coordinates of each constraint.
        difference: (R,) required value of coordinate ``first`` - coordinate ``second``.
    """

    held: Bool
    values: Float
    first: Int
    second: Int
    difference: Float


def convert_constraints(
    constraints: Sequence[Constraint], examples: Examples, frames: int, step: float
) -> Conditions:
    """Converts constraints to independent conditions.

    Raises:
        InputError: if a point or frame does not exist, a value is not finite, or constraints contradict one
            another. The message names the constraints.
    """
    middle, size = examples.targets.mean(0), examples.target_size
    links = [
        link for constraint in constraints for link in _coordinate_links(constraint, examples, frames, step)
    ]
    forest, rows = _Forest(), []
    for constraint, a, b, value in links:
        added = forest.join(a, b, value, constraint, _AGREEMENT_TOLERANCE * size)
        if added and b is not None:
            rows.append((a, b, value))
    is_known, values = np.zeros((len(middle), frames, 3), np.bool_), np.zeros((len(middle), frames, 3))
    for node in forest.nodes():
        fixed_value = forest.value(node)
        if fixed_value is not None:
            is_known[node] = True
            values[node] = (fixed_value - middle[node[0], node[2]]) / size
    rows = [row for row in rows if not is_known[row[0]]]
    first = np.array([a for a, _, _ in rows], np.int64).reshape(-1, 3)
    second = np.array([b for _, b, _ in rows], np.int64).reshape(-1, 3)
    shift = middle[second[:, 0], second[:, 2]] - middle[first[:, 0], first[:, 2]]
    difference = (np.array([value for _, _, value in rows]) + shift) / size
    return Conditions(is_known, values, first, second, difference)


_Node = tuple[int, int, int]
_Link = tuple[Constraint, _Node, _Node | None, float]


def _coordinate_links(one: Constraint, examples: Examples, frames: int, step: float) -> Iterator[_Link]:
    """Splits a constraint into one link per coordinate. A link (constraint, a, b, value) means a - b = value,
    or a = value if b is None.
    """
    _check_constraint(one, frames)
    p, f = examples.find_point(one.point), one.frame
    for axis in ("xyz".index(letter) for letter in one.axes):
        if isinstance(one, Position):
            yield one, (p, f, axis), None, float(one.place[axis])
        elif isinstance(one, Velocity):
            yield one, (p, f, axis), (p, f - 1, axis), float(one.velocity[axis]) * step
        else:
            other = examples.find_point(one.other)
            if other == p:
                raise InputError(
                    f"{one} couples a point with itself",
                    where=_ERROR_PLACE,
                    remedy="Choose two different control points.",
                )
            yield one, (p, f, axis), (other, f, axis), float(one.apart[axis])


def _check_constraint(one: Constraint, frames: int) -> None:
    first = 1 if isinstance(one, Velocity) else 0
    if not first <= one.frame < frames:
        advice = f"Choose a frame from {first} to {frames - 1}."
        raise InputError(f"{one} is outside the motion's frames", where=_ERROR_PLACE, remedy=advice)
    if not one.axes or set(one.axes) - set("xyz"):
        raise InputError(
            f"{one} has the invalid axes {one.axes!r}",
            where=_ERROR_PLACE,
            remedy='Use one or more of "x", "y" and "z".',
        )
    numbers = (
        one.place if isinstance(one, Position) else one.velocity if isinstance(one, Velocity) else one.apart
    )
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise InputError(
            f"{one} has the invalid value {numbers}", where=_ERROR_PLACE, remedy="Use three finite numbers."
        )


class _Forest:
    """A union-find forest of coordinates with known differences. The node None is the ground and has the
    value 0.
    """

    def __init__(self) -> None:
        self._above: dict[_Node | None, tuple[_Node | None, float]] = {None: (None, 0.0)}
        self._beside: dict[_Node | None, list[tuple[_Node | None, Constraint]]] = {}

    def nodes(self) -> list[_Node]:
        """Returns all coordinates that occur in a constraint."""
        return [node for node in self._above if node is not None]

    def join(self, a: _Node | None, b: _Node | None, value: float, why: Constraint, close: float) -> bool:
        """Adds the constraint a - b = value. Returns False if it already follows from earlier constraints."""
        (root_a, of_a), (root_b, of_b) = self._root_of(a), self._root_of(b)
        if root_a == root_b:
            if abs(of_a - of_b - value) > close:
                contradicted = ", ".join(
                    str(constraint) for constraint in self._find_connecting_constraints(a, b)[:4]
                )
                advice = "Remove or change one of these constraints."
                raise InputError(f"{why} contradicts {contradicted}", where=_ERROR_PLACE, remedy=advice)
            return False
        # If one of the roots is the ground (None), keep it as the root, so that values remain absolute.
        # ``of_x`` is x minus its root.
        if root_a is None:
            self._above[root_b] = (root_a, of_a - of_b - value)
        else:
            self._above[root_a] = (root_b, value + of_b - of_a)
        self._beside.setdefault(a, []).append((b, why))
        self._beside.setdefault(b, []).append((a, why))
        return True

    def value(self, node: _Node) -> float | None:
        """Returns the value of a coordinate, or None if it is unknown."""
        root, value = self._root_of(node)
        return value if root is None else None

    def _root_of(self, node: _Node | None) -> tuple[_Node | None, float]:
        """Returns the root of a coordinate, and the coordinate minus its root. Compresses the path."""
        self._above.setdefault(node, (node, 0.0))
        path_nodes, root = [], node
        while self._above[root][0] != root:
            path_nodes.append(root)
            root = self._above[root][0]
        total = 0.0
        for passed in reversed(path_nodes):
            total += self._above[passed][1]
            self._above[passed] = (root, total)
        return root, total

    def _find_connecting_constraints(self, a: _Node | None, b: _Node | None) -> list[Constraint]:
        """Returns the constraints that connect a to b."""
        came: dict[_Node | None, tuple[_Node | None, Constraint] | None] = {a: None}
        waiting = [a]
        while waiting:
            node = waiting.pop(0)
            for neighbour, why in self._beside.get(node, []):
                if neighbour not in came:
                    came[neighbour] = (node, why)
                    waiting.append(neighbour)
        constraints, link = [], came.get(b)
        while link is not None:
            constraints.append(link[1])
            link = came[link[0]]
        return list(dict.fromkeys(constraints))
