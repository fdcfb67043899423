"""Tests that every real mesh is read, repaired, sampled, linked, skinned, and moved as a whole."""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven import rotation
from enliven.deformation.graph.connectivity import label_components
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.graph.surface import build_net, path_lengths, voronoi_cells
from enliven.deformation.skinning import skin_vertices
from enliven.document.character import Pose
from enliven.meshes.files import READABLE, load_mesh
from enliven.meshes.mesh import fit_height

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3].parent / "shared" / "data"))
FILES = sorted(p for kind in ("meshes", "gltf") for p in DATA.glob(f"{kind}/**/*") if p.suffix in READABLE)
FLAT = {"alligator", "woody", "SimpleSkin"}

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FILES, reason=f"no real meshes in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_a_real_mesh_becomes_a_character(path):
    mesh, notes = load_mesh(path)
    assert all(isinstance(note, str) and note for note in notes)
    assert np.isfinite(mesh.vertices).all()
    up = "z" if path.stem == "human_block" else "y"
    mesh = fit_height(mesh, 1.75, up)
    assert mesh.bounds[1, 1] == pytest.approx(1.75)
    assert any("flat" in note for note in notes) == (path.stem in FLAT)
    graph = DeformationGraph.build(mesh, 64)
    assert label_components(64, graph.edges).max() == 0
    character = character_from_graph(mesh, graph, path.stem)
    np.testing.assert_allclose(character.skin.weights.sum(1), 1, atol=1e-6)
    turn = rotation.to_matrix(rotation.from_rotation_vector([0.2, 1.1, -0.4])).astype(np.float32)
    pose = Pose(path.stem, 0, np.tile(turn, (64, 1, 1)), (graph.positions @ turn.T + 1).astype(np.float32))
    np.testing.assert_allclose(skin_vertices(character, pose), mesh.vertices @ turn.T + 1, atol=1e-4)


def shortcuts(mesh, graph, edges):
    """Returns the number of edges whose path along the surface is over three times as long, and longer than a
    node spacing.
    """
    spacing = np.sqrt(mesh.area / len(graph.positions))
    cells = voronoi_cells(build_net(mesh, spacing), graph.positions, graph.faces)
    ways = path_lengths(len(graph.positions), cells.borders, cells.lengths)[edges[:, 0], edges[:, 1]]
    straight = np.linalg.norm(graph.positions[edges[:, 0]] - graph.positions[edges[:, 1]], axis=1)
    return int((np.isfinite(ways) & (ways > 3 * straight) & (ways > 2 * spacing)).sum())


@pytest.mark.parametrize(
    "name", ["horse_quad.obj", "human_man.obj", "humanoid.off", "camel_b.obj", "octopus.obj"]
)
def test_no_edge_joins_limbs_that_are_apart(name):
    mesh = fit_height(load_mesh(next(p for p in FILES if p.name == name)).mesh, 1.75)
    graph = DeformationGraph.build(mesh, 128)
    assert shortcuts(mesh, graph, graph.edges) == 0


def test_plain_neighbours_would_join_them():
    """Shows that the test above is meaningful: the four nearest nodes in space do connect limbs of these
    meshes.
    """
    shortcut_count = 0
    for name in ("horse_quad.obj", "human_man.obj", "humanoid.off", "camel_b.obj", "octopus.obj"):
        mesh = fit_height(load_mesh(next(p for p in FILES if p.name == name)).mesh, 1.75)
        graph = DeformationGraph.build(mesh, 128)
        distances = np.linalg.norm(graph.positions[:, None] - graph.positions[None], axis=2)
        nearest = np.argsort(distances, 1)[:, 1:5]
        pairs = np.stack([np.repeat(np.arange(128), 4), nearest.ravel()], 1)
        shortcut_count += shortcuts(mesh, graph, pairs)
    assert shortcut_count > 0
