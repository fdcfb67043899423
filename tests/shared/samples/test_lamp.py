"""Tests of the sample lamp: eighteen closed shells that touch, of a size that fits a person's hip and right
arm.
"""

import numpy as np
import pytest

from enliven.deformation.graph.connectivity import find_weak_edges
from enliven.deformation.graph.graph import DeformationGraph
from enliven.meshes.kernels import shells
from enliven.meshes.repair import repair
from enliven.samples.shipped import load_sample


@pytest.fixture(scope="module")
def lamp():
    return load_sample("lamp")


@pytest.mark.slow
def test_every_shell_is_closed_and_faces_outwards(lamp):
    assert 10_000 <= len(lamp.vertices) <= 25_000
    shell = shells(lamp.faces, len(lamp.vertices))
    assert len(np.unique(shell)) == 18
    edges = np.concatenate([lamp.faces[:, [0, 1]], lamp.faces[:, [1, 2]], lamp.faces[:, [2, 0]]])
    forth = {tuple(e) for e in edges.tolist()}
    assert len(forth) == len(edges)
    assert all((b, a) in forth for a, b in forth)
    middle = np.stack([lamp.vertices[shell == s].mean(0) for s in range(18)])
    apex = lamp.vertices[lamp.faces[:, 0]] - middle[shell[lamp.faces[:, 0]]]
    volumes = np.bincount(shell[lamp.faces[:, 0]], (apex * lamp.face_vectors()).sum(1) / 3, minlength=18)
    assert (volumes > 1e-5).all()
    assert repair(lamp)[1] == ["the mesh has 18 separate shells, and all of them are kept"]


def test_lamp_has_its_documented_size(lamp):
    low, high = lamp.bounds
    assert low[1] == 0.0
    assert 1.5 < high[1] < 1.75
    assert 1.2 < lamp.area < 1.8
    corners = lamp.vertices[lamp.faces]
    assert np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2).max() < 0.025
    foot = lamp.vertices[lamp.vertices[:, 1] < 0.01]
    assert np.ptp(foot[:, 0]) > 0.4
    # The shade is to the right, at the height of a hand that is stretched out.
    shade = lamp.vertices[lamp.vertices[:, 0] < -0.85]
    assert 1.1 < shade[:, 1].mean() < 1.6


def test_all_parts_are_connected(lamp):
    shell = shells(lamp.faces, len(lamp.vertices))
    joined, seen = {0}, [0]
    while seen:
        here = lamp.vertices[shell == seen.pop()][::3]
        for other in set(range(18)) - joined:
            there = lamp.vertices[shell == other][::3]
            gap = min(np.linalg.norm(there - point, axis=1).min() for point in here[::2])
            if gap < 0.03:
                joined.add(other)
                seen.append(other)
    assert len(joined) == 18


def test_its_graph_holds_together(lamp):
    graph = DeformationGraph.build(lamp, nodes=128)
    reached, fringe = {0}, [0]
    while fringe:
        at = fringe.pop()
        for a, b in graph.edges[(graph.edges == at).any(1)].tolist():
            for node in {a, b} - reached:
                reached.add(node)
                fringe.append(node)
    assert len(reached) == len(graph.positions) == 128
    bridges, _, _ = find_weak_edges(128, graph.edges)
    np.testing.assert_array_equal(bridges, graph.bridges)
