"""Measures how often the deformation graph connects separate limbs, compared with the plain graph of Sumner
et al., and its cost.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import graph_figures
from data_needs import MESHES, RIGS
from figure import Figure

from enliven.deformation.graph.graph import DeformationGraph

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS / "real"))

from joined_limbs import CASES, Limbs, detours, load, plain_graph, plain_skin  # noqa: E402

DATA = Path(os.environ.get("ENLIVEN_DATA", TESTS.parents[1] / "shared" / "data"))
SHELLS = {"house_interior_pack_Chair_1.glb"}
"""Meshes of several shells without surface paths between them, so that only the second criterion applies."""
NODES = (64, 128, 256)


def figures() -> Iterator[Figure]:
    """Yields the cost, and the limb figures if the real meshes exist."""
    yield from graph_figures.figures()
    if not (MESHES.is_missing or RIGS.is_missing):
        yield from _limbs()


def _limbs() -> Iterator[Figure]:
    """Yields sums over seven meshes and three graph sizes. A peer of the same quality has ratio 1."""
    ours, plain = [0, 0, 0], [0, 0, 0]
    for case in CASES:
        mesh = load(DATA, case)
        limbs = Limbs.of(mesh, case)
        for nodes in NODES:
            graph, other = DeformationGraph.build(mesh, nodes), plain_graph(mesh, nodes)
            for sums, built, skin in (
                (ours, graph, graph.skin(mesh)),
                (plain, other, plain_skin(mesh, other)),
            ):
                sums[0] += limbs.joined(built.positions, built.edges)
                sums[1] += 0 if case.name in SHELLS else detours(mesh, built.positions, built.edges)
                sums[2] += limbs.misled(built.positions, skin)
    units = ("edges", "edges", "vertices")
    for name, mine, other, unit in zip(("joined_legs", "detours", "misled"), ours, plain, units, strict=True):
        yield Figure(
            f"graph.{name}", mine, unit, f"Euclidean 4-NN's {other}", max(other, 1e-9) / max(mine, 1)
        )
