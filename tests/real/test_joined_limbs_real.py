"""Tests by two independent checks that no edge and few weights connect limbs of a real mesh."""

import os
import sys
from pathlib import Path

import pytest

from enliven.deformation.graph.graph import DeformationGraph

sys.path.insert(0, str(Path(__file__).parent))

from joined_limbs import CASES, Limbs, detours, load, plain_graph, plain_skin

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
SHELLS = {"house_interior_pack_Chair_1.glb"}
"""Meshes of several shells. No path along edges connects the shells, so the first check does not apply."""

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not (DATA / "meshes").is_dir(), reason=f"no real meshes in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_edge_joins_limbs(case):
    mesh = load(DATA, case)
    limbs = Limbs.of(mesh, case)
    for nodes in (64, 128):
        graph = DeformationGraph.build(mesh, nodes)
        assert limbs.joined(graph.positions, graph.edges) == 0
        assert case.name in SHELLS or detours(mesh, graph.positions, graph.edges) == 0
    # Vertices that follow another limb are only near the junction of both limbs.
    misled = limbs.misled(graph.positions, graph.skin(mesh))
    assert misled < 0.01 * (limbs.of_vertex >= 0).sum()


def test_plain_graph_joins_limbs():
    """Shows that the test above is meaningful: the plain graph does connect limbs by both checks."""
    joined = leaps = misled = 0
    for case in CASES:
        mesh = load(DATA, case)
        limbs, plain = Limbs.of(mesh, case), plain_graph(mesh, 64)
        joined += limbs.joined(plain.positions, plain.edges)
        leaps += detours(mesh, plain.positions, plain.edges) if case.name not in SHELLS else 0
        misled += limbs.misled(plain.positions, plain_skin(mesh, plain))
    assert joined > 10
    assert leaps > 10
    assert misled > 1000
