"""No edge and hardly a weight leads from one limb of a real mesh to another, as two judges see it."""

import os
import sys
from pathlib import Path

import pytest

from enliven.deformation.graph.graph import DeformationGraph

sys.path.insert(0, str(Path(__file__).parent))

from joined_limbs import CASES, Limbs, detours, load, plain_graph, plain_skin

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
SHELLS = {"house_interior_pack_Chair_1.glb"}
"""Of several shells: no way along its own edges leads from one to another, so the first judge is blind."""

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
    # At the last: what follows another limb lies where the limbs meet.
    misled = limbs.misled(graph.positions, graph.skin(mesh))
    assert misled < 0.01 * (limbs.of_vertex >= 0).sum()


def test_the_plain_graph_joins_them():
    """The guard of the test above: the Euclidean sampling and its four nearest do join, by both judges."""
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
