"""Tests of the hierarchy of sub-trees (AniMesh, section 4.1)."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.matching.abstraction import make_abstract_joint_tree, make_abstract_skeleton
from enliven.matching.ranking import Matcher
from enliven.matching.source import match_source_from_joints
from enliven.matching.views import ScreenView

sys.path.insert(0, str(Path(__file__).parent))

from literal_abstraction import literal_candidates
from trees_for_matching import Drawing, figure_three, trees


def test_figure_3_of_the_paper_is_reproduced():
    positions, links, named = figure_three()
    abstraction = make_abstract_joint_tree(positions, links)
    assert abstraction.root == named["root"]
    assert [(tree.name, tree.root) for tree in abstraction.candidates] == [
        ("1-1", named["1-1"]),
        ("1-2", named["1-2"]),
        ("2-1", named["p"]),
        ("2-2", named["q"]),
    ]
    arms = Drawing()
    chest = arms.limb(None, (0.0, 1.4))
    arms.limb(chest, (-0.2, 1.4), (-0.5, 1.5), (-0.7, 1.7), (-0.75, 1.75))
    arms.limb(chest, (0.2, 1.4), (0.5, 1.5), (0.7, 1.7), (0.75, 1.75))
    source = match_source_from_joints(arms.points, arms.links)
    assert source.root == chest
    assert len(source.branches) == 2
    ranking = Matcher(abstraction, positions).rank(source.points(np.array(arms.points)), ScreenView())
    assert len(ranking) == ranking.total == 16
    assert (
        sorted(match.candidate.name for match in ranking) == ["1-1"] * 3 + ["1-2"] + ["2-1"] * 6 + ["2-2"] * 6
    )
    # Arms stretched out to the sides look like the two limbs of 1-2, which have this shape.
    assert ranking[0].candidate.name == "1-2"
    assert ranking[0].score == pytest.approx(2.0, abs=0.1)


def test_only_one_set_of_branch_counts_gives_the_papers_sixteen():
    pairs = {n: n * (n - 1) // 2 for n in range(2, 8)}
    sets = [c for c in itertools.combinations_with_replacement(pairs, 4) if sum(pairs[n] for n in c) == 16]
    assert sets == [(2, 3, 4, 4)]


@given(trees(), st.booleans(), st.integers(0, 23))
@settings(max_examples=150, deadline=None)
def test_equals_the_text_word_for_word(tree, rooted, root):
    positions, links = tree
    root = root % len(positions) if rooted else None
    abstraction = make_abstract_joint_tree(positions, links, root)
    expected_root, levels = literal_candidates(positions, links, root)
    if not levels:  # no branch node at all: one candidate, at the root
        (only,) = abstraction.candidates
        assert only.root == abstraction.root
    if len(positions) > 2:  # the ends of a single bone are equally near to its middle
        assert abstraction.root == expected_root
    for level, expected in enumerate(levels, 1):
        at_level = [tree for tree in abstraction.candidates if tree.level == level]
        assert [tree.root for tree in at_level] == sorted(expected)
        assert [tree.number for tree in at_level] == list(range(1, len(at_level) + 1))
        for tree in at_level:
            branches = expected[tree.root]
            assert [branch.chain[1] for branch in tree.branches] == sorted(branches)
            for branch in tree.branches:
                at, length = branches[branch.chain[1]]
                np.testing.assert_allclose(branch.position(positions), at, atol=1e-12)
                assert branch.length == pytest.approx(length)
    assert max(tree.level for tree in abstraction.candidates) == max(len(levels), 1)


@given(trees(), st.booleans())
@settings(max_examples=100, deadline=None)
def test_chains_are_real_and_lengths_are_of_all_bones(tree, rooted):
    positions, links = tree
    linked = {frozenset(link) for link in links}
    for candidate in make_abstract_joint_tree(positions, links, 0 if rooted else None).candidates:
        covered = set()
        for branch in candidate.branches:
            for chain in (branch.chain, branch.extended):
                assert chain[0] == candidate.root
                assert all(frozenset(pair) in linked for pair in itertools.pairwise(chain))
            assert branch.extended[: len(branch.chain)] == branch.chain
            bones = hanging(links, candidate.root, branch.chain[1])
            assert not covered & bones
            covered |= bones
            assert branch.length == pytest.approx(
                sum(np.linalg.norm(positions[a] - positions[b]) for a, b in bones)
            )
            assert sum(branch.weights.values()) == pytest.approx(1.0)
            assert branch.reach == pytest.approx(longest(positions, links, candidate.root, branch.chain[1]))


def hanging(links, root, first):
    """Returns the bones beyond the link from ``root`` to ``first``, including that link."""
    near = {}
    for a, b in links:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    bones, waiting = set(), [(root, first)]
    while waiting:
        above, joint = waiting.pop()
        bones.add((min(above, joint), max(above, joint)))
        waiting += [(joint, other) for other in near[joint] if other != above]
    return bones


def longest(positions, links, above, joint):
    """Returns the length in metres of the longest path from ``above`` over ``joint`` to a leaf."""
    near = [b if a == joint else a for a, b in links if joint in (a, b)]
    beyond = [longest(positions, links, joint, other) for other in near if other != above]
    return np.linalg.norm(positions[above] - positions[joint]) + max(beyond, default=0.0)


def test_a_given_root_never_becomes_a_leaf():
    positions, links, named = figure_three()
    abstraction = make_abstract_joint_tree(positions, links, named["root"])
    assert [tree.name for tree in abstraction.candidates] == ["1-1", "1-2", "2-1", "2-2", "3-1"]
    assert abstraction.candidates[-1].root == named["root"]
    inside = {j for tree in abstraction.candidates[:-1] for b in tree.branches for j in b.chain}
    assert named["root"] not in inside


def test_a_star_is_a_candidate_and_its_middle_the_root():
    tree = Drawing()
    middle = tree.limb(None, (0.0, 0.0))
    for angle in np.arange(8) * np.pi / 4:
        tree.limb(middle, *(np.array([np.cos(angle), np.sin(angle)]) * r for r in (1.0, 2.0, 3.0)))
    abstraction = make_abstract_joint_tree(tree.points, tree.links)
    assert abstraction.root == middle
    (star,) = abstraction.candidates
    assert len(star.branches) == 8


def test_a_snake_without_a_branch_node_is_one_candidate():
    points = [(x, 0.0, 0.0) for x in range(7)]
    links = [(i, i + 1) for i in range(6)]
    abstraction = make_abstract_joint_tree(points, links)
    assert abstraction.root == 3
    (only,) = abstraction.candidates
    assert [branch.chain for branch in only.branches] == [(3, 2, 1, 0), (3, 4, 5, 6)]
    assert [b.chain for b in make_abstract_joint_tree(points, links, 0).candidates[0].branches] == [
        (0, 1, 2, 3, 4, 5, 6)
    ]


def test_bones_of_zero_length_are_tolerated():
    points = np.zeros((6, 3))
    links = [(0, 1), (1, 2), (2, 3), (1, 4), (4, 5)]
    for candidate in make_abstract_joint_tree(points, links).candidates:
        for branch in candidate.branches:
            assert np.isfinite(branch.position(points)).all()
            assert sum(branch.weights.values()) == pytest.approx(1.0)


def test_a_skeleton_is_rooted_where_it_says():
    positions, links, _named = figure_three()
    parents = np.full(len(positions), -1)
    for a, b in links:
        parents[b] = a
    skeleton = Skeleton(tuple(f"j{i}" for i in range(len(positions))), parents, positions)
    assert make_abstract_skeleton(skeleton).root == 0
    assert make_abstract_skeleton(skeleton, None) == make_abstract_joint_tree(positions, links)


def test_one_joint_has_no_candidate():
    assert make_abstract_joint_tree([(0.0, 0.0, 0.0)], []).candidates == ()


@pytest.mark.parametrize(
    ("links", "told"),
    [
        ([(0, 1), (1, 2), (2, 0), (2, 3)], "cycle: .*(?=.*hip)(?=.*knee)(?=.*toe)"),
        ([(0, 1), (2, 3)], "not linked to the root: toe, tail"),
    ],
)
def test_non_tree_error_names_joints(links, told):
    with pytest.raises(InputError, match=told.split(":")[0]) as caught:
        make_abstract_joint_tree(np.eye(4, 3), links, names=["hip", "knee", "toe", "tail"])
    if "cycle" in told:
        assert all(name in str(caught.value) for name in ("hip", "knee", "toe"))
        assert "tail" not in str(caught.value)
    else:
        assert "toe, tail" in str(caught.value)


def test_missing_root_is_refused():
    with pytest.raises(InputError, match="joint 7 does not exist"):
        make_abstract_joint_tree(np.eye(3), [(0, 1), (1, 2)], 7)
