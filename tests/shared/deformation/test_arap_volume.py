"""Tests of a surface's enclosed volume and of the pressure that preserves it, against slow references."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.solver import ArapSolver
from enliven.deformation.arap.surface import prepare_surface
from enliven.deformation.arap.volume import add_pressure, compute_volume_gradient
from enliven.document.surface_settings import ArapSettings
from enliven.meshes.mesh import Mesh


def blob(count=80, seed=0, holes=0):
    """Returns a closed surface of random points. Its first ``holes`` faces are removed."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces[holes:].astype(np.int32), "blob")


def enclosed(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_the_gradient_is_that_of_the_volume():
    mesh = blob(30)
    forces, step = np.zeros((30, 3)), 1e-6
    none = np.empty(0, np.int64)
    assert compute_volume_gradient(mesh.vertices + 5.0, mesh.faces, none, forces) == pytest.approx(
        enclosed(mesh.vertices, mesh.faces)
    )
    for v in range(0, 30, 7):
        for c in range(3):
            moved = mesh.vertices.copy()
            moved[v, c] += step
            slope = (enclosed(moved, mesh.faces) - enclosed(mesh.vertices, mesh.faces)) / step
            assert forces[v, c] == pytest.approx(slope, abs=1e-5)


def test_a_small_hole_does_not_make_the_volume_depend_on_the_place():
    surface = prepare_surface(blob(400, holes=3), 1000)
    volume, room = surface.volume, np.zeros((400, 3))
    here = compute_volume_gradient(surface.rest, volume.faces, volume.border, room)
    there = compute_volume_gradient(
        surface.rest + np.array([3.0, 9.0, 4.0]), volume.faces, volume.border, room
    )
    assert here == pytest.approx(there, rel=1e-9)
    assert here == pytest.approx(volume.rest)


def test_open_mesh_has_no_volume():
    half = blob(200)
    assert prepare_surface(Mesh(half.vertices, half.faces[: len(half.faces) // 2]), 1000).volume is None
    flat = Mesh(blob(200).vertices * [1.0, 1.0, 0.0], blob(200).faces)
    assert prepare_surface(flat, 1000).volume is None
    inside_out = Mesh(blob(200).vertices, blob(200).faces[:, ::-1])
    assert prepare_surface(inside_out, 1000).volume is None


def test_ease_matches_a_dense_solution():
    mesh = blob(60)
    surface = prepare_surface(mesh, 1000)
    count, (a, b) = 60, surface.edges.T
    laplacian = np.zeros((count, count))
    np.add.at(laplacian, (a, a), surface.weights)
    np.add.at(laplacian, (b, b), surface.weights)
    np.add.at(laplacian, (a, b), -surface.weights)
    np.add.at(laplacian, (b, a), -surface.weights)
    forces = np.zeros((count, 3))
    compute_volume_gradient(surface.rest, surface.volume.faces, surface.volume.border, forces)
    grown = np.linalg.pinv(laplacian) @ forces
    assert surface.volume.ease == pytest.approx((grown * forces).sum(), rel=1e-4)


def test_pressure_acts_only_where_cells_are_stretched():
    surface = prepare_surface(blob(60), 1000)
    frames, z = np.zeros((60, 16)), np.zeros(4 * 64, np.float32)
    stretched = np.arange(60) < 20
    frames[stretched, 3] = 0.2
    pose, forces = 0.9 * surface.rest, np.zeros((60, 3))
    eliminated = surface.cells.eliminated
    pressure = add_pressure(surface.volume, frames.reshape(-1), eliminated, pose, forces, 0.0, 1.0, z)
    assert pressure > 0.0
    pushed = z[:240].reshape(-1, 4)[eliminated, :3]
    assert (pushed[~stretched] == 0.0).all()
    assert ((pushed * surface.rest).sum(1)[stretched] > 0.0).all()
    share = 0.2**2 / (0.2**2 + 0.05**2)
    assert np.allclose(pushed[stretched], pressure * share * forces[stretched], rtol=1e-5)
    frames[:, 3] = 0.0
    assert add_pressure(surface.volume, frames.reshape(-1), eliminated, pose, forces, 1.0, 1.0, z) == 0.0


def test_half_of_the_change_may_be_kept():
    mesh = blob(500)
    ends = [np.flatnonzero(side * mesh.vertices[:, 1] > 0.95).tolist() for side in (1, -1)]
    drift = []
    for share in (0.0, 0.5, 1.0):
        solver = ArapSolver(mesh, ArapSettings(volume=share, hold=0.3))
        solver.set_handles([Handle(str(k), tuple(end)) for k, end in enumerate(ends)])
        for frame in range(60):
            shift = np.array([0.0, min(0.4, frame / 60), 0.0])
            solved = solver.solve(
                {str(k): mesh.vertices[end] + (1 - 2 * k) * shift for k, end in enumerate(ends)}
            )
        drift.append(enclosed(solved, mesh.faces) / enclosed(mesh.vertices, mesh.faces) - 1)
    assert drift[0] > 0.05 and abs(drift[2]) < 0.01
    assert 0.3 * drift[0] < drift[1] < 0.7 * drift[0]
