"""Tests of sphere proxies of third-party meshes: every vertex is covered, with few spheres."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from enliven.deformation.spheres import SphereSettings, pack_spheres, surface_samples
from enliven.document.character import Character, SkinWeights
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import fit_height

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data")) / "meshes"
MESHES = sorted(DATA.glob("*/*.o[bf][jf]")) if DATA.is_dir() else []

pytestmark = pytest.mark.real


@pytest.mark.skipif(not MESHES, reason="the real meshes are not here (ENLIVEN_DATA)")
@pytest.mark.parametrize("path", MESHES, ids=lambda p: p.stem)
def test_every_vertex_is_covered(path: Path) -> None:
    mesh = fit_height(load_mesh(path)[0], 1.75, "z" if path.stem == "human_block" else "y")
    count = len(mesh.vertices)
    weights = np.zeros((count, 4), np.float32)
    weights[:, 0] = 1
    skin = SkinWeights(np.zeros((count, 4), np.uint16), weights)
    rest = mesh.vertices.astype(np.float32)
    pivot, edges = np.zeros((1, 3), np.float32), np.zeros((0, 2), np.int32)
    proxies = pack_spheres(Character(path.stem, rest, mesh.faces, skin, pivot, edges))
    assert 3 <= len(proxies) <= SphereSettings().most
    used = np.unique(mesh.faces)
    away, _ = cKDTree(proxies.rest).query(rest[used].astype(float))
    assert away.max() <= proxies.radius * (1 + 1e-6)
    # Spheres stay near the mesh: none is farther from it than its own radius.
    rows, shares = surface_samples(mesh.vertices, mesh.faces, 0.5 * proxies.radius)
    surface = cKDTree(np.einsum("pc,pca->pa", shares, mesh.vertices[rows]))
    assert surface.query(proxies.rest)[0].max() <= proxies.radius
