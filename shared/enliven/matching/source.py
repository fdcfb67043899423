"""The source of a match: the performer's skeleton, or a part of it, as a root and m branches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.matching.abstraction import make_abstract_joint_tree
from enliven.matching.subtrees import Branch


@dataclass(frozen=True, eq=False)
class MatchSource:
    """A performer's skeleton, simplified in a single step to the branches of one joint (AniMesh, Figure 3b).

    Each branch is abstracted as in the target. Its position is a weighted average of joints, with weights
    computed once from the bones' lengths.

    Attributes:
        root: the joint at which the branches begin.
        branches: the branches, with the joint numbers of the whole skeleton.
        weights: (m, N) the weight of each joint in each branch's abstract position.
    """

    root: int
    branches: tuple[Branch, ...]
    weights: Float

    @property
    def chains(self) -> tuple[tuple[int, ...], ...]:
        """The joints of each branch, from the root along the longest path to a leaf."""
        return tuple(branch.extended for branch in self.branches)

    def points(self, positions: Float) -> Float:
        """Returns the root and the abstract positions (m + 1, 3) in metres, for joints at ``positions``
        (N, 3) in any pose."""
        positions = np.asarray(positions, np.float64)
        return np.concatenate([positions[None, self.root], self.weights @ positions])


def match_source_from_joints(
    positions: Float, links: Iterable[tuple[int, int]], root: int | None = None, joints: Iterable[int] = ()
) -> MatchSource:
    """Builds the source from a tree of joints, or from a connected subset of them.

    Args:
        positions: (N, 3) metres. Only the lengths of the bones are used.
        links: pairs of joints.
        root: the joint at which the branches begin. If None, the abstraction determines it.
        joints: the subset, which must be connected. Empty means all joints.

    Raises:
        InputError: if the joints are not connected, or form no bone.
    """
    joint_positions = np.array(positions, np.float64).reshape(-1, 3)
    used_joints = sorted(set(joints)) or list(range(len(joint_positions)))
    number = {joint: i for i, joint in enumerate(used_joints)}
    if root is not None and root not in number:
        problem = f"the root joint {root} is not one of the selected joints"
        raise InputError(problem, where="source", remedy="Choose one of the selected joints as the root.")
    pairs = [(number[a], number[b]) for a, b in links if a in number and b in number]
    names = [f"joint {joint}" for joint in used_joints]
    abstraction = make_abstract_joint_tree(
        joint_positions[used_joints], pairs, None if root is None else number[root], names
    )
    if root is None:
        abstraction = make_abstract_joint_tree(joint_positions[used_joints], pairs, abstraction.root, names)
    if not abstraction.candidates:
        raise InputError(
            "the selected joints form no bone", where="source", remedy="Choose two or more joints."
        )
    branches = tuple(_renumber_branch(branch, used_joints) for branch in abstraction.candidates[-1].branches)
    weights = np.zeros((len(branches), len(joint_positions)))
    for row, branch in zip(weights, branches, strict=True):
        row[list(branch.weights)] = list(branch.weights.values())
    return MatchSource(used_joints[abstraction.root], branches, weights)


def source_of_skeleton(skeleton: Skeleton, root: int | None = 0, joints: Iterable[int] = ()) -> MatchSource:
    """Builds the source from a skeleton at rest."""
    links = [(int(parent), joint) for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    return match_source_from_joints(skeleton.positions, links, root, joints)


def _renumber_branch(branch: Branch, joints: Sequence[int]) -> Branch:
    """Returns the branch with the joint numbers of the whole skeleton."""
    return Branch(
        tuple(joints[j] for j in branch.chain),
        tuple(joints[j] for j in branch.extended),
        {joints[j]: weight for j, weight in branch.weights.items()},
        branch.length,
        branch.reach,
    )
