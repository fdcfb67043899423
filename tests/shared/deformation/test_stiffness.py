"""Tests of spots with higher or lower stiffness."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver
from enliven.deformation.graph.connectivity import find_weak_edges
from enliven.deformation.graph.graph import DeformationGraph
from enliven.deformation.graph.stiffness import compute_painted_stiffness, stiffness_at
from enliven.document import Character, SkinWeights
from enliven.errors import InputError

laws = settings(deadline=None, max_examples=8)
SEEDS = st.integers(0, 2**32 - 1)
EXACT = {"iterations": 3000, "tolerance": 1e-13}


@dataclass
class Points:
    points: np.ndarray
    node_indices: np.ndarray
    node_weights: np.ndarray


def test_no_spots_give_no_stiffness():
    assert stiffness_at(np.zeros((3, 3)), ()) is None


@given(st.floats(0.01, 100.0), st.floats(0.05, 3.0), st.integers(0, 2**32 - 1))
def test_a_spot_has_its_factor_in_the_middle_and_ends_at_its_radius(factor, radius, seed):
    rng = np.random.default_rng(seed)
    middle = rng.normal(size=3)
    ways = rng.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    far = np.sort(rng.random(50)) * 2 * radius
    out = stiffness_at(np.vstack([middle, middle + ways * far[:, None]]), ((*middle, radius, factor),))
    assert out[0] == pytest.approx(factor)
    np.testing.assert_allclose(out[1:][far >= radius], 1.0)
    # It only ever eases towards 1 on the way out.
    assert (np.diff(np.abs(np.log(out))) <= 1e-9).all()


def test_spots_that_overlap_multiply():
    here = np.zeros((1, 3))
    both = stiffness_at(here, ((0, 0, 0, 1, 4.0), (0, 0, 0, 2, 0.5)))
    assert both[0] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "spot", [(0, 0, 0, 0, 2), (0, 0, 0, 1, 0), (0, 0, np.nan, 1, 2), (0, 0, 0, 1, np.inf)]
)
def test_a_spot_that_makes_no_sense_is_refused(spot):
    with pytest.raises(InputError, match="spot 1"):
        stiffness_at(np.zeros((2, 3)), (spot,))


def made_character(seed, stiffness):
    rng = np.random.default_rng(seed)
    weights = rng.random((60, 4)).astype(np.float32)
    weights /= weights.sum(1, keepdims=True)
    skin = SkinWeights(rng.integers(0, 8, (60, 4)).astype(np.uint16), weights)
    places, pivots = (rng.random((n, 3)).astype(np.float32) for n in (60, 9))
    faces, edges = np.arange(60, dtype=np.int32).reshape(20, 3), np.zeros((0, 2), np.int32)
    return Character("one", places, faces, skin, pivots, edges, stiffness=stiffness)


@given(st.integers(0, 2**32 - 1))
def test_paint_is_the_mean_of_a_nodes_vertices_and_even_paint_is_itself(seed):
    rng = np.random.default_rng(seed)
    assert compute_painted_stiffness(made_character(seed, None)) is None
    plain = compute_painted_stiffness(made_character(seed, np.ones(60, np.float32)))
    np.testing.assert_array_equal(plain, np.ones(9))
    painted = np.exp2(rng.uniform(-4, 4, 60)).astype(np.float32)
    character = made_character(seed, painted)
    stiffness = compute_painted_stiffness(character)
    for node in range(9):
        weights = (character.skin.weights * (character.skin.indices == node)).sum(1)
        mean = np.average(np.log(painted), weights=weights) if weights.any() else 0.0
        assert stiffness[node] == pytest.approx(np.exp(mean), rel=1e-5)
    assert painted.min() * 0.999 <= stiffness[:8].min() and stiffness.max() <= painted.max() * 1.001
    np.testing.assert_allclose(
        compute_painted_stiffness(made_character(seed, 2 * painted))[:8], 2 * stiffness[:8], rtol=1e-5
    )


@pytest.mark.parametrize(
    "wrong", [np.ones(3, np.float32), np.zeros(60, np.float32), np.full(60, np.nan, np.float32)]
)
def test_paint_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(InputError, match="stiffness"):
        made_character(0, wrong)


def bent_ladder(seed):
    """Returns a graph of two rows of nodes, with the first four held and the last four pulled: graph, points,
    targets.
    """
    rng = np.random.default_rng(seed)
    rows = np.stack([np.repeat(np.linspace(0, 1, 10), 2), np.tile([0.0, 0.1], 10), np.zeros(20)], 1)
    positions = rows + 0.01 * rng.normal(size=rows.shape)
    edges = np.array([[i, j] for i in range(20) for j in (i + 1, i + 2, i + 3) if j < 20], np.int32)
    bridges, cuts, hanging = find_weak_edges(20, edges)
    normals, faces = np.tile([0.0, 0.0, 1.0], (20, 1)), np.zeros(20, np.int32)
    graph = DeformationGraph(positions, normals, faces, edges, hanging, bridges, cuts, 0.1)
    held = np.array([0, 1, 2, 3, 16, 17, 18, 19])
    indices = np.stack([held, held, held, held], 1).astype(np.int32)
    points = Points(positions[held], indices, np.tile([1.0, 0.0, 0.0, 0.0], (8, 1)))
    targets = positions[held].copy()
    targets[4:] += rng.uniform(-0.3, 0.3, 3)
    return graph, points, targets


@laws
@given(SEEDS)
def test_a_stiffness_of_one_changes_nothing_to_the_bit(seed):
    graph, points, targets = bent_ladder(seed)
    plain = EmbeddedSolver(graph, points).solve(targets)
    ones = EmbeddedSolver(graph, points, stiffness=np.ones(20)).solve(targets)
    np.testing.assert_array_equal(plain[0], ones[0])
    np.testing.assert_array_equal(plain[1], ones[1])


@laws
@given(SEEDS, st.floats(0.1, 10.0))
def test_uniform_scaling_of_stiffness_and_pull_changes_nothing(seed, factor):
    graph, points, targets = bent_ladder(seed)
    plain = EmbeddedSolver(graph, points, EmbeddedSettings(**EXACT)).solve(targets)
    harder = EmbeddedSettings(constraint=100.0 * factor, **EXACT)
    both = EmbeddedSolver(graph, points, harder, stiffness=np.full(20, factor)).solve(targets)
    np.testing.assert_allclose(both[1], plain[1], atol=2e-5)


@laws
@given(SEEDS)
def test_the_stiffer_the_nearer_to_rigid(seed):
    """Of a minimum of k A + B the share A falls as k grows: here A is all that resists bending."""
    graph, points, targets = bent_ladder(seed)
    bent = []
    for factor in (0.25, 1.0, 4.0, 16.0):
        stiff = np.full(20, factor)
        solver = EmbeddedSolver(graph, points, EmbeddedSettings(**EXACT), stiffness=stiff)
        solver.solve(targets)
        own = (
            solver.energy_terms["rotation"]
            + solver.energy_terms["smoothness"]
            + solver.energy_terms["rigidity"]
        )
        bent.append(own / factor)
    assert (np.diff(bent) <= 1e-6 * bent[0] + 1e-12).all()


@laws
@given(SEEDS)
def test_a_limb_that_is_painted_stiffer_stays_nearer_to_rigid(seed):
    graph, points, targets = bent_ladder(seed)
    middle = (graph.positions[:, 0] > 0.35) & (graph.positions[:, 0] < 0.65)

    def strain(factor):
        stiff = np.where(middle, factor, 1.0)
        solver = EmbeddedSolver(graph, points, EmbeddedSettings(**EXACT), stiffness=stiff)
        linear, positions = solver.solve(targets)
        inner = graph.edges[middle[graph.edges].all(1)]
        arms = graph.positions[inner[:, 1]] - graph.positions[inner[:, 0]]
        ways = positions[inner[:, 1]] - positions[inner[:, 0]]
        own = np.einsum("eab,eb->ea", linear[inner[:, 0]], arms) - ways
        turned = np.swapaxes(linear[middle], 1, 2) @ linear[middle] - np.eye(3)
        return float((own**2).sum() + (turned**2).sum())

    strains = [strain(factor) for factor in (0.1, 1.0, 10.0, 100.0)]
    assert (np.diff(strains) <= 1e-9 + 1e-3 * strains[0]).all()
    assert strains[-1] < 0.5 * strains[0] or strains[0] < 1e-6
