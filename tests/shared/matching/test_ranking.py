"""Tests of the ranking of matches (AniMesh, section 4.2) against a brute-force reference, and of its
invariants.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from enliven.matching.abstraction import make_abstract_joint_tree
from enliven.matching.assignment import all_choices, assign, best_choices, binomials, solve_assignment
from enliven.matching.ranking import Matcher, RankingSettings
from enliven.matching.source import match_source_from_joints
from enliven.matching.views import ScreenView

sys.path.insert(0, str(Path(__file__).parent))

from trees_for_matching import Drawing, trees

ALL = RankingSettings(most=100_000)
seeds = st.integers(0, 2**32 - 1)


def brute_force(found, positions, source, view, blur=0.2, missing=-1.0):
    """Returns {candidate, chosen branches (or source branches): best sum of cosines}, trying all
    permutations.
    """
    axes = view.axes

    def direction(vector):
        seen = axes @ vector
        return seen / max(np.linalg.norm(seen), blur * np.linalg.norm(vector))

    ours = [direction(point - source[0]) for point in source[1:]]
    scores = {}
    for c, tree in enumerate(found.candidates):
        theirs = [direction(b.position(positions) - positions[tree.root]) for b in tree.branches]
        m, n = len(ours), len(theirs)
        few = min(m, n)
        for rows in itertools.combinations(range(m), few):
            for columns in itertools.combinations(range(n), few):
                best = max(
                    sum(ours[i] @ theirs[j] for i, j in zip(rows, order, strict=True))
                    for order in itertools.permutations(columns)
                )
                scores[c, rows, columns] = best + (m - few) * missing
    return scores


def random_view(seed):
    rng = np.random.default_rng(seed)
    return ScreenView(rng.normal(size=3), rng.normal(size=3))


@given(trees(most=18), st.integers(1, 5), seeds)
@settings(max_examples=60, deadline=None)
def test_equals_brute_force(tree, m, seed):
    positions, links = tree
    abstraction = make_abstract_joint_tree(positions, links)
    source = np.random.default_rng(seed).normal(size=(m + 1, 3))
    view = random_view(seed + 1)
    ranking = Matcher(abstraction, positions, settings=ALL).rank(source, view)
    expected = brute_force(abstraction, positions, source, view)
    assert len(ranking) == ranking.total == len(expected)
    assert (np.diff(ranking.scores) <= 1e-8).all()
    for index, columns, score in zip(ranking.candidate_indices, ranking.columns, ranking.scores, strict=True):
        rows = tuple(np.flatnonzero(columns >= 0))
        assert score == pytest.approx(expected.pop((index, rows, tuple(sorted(columns[columns >= 0])))))
    assert not expected


@given(trees(most=30), st.integers(1, 4), seeds, st.floats(0.01, 100), st.floats(0.01, 100))
@settings(max_examples=60, deadline=None)
def test_neither_place_nor_size_nor_order_of_children_matters(tree, m, seed, scale, other_scale):
    positions, links = tree
    rng = np.random.default_rng(seed)
    source, view = rng.normal(size=(m + 1, 3)), random_view(seed + 1)
    ranking = Matcher(make_abstract_joint_tree(positions, links), positions, settings=ALL).rank(source, view)
    moved = Matcher(
        make_abstract_joint_tree(scale * positions + rng.normal(size=3), links),
        settings=ALL,
        positions=positions,
    )
    again = moved.rank(
        other_scale * source + rng.normal(size=3), view, positions=scale * positions + rng.normal(size=3)
    )
    np.testing.assert_allclose(again.scores, ranking.scores, atol=1e-6)
    names = rng.permutation(len(positions))
    renamed = np.empty_like(positions)
    renamed[names] = positions
    swapped = [(int(names[b]), int(names[a])) for a, b in links]
    shuffled = [swapped[i] for i in rng.permutation(len(links))]
    if len(positions) == 2:
        return  # which end of a single bone is the root is a matter of its number
    by_chain = {match.key: match.score for match in ranking}
    other = {
        match.key: match.score
        for match in Matcher(make_abstract_joint_tree(renamed, shuffled), renamed, settings=ALL).rank(
            source, view
        )
    }
    assert len(other) == len(by_chain)
    for key, score in by_chain.items():
        assert other[tuple(tuple(int(names[j]) for j in chain) for chain in key)] == pytest.approx(score)


@given(trees(), st.integers(1, 4), seeds)
@settings(max_examples=40, deadline=None)
def test_the_order_of_the_sources_branches_only_reorders_the_pairs(tree, m, seed):
    positions, links = tree
    rng = np.random.default_rng(seed)
    source, order = rng.normal(size=(m + 1, 3)), rng.permutation(m)
    matcher = Matcher(make_abstract_joint_tree(positions, links), positions, settings=ALL)
    ranking = matcher.rank(source, ScreenView())
    other = matcher.rank(np.concatenate([source[:1], source[1:][order]]), ScreenView())
    scores = {match.key: match.score for match in ranking}
    assert len(scores) == len(ranking)
    for match in other:
        key = dict(zip(order, match.key, strict=True))
        assert scores[tuple(key[i] for i in range(m))] == pytest.approx(match.score)


gains = st.tuples(st.integers(1, 4), st.integers(0, 4), seeds).map(
    lambda drawn: np.random.default_rng(drawn[2]).uniform(-1, 1, (drawn[0], drawn[0] + drawn[1]))
)


def solved(gain, columns):
    """Returns the best sum over these columns, by SciPy."""
    part = gain[:, columns]
    return part[linear_sum_assignment(part, maximize=True)].sum()


@given(gains)
@settings(max_examples=80, deadline=None)
def test_choices_equal_scipys_assignment(gain):
    m, n = gain.shape
    expected = {c: solved(gain, list(c)) for c in itertools.combinations(range(n), m)}
    scores, picks = np.empty(len(expected)), np.empty((len(expected), m), np.int32)
    for fill in (
        lambda: all_choices(gain, binomials(n), scores, picks),
        lambda: best_choices(gain, scores, picks),
    ):
        fill()
        assert {tuple(sorted(pick)) for pick in picks} == set(expected)
        for score, pick in zip(scores, picks, strict=True):
            assert score == pytest.approx(expected[tuple(sorted(pick))])
            assert score == pytest.approx(gain[np.arange(m), pick].sum())
    assert (np.diff(scores) <= 1e-12).all(), "the best come first"


@given(gains)
@settings(max_examples=40, deadline=None)
def test_assignment_respects_required_and_excluded_pairs(gain):
    m, n = gain.shape
    state = np.zeros(n, np.int8)
    state[n - 1] = 1
    if n > m:
        state[0] = -1
    columns = np.empty(m, np.int32)
    total = assign(gain, state, columns)
    allowed = [c for c in itertools.combinations(range(n), m) if n - 1 in c and (n == m or 0 not in c)]
    assert total == pytest.approx(max(solved(gain, list(c)) for c in allowed))
    assert tuple(sorted(columns)) in allowed


@given(st.integers(0, 6), st.integers(0, 6), seeds, st.sampled_from([0.0, 1e6]))
@settings(max_examples=80, deadline=None)
def test_the_least_cost_is_scipys(m, n, seed, never):
    cost = np.random.default_rng(seed).uniform(0, 3, (m, n))
    cost[cost > 2] += never
    rows, columns = solve_assignment(cost)
    expected = linear_sum_assignment(cost)
    np.testing.assert_array_equal(rows, expected[0])
    assert len(set(columns)) == len(columns) == min(m, n)
    assert cost[rows, columns].sum() == pytest.approx(cost[expected].sum(), rel=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_cost_that_is_not_finite_is_refused(bad):
    with pytest.raises(ValueError, match="not finite"):
        solve_assignment(np.array([[1.0, bad], [2.0, 3.0]]))


def star(arms, seed=0):
    """Returns a tree with arms around its centre, for which a source cannot try every choice."""
    rng = np.random.default_rng(seed)
    positions = np.concatenate([np.zeros((1, 3)), rng.normal(size=(arms, 3))])
    return positions, [(0, i) for i in range(1, arms + 1)]


def test_of_a_sea_urchins_millions_of_choices_the_best_are_the_same():
    positions, links = star(16)
    source = np.random.default_rng(5).normal(size=(6, 3))
    whole = Matcher(make_abstract_joint_tree(positions, links), positions).rank(source, ScreenView())
    few = Matcher(
        make_abstract_joint_tree(positions, links), positions, settings=RankingSettings(exhaustive=1)
    )
    best = few.rank(source, ScreenView())
    assert whole.total == best.total == 4368
    np.testing.assert_allclose(best.scores, whole.scores, atol=1e-12)
    assert [match.key for match in best] == [match.key for match in whole]
    positions, links = star(60)
    ranking = Matcher(make_abstract_joint_tree(positions, links), positions).rank(source, ScreenView())
    assert ranking.total == 5_461_512
    assert len(ranking) == 256
    assert len(np.unique(np.sort(ranking.columns, axis=1), axis=0)) == 256


def test_a_performer_with_more_limbs_than_the_target_still_gets_matches():
    tree = Drawing()
    fork = tree.limb(None, (0.0, 0.0))
    tree.limb(fork, (1.0, 0.0))
    tree.limb(fork, (-1.0, 0.0))
    tree.limb(fork, (0.0, -1.0))
    source = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0.5, -1, 0], [-0.5, -1, 0], [0, 1, 0]], float)
    ranking = Matcher(make_abstract_joint_tree(tree.points, tree.links), np.array(tree.points, float)).rank(
        source, ScreenView()
    )
    assert len(ranking) == len(list(ranking)) == 10
    assert ranking[2:4] == (ranking[2], ranking[3]) and ranking[-1] == list(ranking)[-1]
    with pytest.raises(IndexError):
        ranking[10]
    best = ranking[0]
    assert best.pairs[4] is None
    assert best.pairs[0].chain == (0, 1)
    assert best.score == pytest.approx(2.0 + np.cos(np.arctan(0.5)) - 2.0)


def test_of_equal_matches_the_order_stays():
    tree = Drawing()
    for x in (0.0, 5.0, 10.0):
        fork = tree.limb(None if x == 0.0 else len(tree.points) - 3, (x, 0.0))
        tree.limb(fork, (x + 1.0, 1.0))
        tree.limb(fork, (x - 1.0, 1.0))
    positions = np.array(tree.points)
    matcher = Matcher(make_abstract_joint_tree(positions, tree.links), positions)
    orders = set()
    for seed in range(20):
        noise = 1e-13 * np.random.default_rng(seed).normal(size=positions.shape)
        source = np.array([[0, 0, 0], [1, 1, 0], [-1, 1, 0]], float)
        ranking = matcher.rank(source, ScreenView(), positions=positions + noise)
        orders.add(tuple(match.key for match in ranking if match.score > 2.0 - 1e-6))
    assert len(orders) == 1


def test_a_bone_that_points_at_the_eye_counts_for_nothing():
    tree = Drawing()
    fork = tree.limb(None, (0.0, 0.0))
    tree.limb(fork, (1.0, 0.0))
    tree.limb(fork, (-1.0, 0.0))
    positions = np.array([*tree.points, (1e-9, 0.0, 1.0)])
    abstraction = make_abstract_joint_tree(positions, [*tree.links, (0, 3)])
    source = np.array([[0, 0, 0], [1, 0, 0]], float)
    scores = {
        match.pairs[0].chain[1]: match.score
        for match in Matcher(abstraction, positions).rank(source, ScreenView())
    }
    assert scores[1] == pytest.approx(1.0)
    assert scores[2] == pytest.approx(-1.0)
    assert scores[3] == pytest.approx(0.0, abs=1e-6)


def test_dot_products_let_long_branches_decide():
    tree = Drawing()
    fork = tree.limb(None, (0.0, 0.0))
    tree.limb(fork, (0.1, 0.0))
    tree.limb(fork, (0.6, 0.8))
    tree.limb(fork, (-1.0, 0.0))
    positions = np.array(tree.points)
    source = np.array([[0, 0, 0], [2, 0, 0]], float)

    def best(measure):
        matcher = Matcher(
            make_abstract_joint_tree(positions, tree.links),
            positions,
            settings=RankingSettings(measure=measure),
        )
        return matcher.rank(source, ScreenView())[0]

    assert best("cosine").pairs[0].chain == (0, 1)
    assert best("dot").pairs[0].chain == (0, 2)
    assert best("dot").score == pytest.approx(0.6)


def test_ranking_uses_projected_directions_in_perspective():
    points = np.array([[1, 0, -4], [1, 0, -3], [2, 0, -4], [1, 1, -4]], float)
    source = np.array([[0, 0, 0], [1, 0, 0]], float)
    flat = Matcher(make_abstract_joint_tree(points, [(0, 1), (0, 2), (0, 3)]), points)
    scores = {m.pairs[0].chain[1]: m.score for m in flat.rank(source, ScreenView())}
    assert scores[1] == pytest.approx(0.0, abs=1e-9)
    seen = {
        m.pairs[0].chain[1]: m.score for m in flat.rank(source, ScreenView(eye=np.zeros(3)), ScreenView())
    }
    # From the origin, the bone that comes nearer extends outwards to the right, and a third of it is visible.
    assert seen[1] == pytest.approx(1.0)
    assert seen[2] == pytest.approx(1.0)


def test_a_part_of_a_body_plays_with_its_own_branches():
    tree = Drawing()
    hip = tree.limb(None, (0.0, 1.0))
    neck = tree.limb(hip, (0.0, 1.5))
    left = tree.limb(neck, (0.2, 1.5), (0.5, 1.5), (0.8, 1.5))
    right = tree.limb(neck, (-0.2, 1.5), (-0.5, 1.5), (-0.8, 1.5))
    tree.limb(neck, (0.0, 1.8))
    whole = match_source_from_joints(tree.points, tree.links, neck)
    assert len(whole.branches) == 4
    arms = match_source_from_joints(
        tree.points, tree.links, neck, [neck, *range(2, left + 1), *range(left + 1, right + 1)]
    )
    assert arms.chains == ((1, 2, 3, 4), (1, 5, 6, 7))
    points = arms.points(np.array(tree.points))
    np.testing.assert_allclose(points[0], tree.points[neck])
    # The average of shoulder and elbow, weighted by their outward bones: (0.2 * 0.3 + 0.5 * 0.3) / 0.6.
    np.testing.assert_allclose(points[1], (0.35, 1.5, 0.0))
