"""Measures ranking all matches of two arms with a target, once per frame. The target is abstracted
beforehand.

The peer enumerates with networkx, and also caches the target's abstraction. The results are compared. Targets
are random trees that resemble rigs: limbs of one to six joints, with other limbs branching off their joints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import networkx as nx
import numpy as np
import plain_matching
from figure import Figure

from enliven.matching.abstraction import make_abstract_joint_tree
from enliven.matching.ranking import Matcher, RankingSettings
from enliven.matching.views import ScreenView

SIZES = (20, 200, 2000)
REPEATS = 200
BLUR = RankingSettings().blur


def figures() -> Iterator[Figure]:
    """Yields milliseconds per ranking, and the one-time preparation."""
    source = np.array([[0.0, 1.4, 0.0], [0.3, 1.5, 0.1], [-0.3, 1.3, 0.1]])
    view = ScreenView(np.array([0.3, -0.2, -1.0]))
    for joints in SIZES:
        positions, links = rig(joints, np.random.default_rng(joints))
        prepared = _milliseconds(lambda p=positions, ls=links: Matcher(make_abstract_joint_tree(p, ls), p), 5)
        matcher = Matcher(
            make_abstract_joint_tree(positions, links), positions, settings=RankingSettings(most=100_000)
        )
        graph = nx.Graph()
        graph.add_nodes_from((joint, {"pos": point}) for joint, point in enumerate(positions))
        graph.add_edges_from(
            (a, b, {"length": float(np.linalg.norm(positions[a] - positions[b]))}) for a, b in links
        )
        candidates = plain_matching.candidates(graph)
        _is_same(matcher, source, view, plain_matching.rank_choices(candidates, source, view.axes, BLUR))
        ours = _milliseconds(lambda m=matcher: m.rank(source, view), REPEATS)
        plain = _milliseconds(lambda f=candidates: plain_matching.rank_choices(f, source, view.axes, BLUR), 5)
        yield Figure(f"matching.rank_ms_{joints}", ours, "ms", "plain networkx", plain / ours)
        yield Figure(f"matching.prepare_ms_{joints}", prepared, "ms")


def rig(joints: int, rng: np.random.Generator) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Returns (N, 3) positions and links. Limbs of one to six joints are added at random joints until there
    are N."""
    points, links = [np.zeros(3)], []
    while len(points) < joints:
        start = int(rng.integers(len(points)))
        direction = rng.normal(size=3)
        for _ in range(min(int(rng.integers(1, 7)), joints - len(points))):
            direction = direction + 0.3 * rng.normal(size=3)
            links.append((start, len(points)))
            points.append(points[start] + 0.1 * direction)
            start = len(points) - 1
    return np.array(points), links


def _is_same(
    matcher: Matcher, source: np.ndarray, view: ScreenView, expected: list[tuple[float, int]]
) -> None:
    """Raises an error if the results differ, so that only equal results are timed."""
    whole = [m for m in matcher.rank(source, view) if None not in m.pairs]
    np.testing.assert_allclose([m.score for m in whole], [score for score, _ in expected], atol=1e-9)
    ours = sorted((round(m.score, 6), m.candidate.root) for m in whole)
    if ours != sorted((round(score, 6), root) for score, root in expected):
        raise AssertionError("the peer finds other matches")


def _milliseconds(act: Callable[[], object], repeats: int) -> float:
    act()
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        act()
        best = min(best, time.perf_counter() - start)
    return float(best) * 1e3
