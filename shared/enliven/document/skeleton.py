"""A skeleton: a tree of joints at rest, and the bones between them.

Bone ``j`` is the link from ``parents[j]`` to joint ``j``. It rotates about ``parents[j]``, and moves joint
``j`` and all its descendants. Entry 0 is the root. It has no link, and its rotation rotates the whole
skeleton. So there is one rotation per joint, and two arms at the same chest joint rotate independently, as in
AniMesh.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from enliven.arrays import Float, Int32, frozen
from enliven.errors import InputError

_Array = TypeVar("_Array", bound=np.ndarray[Any, Any])


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints at rest.

    Attributes:
        names: (N,) unique names of the joints.
        parents: (N,) int32 number of each joint's parent. It is -1 for the root (entry 0), and otherwise
            smaller than the joint's own number.
        positions: (N, 3) float64 metres at rest.

    Raises:
        InputError: if the arrays are inconsistent. If joints are only out of order,
            :func:`skeleton_from_links` can sort them.
    """

    names: tuple[str, ...]
    parents: Int32
    positions: Float

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "parents", frozen(self.parents, np.int32))
        object.__setattr__(self, "positions", frozen(self.positions))
        problem = _describe_problem(self)
        if problem:
            raise InputError(
                problem,
                where="skeleton",
                remedy="Build the skeleton with skeleton_from_links, or repair the file.",
            )

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def vectors(self) -> Float:
        """(N, 3) vectors from each joint's parent to the joint at rest, metres. The root's vector is zero."""
        parents = np.maximum(self.parents, 0)
        return frozen(np.where(self.parents[:, None] < 0, 0.0, self.positions - self.positions[parents]))

    @cached_property
    def lengths(self) -> Float:
        """(N,) lengths of the bones, metres. The root's length is zero."""
        return frozen(np.linalg.norm(self.vectors, axis=1))

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """The child joints of each joint, in ascending order."""
        below: list[list[int]] = [[] for _ in self.names]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                below[parent].append(joint)
        return tuple(tuple(joints) for joints in below)

    def index(self, name: str) -> int:
        """Returns the number of a joint.

        Raises:
            InputError: if the name does not exist. The message lists the existing names.
        """
        if name not in self.names:
            first_names = ", ".join(self.names[:12]) + (", ..." if len(self.names) > 12 else "")
            raise InputError(
                f"the skeleton has no joint {name!r}",
                where="skeleton",
                remedy=f"Known joints: {first_names}.",
            )
        return self.names.index(name)

    def list_subtree(self, joint: int) -> tuple[int, ...]:
        """Returns the joint and all its descendants, ascending."""
        inside = {joint}
        for other in range(joint + 1, len(self)):
            if int(self.parents[other]) in inside:
                inside.add(other)
        return tuple(sorted(inside))

    def path(self, start: int, end: int) -> tuple[int, ...]:
        """Returns the joints on the path from ``start`` to ``end``, both included: up to their common
        ancestor, then down.
        """
        path_up = self._to_root(start)
        path_down = self._to_root(end)
        meeting = next(joint for joint in path_up if joint in set(path_down))
        return (*path_up[: path_up.index(meeting) + 1], *reversed(path_down[: path_down.index(meeting)]))

    def _to_root(self, joint: int) -> list[int]:
        chain = [joint]
        while self.parents[chain[-1]] >= 0:
            chain.append(int(self.parents[chain[-1]]))
        return chain


def skeleton_from_links(
    names: Sequence[str],
    links: Iterable[tuple[int, int]],
    positions: Float | Sequence[Sequence[float]],
    root: int | None = None,
) -> tuple[Skeleton, tuple[int, ...]]:
    """Builds a skeleton from joints and links in any order and direction.

    Args:
        links: pairs of joints.
        positions: (N, 3) metres at rest.
        root: the joint that becomes the root. None means joint 0.

    Returns:
        The skeleton, and for each of its joints the old number.

    Raises:
        InputError: if the links form a cycle or leave joints unconnected. The message names these joints.
    """
    where = "skeleton"
    if not names:
        raise InputError("the skeleton has no joints", where=where, remedy="Pass at least one joint.")
    neighbours: list[list[int]] = [[] for _ in names]
    for a, b in links:
        if not (0 <= a < len(names) and 0 <= b < len(names)):
            raise InputError(
                f"a link refers to the joints {a} and {b}, but only {len(names)} joints exist", where=where
            )
        neighbours[a].append(b)
        neighbours[b].append(a)
    order, parents = _depth_first_order(names, neighbours, root or 0)
    unlinked = [name for i, name in enumerate(names) if i not in parents]
    if unlinked:
        advice = "Link these joints to the skeleton, or load them as a separate shape."
        raise InputError(
            f"these joints are not linked to the root: {', '.join(unlinked)}", where=where, remedy=advice
        )
    number = {old: new for new, old in enumerate(order)}
    parent_numbers = [-1 if parents[old] < 0 else number[parents[old]] for old in order]
    ordered_positions = np.array(positions, np.float64)[order]
    return Skeleton(
        tuple(names[i] for i in order), np.array(parent_numbers, np.int32), ordered_positions
    ), tuple(order)


def _depth_first_order(
    names: Sequence[str], neighbours: list[list[int]], root: int
) -> tuple[list[int], dict[int, int]]:
    """Returns the joints in depth-first order from the root, and the parent of each joint. Raises InputError
    if there is a cycle."""
    order, parents, waiting = [], {root: -1}, [root]
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        fresh = list(neighbours[joint])
        if parents[joint] >= 0:
            fresh.remove(parents[joint])
        for other in reversed(fresh):
            if other in parents:
                cycle = _find_cycle(parents, joint, other)
                cycle_names = ", ".join(names[i] for i in cycle)
                advice = "Remove one of the links, because a skeleton must be a tree."
                raise InputError(f"these joints form a cycle: {cycle_names}", where="skeleton", remedy=advice)
            parents[other] = joint
            waiting.append(other)
    return order, parents


def _find_cycle(parents: dict[int, int], joint: int, other: int) -> list[int]:
    """Returns the joints of the cycle that a link from ``joint`` to ``other`` closes."""
    chains = []
    for end in (joint, other):
        chain = [end]
        while parents[chain[-1]] >= 0:
            chain.append(parents[chain[-1]])
        chains.append(chain)
    meeting = next(i for i in chains[0] if i in set(chains[1]))
    return [*chains[0][: chains[0].index(meeting) + 1], *reversed(chains[1][: chains[1].index(meeting)])]


def _describe_problem(skeleton: Skeleton) -> str:
    count = len(skeleton.names)
    if count == 0:
        return "the skeleton has no joints"
    if skeleton.parents.shape != (count,) or skeleton.positions.shape != (count, 3):
        return (
            f"the arrays of the skeleton do not match: {count} names, parents "
            f"{skeleton.parents.shape}, positions {skeleton.positions.shape}"
        )
    if len(set(skeleton.names)) != count:
        twice = sorted({name for name in skeleton.names if skeleton.names.count(name) > 1})
        return f"these joint names occur more than once: {', '.join(twice[:5])}"
    if skeleton.parents[0] != -1 or (skeleton.parents[1:] < 0).any():
        return "joint 0 must be the only root (parent -1)"
    misplaced = np.flatnonzero(skeleton.parents >= np.arange(count))
    if len(misplaced):
        return f"joint {skeleton.names[misplaced[0]]!r} is listed before its parent"
    if not np.isfinite(skeleton.positions).all():
        bad_joint = int(np.flatnonzero(~np.isfinite(skeleton.positions).all(1))[0])
        return f"the position of joint {skeleton.names[bad_joint]!r} is not a finite number"
    return ""
