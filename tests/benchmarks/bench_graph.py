"""The deformation graph: limbs that it joins, against the plain graph of Sumner et al., and what it costs."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import graph_figures
from figure import Figure

from enliven.deformation.graph.graph import DeformationGraph

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS / "real"))

from joined_limbs import CASES, Limbs, detours, load, plain_graph, plain_skin  # noqa: E402

DATA = Path(os.environ.get("ENLIVEN_DATA", TESTS.parents[1] / "shared" / "data"))
SHELLS = {"house_interior_pack_Chair_1.glb"}
"""Of several shells, over which no geodesic leads: the second judge alone."""
NODES = (64, 128, 256)


def figures() -> Iterator[Figure]:
    """Costs always; limbs where the real meshes are."""
    yield from graph_figures.figures()
    if (DATA / "meshes").is_dir():
        yield from _limbs()


def _limbs() -> Iterator[Figure]:
    """Sums over seven meshes and three sizes of graph; a peer that is as good has ratio 1."""
    ours, plain = [0, 0, 0], [0, 0, 0]
    for case in CASES:
        mesh = load(DATA, case)
        limbs = Limbs.of(mesh, case)
        for nodes in NODES:
            graph, other = DeformationGraph.build(mesh, nodes), plain_graph(mesh, nodes)
            for sums, one, skin in (
                (ours, graph, graph.skin(mesh)),
                (plain, other, plain_skin(mesh, other)),
            ):
                sums[0] += limbs.joined(one.positions, one.edges)
                sums[1] += 0 if case.name in SHELLS else detours(mesh, one.positions, one.edges)
                sums[2] += limbs.misled(one.positions, skin)
    told = ("edges", "edges", "vertices")
    for name, mine, other, unit in zip(("joined_legs", "detours", "misled"), ours, plain, told, strict=True):
        yield Figure(
            f"graph.{name}", mine, unit, f"Euclidean 4-NN's {other}", max(other, 1e-9) / max(mine, 1)
        )
