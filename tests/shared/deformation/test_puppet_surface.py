"""Tests of puppet surfaces: coarse and fine, warm-started and converged, and their errors."""

from dataclasses import replace

import numpy as np
import pytest
from arap_energy import fit_cells
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import SOLVER_TOLERANCE, are_alike

from enliven import rotation
from enliven.deformation.arap.coarse import edges_around, poisson_disk_samples, sample_coarse_surface
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.deformation.arap.detail import apply_vertex_maps, compute_vertex_maps
from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.riders import select_followed_samples
from enliven.deformation.arap.solver import ArapSolver
from enliven.deformation.arap.surface import prepare_surface
from enliven.document.surface_settings import ArapSettings
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh

COARSE = ArapSettings(coarse_above=100, coarse_vertices=250, guide_vertices=40)


def tube(around=24, along=60, radius=0.15, bumps=0.0):
    """Returns a closed tube of 1 m along y with round ends. ``bumps`` is the height of its surface detail in
    metres.
    """
    turn, up = 2 * np.pi * np.arange(around) / around, np.linspace(-0.5, 0.5, along)
    wide = radius * np.sqrt(1 - np.clip((np.abs(up) - 0.4) / 0.105, 0, 1) ** 2)
    wide = wide[:, None] + bumps * np.cos(4 * turn) * np.sin(40 * up)[:, None] * (np.abs(up) < 0.35)[:, None]
    rings = np.stack([wide * np.cos(turn), up[:, None] + 0 * wide, wide * np.sin(turn)], -1).reshape(-1, 3)
    last, faces = len(rings), []
    for k in range(around):
        n = (k + 1) % around
        faces += [[last, k, n], [last + 1, last - around + n, last - around + k]]
        for r in range(along - 1):
            a, b, c, d = r * around + k, r * around + n, (r + 1) * around + k, (r + 1) * around + n
            faces += [[a, d, b], [a, c, d]]
    points = np.concatenate([rings, [[0, -0.51, 0], [0, 0.51, 0]]])
    return Mesh(points, np.array(faces, np.int32), "tube")


def ends(mesh):
    """Returns the vertices of a ring of three near each end, and of the tips."""
    count = len(mesh.vertices)
    return [count - 2, count - 1, 3 * 24, 3 * 24 + 8, 3 * 24 + 16, count - 80, count - 88, count - 96]


def bent(mesh, held, by=1.2):
    """Returns control point positions with the upper half rotated about x."""
    turn = rotation.to_matrix(rotation.from_rotation_vector(np.array([by, 0.0, 0.0])))
    places = mesh.vertices[held].copy()
    upper = places[:, 1] > 0
    places[upper] = places[upper] @ turn.T
    return places


def normals(mesh, vertices):
    return replace(mesh, vertices=vertices).vertex_normals()


def test_small_mesh_matches_the_plain_solver():
    mesh = tube(12, 20)
    held = [0, 5, 240, 241]
    surface = PuppetSurface(mesh, held, [None, 3.0, None, None], replace(COARSE, coarse_above=1000))
    surface = PuppetSurface(mesh, held, [None, 3.0, None, None])
    solver = ArapSolver(mesh)
    weights = [None, 3.0, None, None]
    solver.set_handles([Handle(str(k), (v,), weights[k]) for k, v in enumerate(held)])
    for k in range(3):
        places = mesh.vertices[held] + 0.05 * k * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]])
        wanted = solver.solve({str(i): place[None] for i, place in enumerate(places)})
        assert are_alike(surface.solve(places), wanted, SOLVER_TOLERANCE)


def test_full_resolution_surface_equals_solved_surface():
    mesh = tube(12, 20)
    count = len(mesh.vertices)
    net = edges_around(mesh.vertices, mesh.faces)
    assert np.array_equal(poisson_disk_samples(*net, np.arange(count), 1e-6), np.arange(count))
    start, near, way = np.arange(count + 1), np.arange(count, dtype=np.int32), np.zeros(count)
    start, near, weights = select_followed_samples(mesh.vertices, mesh.vertices, start, near, way, 0.1, 1.25)
    solver = ArapSolver(mesh)
    solver.set_handles([Handle("a", (0,)), Handle("b", (241,))])
    pose = solver.solve({"b": mesh.vertices[241] + 0.2})
    out = np.empty_like(mesh.vertices)
    apply_vertex_maps(solver.get_vertex_maps(), start, near, weights, mesh.vertices, out, 0, count)
    assert np.abs(out - pose).max() < 1e-12


def test_samples_are_apart_and_everything_is_near_one():
    mesh = tube()
    offsets, neighbours, lengths = edges_around(mesh.vertices, mesh.faces)
    pairs = {(a, b) for f in mesh.faces.tolist() for a in f for b in f if a != b}
    near_pairs = {
        (v, int(u)) for v in range(len(mesh.vertices)) for u in neighbours[offsets[v] : offsets[v + 1]]
    }
    assert near_pairs == pairs
    rows = np.repeat(np.arange(len(mesh.vertices)), np.diff(offsets))
    assert np.allclose(lengths, np.linalg.norm(mesh.vertices[rows] - mesh.vertices[neighbours], axis=1))
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    chosen = poisson_disk_samples(offsets, neighbours, lengths, np.arange(len(mesh.vertices)), 0.12)
    ways = dijkstra(csr_matrix((lengths, neighbours, offsets)), indices=chosen)
    assert (ways.min(0) <= 0.12).all()
    between = ways[:, chosen]
    assert between[~np.eye(len(chosen), dtype=bool)].min() > 0.12


def test_weights_match_the_slow_reference():
    rng = np.random.default_rng(0)
    points, samples = rng.random((30, 3)), rng.random((12, 3))
    ways = np.linalg.norm(points[:, None] - samples, axis=2) * rng.uniform(1.0, 1.6, (30, 12))
    start, near = 12 * np.arange(31), np.tile(np.arange(12, dtype=np.int32), 30)
    offsets, nearest, weights = select_followed_samples(points, samples, start, near, ways.ravel(), 0.7, 1.25)
    d = np.maximum(np.linalg.norm(points[:, None] - samples, axis=2), ways / 1.25)
    expected = np.where(d < 0.7, ((0.7 - d) / (0.7 * d)) ** 2, 0.0)
    expected /= expected.sum(1, keepdims=True)
    dense = np.zeros((30, 12))
    dense[np.repeat(np.arange(30), np.diff(offsets)), nearest] = weights
    assert np.abs(dense - expected).max() < 1e-6


def test_maps_and_their_blend_match_the_slow_reference():
    mesh = tube(10, 14)
    solver = ArapSolver(mesh)
    solver.set_handles([Handle("a", (0,)), Handle("b", (141,))])
    pose = solver.solve({"b": mesh.vertices[141] + [0.2, 0.1, 0.0]})
    surface = prepare_surface(mesh, solver.settings.most_vertices)
    frames, place_of = fit_cells(solver, surface), surface.place_of
    maps = np.empty(16 * len(pose))
    compute_vertex_maps(surface.cells, frames.reshape(-1), pose, place_of, mesh.vertices, maps)
    w = np.zeros((len(pose), len(pose)))
    for (i, j), weight in zip(surface.edges, surface.weights, strict=True):
        w[i, j] = w[j, i] = weight
    w = w[place_of][:, place_of]
    slow = []
    for v in range(len(pose)):
        e, moved = mesh.vertices[v] - mesh.vertices, pose[v] - pose
        own = 0.01 * (w[v][:, None] * e * e).sum()
        turned = frames[place_of[v], :12].reshape(3, 4)[:, :3].T
        right = (w[v][:, None] * moved).T @ e + own * turned
        slow.append(right @ np.linalg.inv((w[v][:, None] * e).T @ e + own * np.eye(3)))
    linear = maps.reshape(-1, 4, 4)[:, :3, :3].transpose(0, 2, 1)
    assert np.abs(linear - slow).max() < 1e-8
    assert (
        np.abs(np.einsum("vij,vj->vi", linear, mesh.vertices) + maps.reshape(-1, 4, 4)[:, 3, :3] - pose).max()
        < 1e-12
    )
    start, near = np.array([0, 2, 3]), np.array([5, 9, 7], np.int32)
    weights, rest, out = np.array([0.25, 0.75, 1.0], np.float32), np.ones((2, 3)), np.empty((2, 3))
    apply_vertex_maps(maps, start, near, weights, rest, out, 0, 2)
    by = maps.reshape(-1, 4, 4)
    blend = [0.25 * by[5] + 0.75 * by[9], by[7]]
    for row, b in zip(out, blend, strict=True):
        assert np.allclose(row, (b[0] + b[1] + b[2] + b[3])[:3])


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_a_rigid_motion_of_the_control_points_is_the_meshs(seed):
    rng = np.random.default_rng(seed)
    mesh = tube(bumps=0.01)
    held = rng.choice(len(mesh.vertices), 5, replace=False)
    surface = PuppetSurface(mesh, held, settings=COARSE)
    turn = rotation.to_matrix(rotation.normalized(rng.normal(size=4)))
    moved = mesh.vertices @ turn.T + rng.normal(0, 1, 3)
    assert np.abs(surface.solve(moved[held]) - moved).max() < 1e-7
    assert np.abs(surface.solve_from_rest(moved[held]) - moved).max() < 1e-7
    # So it is from a pose that is bent, warm: the same bend, turned.
    places = bent(mesh, held)
    for _ in range(60):
        shape = surface.solve(places)
    step = np.abs(surface.solve(places) - shape).max()
    again = surface.solve(places @ turn.T + 1.0)
    assert np.abs(again - (shape @ turn.T + 1.0)).max() < 4 * step + 1e-7


def test_control_points_and_welded_vertices_reach_targets_exactly():
    mesh = tube()
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    handles = [0, 2000, 5000]
    surface = PuppetSurface(soup, handles, [None, None, 5.0], COARSE)
    places = soup.vertices[handles] + [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]
    solved = surface.solve(places)
    assert np.array_equal(solved[handles[:2]], places[:2])
    assert np.linalg.norm(solved[5000] - places[2]) > 1e-6
    at = (soup.vertices == soup.vertices[0]).all(1)
    assert at.sum() > 3 and (solved[at] == places[0]).all()
    # Nothing is torn: vertices at the same position stay together.
    twins = np.unique(soup.vertices, axis=0, return_inverse=True)[1].reshape(-1)
    first = np.unique(twins, return_index=True)[1][twins]
    assert np.abs(solved - solved[first]).max() < 1e-12


def test_detail_is_carried_along():
    smooth, rough = tube(), tube(bumps=0.012)
    handles = ends(smooth)
    places = bent(smooth, handles)
    plain = PuppetSurface(smooth, handles, settings=COARSE).solve_from_rest(places)
    solved = PuppetSurface(rough, handles, settings=COARSE).solve_from_rest(bent(rough, handles))
    # Height of the detail above the smooth surface, before and after.
    before = ((rough.vertices - smooth.vertices) * smooth.vertex_normals()).sum(1)
    after = ((solved - plain) * normals(smooth, plain)).sum(1)
    middle = np.abs(before) > 0.006
    assert middle.sum() > 200
    assert np.corrcoef(before[middle], after[middle])[0, 1] > 0.9
    assert 0.75 < np.abs(after[middle]).mean() / np.abs(before[middle]).mean() < 1.3


def test_the_carried_surface_has_no_facets():
    mesh = tube(48, 120)
    count = len(mesh.vertices)
    handles = [count - 2, count - 1, 144, 160, 176, count - 150, count - 166, count - 182]
    solved = PuppetSurface(mesh, handles, settings=COARSE).solve_from_rest(bent(mesh, handles))
    fine = PuppetSurface(mesh, handles, settings=replace(COARSE, coarse_above=10**6)).solve_from_rest(
        bent(mesh, handles)
    )

    def sharpest(vertices):
        """Returns the largest angles between faces that share an edge, without the few at the tips."""
        faces = replace(mesh, vertices=vertices).face_normals()
        sides = np.sort(np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)]), 1)
        order = np.lexsort(sides.T)
        pairs = np.tile(np.arange(len(faces)), 3)[order].reshape(-1, 2)
        angles = np.arccos(np.clip((faces[pairs[:, 0]] * faces[pairs[:, 1]]).sum(1), -1, 1))
        return np.quantile(angles, 0.98)

    assert sharpest(solved) < 1.25 * max(sharpest(fine), sharpest(mesh.vertices))


def test_settling_is_the_same_whatever_came_before():
    mesh = tube()
    held = ends(mesh)
    places = bent(mesh, held)
    for kind in (COARSE, replace(COARSE, coarse_above=10**6), ArapSettings(guide_vertices=10**6)):
        surface, fresh = PuppetSurface(mesh, held, settings=kind), PuppetSurface(mesh, held, settings=kind)
        first = surface.solve_from_rest(places)
        for by in (0.3, -0.9, 2.0):
            surface.solve(bent(mesh, held, by))
        surface.solve_from_rest(bent(mesh, held, -1.0))
        assert are_alike(surface.solve_from_rest(places), first, SOLVER_TOLERANCE)
        assert are_alike(fresh.solve_from_rest(places), first, SOLVER_TOLERANCE)
        # A drag continues from this state without a jump.
        assert np.abs(surface.solve(places) - first).max() < 0.01


def test_a_limb_that_is_turned_far_is_not_turned_inside_out():
    mesh = tube()
    handles = ends(mesh)
    for kind in (COARSE, replace(COARSE, coarse_above=10**6)):
        solved = PuppetSurface(mesh, handles, settings=kind).solve_from_rest(bent(mesh, handles, 2.2))
        a, b, c = (solved[mesh.faces[:, k]] for k in range(3))
        assert (a * np.cross(b, c)).sum() > 0
        # Each end still has the shape of a tube's end that points outward.
        top = mesh.vertices[:, 1] > 0.42
        out = solved[top] - solved[top].mean(0)
        assert ((normals(mesh, solved)[top] * out).sum(1) > 0).mean() > 0.95


def test_a_drag_arrives_where_settling_does():
    mesh = tube(40, 120)
    handles = [len(mesh.vertices) - 2, len(mesh.vertices) - 1, 120, 134, 148]
    places = bent(mesh, handles, 1.0)
    errors = []
    for guide in (100, 10**6):
        kind = ArapSettings(guide_vertices=guide)
        surface = PuppetSurface(mesh, handles, settings=kind)
        settled = PuppetSurface(mesh, handles, settings=replace(kind, guide_vertices=100)).solve_from_rest(
            places
        )
        for frame in range(20):
            solved = surface.solve(bent(mesh, handles, (frame + 1) / 20))
        errors.append(np.linalg.norm(solved - settled, axis=1).mean())
    assert errors[0] < 0.02 and errors[0] < 0.5 * errors[1]


def test_sampling_another_time_does_not_disturb_a_drag():
    mesh = tube()
    handles = ends(mesh)
    first, second = (PuppetSurface(mesh, handles, settings=COARSE) for _ in range(2))
    for by in (0.2, 0.4):
        first.solve(bent(mesh, handles, by))
        second.solve(bent(mesh, handles, by))
    posed = first.settle_separately(bent(mesh, handles, -1.0))
    assert are_alike(
        first.solve(bent(mesh, handles, 0.6)), second.solve(bent(mesh, handles, 0.6)), SOLVER_TOLERANCE
    )
    assert are_alike(posed, second.solve_from_rest(bent(mesh, handles, -1.0)), SOLVER_TOLERANCE)


@pytest.mark.parametrize("kind", [COARSE, ArapSettings()], ids=["coarse", "plain"])
def test_other_control_points_are_as_a_new_surface(kind):
    mesh = tube()
    surface = PuppetSurface(mesh, [0, 500], settings=kind)
    surface.solve(mesh.vertices[[0, 500]] + 0.1)
    handles = [*ends(mesh), 500]
    surface.set_control_points(handles)
    assert np.array_equal(surface.pose, mesh.vertices)
    places = bent(mesh, handles)
    solved = surface.solve(places)
    assert np.array_equal(solved[handles], places)
    assert are_alike(solved, PuppetSurface(mesh, handles, settings=kind).solve(places), SOLVER_TOLERANCE)
    surface.set_control_points([])
    assert np.array_equal(surface.solve(np.empty((0, 3))), mesh.vertices)


def test_tiny_shells_and_loose_vertices_follow_nearest_surface():
    body, bead = tube(), tube(6, 4, 0.02)
    bead = replace(bead, vertices=0.02 * bead.vertices + [0.16, 0.3, 0.0])
    loose = np.array([[0.17, 0.31, 0.0]])
    mesh = Mesh(
        np.concatenate([body.vertices, bead.vertices, loose]),
        np.concatenate([body.faces, bead.faces + len(body.vertices)]),
    )
    handles = ends(body)
    surface = PuppetSurface(mesh, handles, settings=COARSE)
    assert any("tiny separate shells" in note for note in surface.notes)
    solved = surface.solve_from_rest(bent(mesh, handles))
    riders = np.arange(len(body.vertices), len(mesh.vertices))
    hosts = np.linalg.norm(body.vertices[None] - mesh.vertices[riders][:, None], axis=2).argmin(1)
    before = np.linalg.norm(mesh.vertices[riders] - mesh.vertices[hosts], axis=1)
    after = np.linalg.norm(solved[riders] - solved[hosts], axis=1)
    assert np.abs(solved[riders] - mesh.vertices[riders]).max() > 0.1
    assert (after < 1.5 * before + 0.01).all()
    # A held shell is solved like the others.
    tip = len(body.vertices)
    surface.set_control_points([*handles, tip])
    places = np.concatenate([bent(mesh, handles), [[0.4, 0.4, 0.0]]])
    assert np.array_equal(surface.solve(places)[tip], places[-1])


@pytest.mark.parametrize("kind", [COARSE, ArapSettings()], ids=["coarse", "plain"])
def test_bad_input_is_reported_and_last_good_pose_stays(kind):
    tubes = tube()
    mesh = Mesh(np.concatenate([tubes.vertices, [[0.0, 3.0, 0.0]]]), tubes.faces)
    held = ends(tubes)
    surface, undisturbed = (PuppetSurface(mesh, held, settings=kind) for _ in range(2))
    good = surface.solve(bent(mesh, held, 0.4))
    undisturbed.solve(bent(mesh, held, 0.4))
    for places, says in (
        (np.full((8, 3), np.nan), "not finite"),
        (np.full((8, 3), 1e9), "units"),
        (np.zeros((3, 3)), r"\(3, 3\)"),
    ):
        for ask in (surface.solve, surface.solve_from_rest):
            with pytest.raises(InputError, match=says):
                ask(places)
    for wrong, says in (([0, 99_999], "99999"), ([len(tubes.vertices)], "belongs to no face")):
        with pytest.raises(InputError, match=says):
            surface.set_control_points(wrong)
    with pytest.raises(InputError, match=r"number of weights \(2\)"):
        surface.set_control_points(held, [1.0, None])
    assert surface.pose is good
    # The next frame starts from the shape of the last good one.
    following = surface.solve(bent(mesh, held, 0.5))
    assert np.isfinite(following).all()
    assert np.array_equal(following, undisturbed.solve(bent(mesh, held, 0.5)))


def test_huge_mesh_is_refused_and_large_mesh_is_reported():
    mesh = tube()
    with pytest.raises(InputError, match="at most 500 are allowed"):
        PuppetSurface(mesh, [0], settings=replace(COARSE, most_carried=500))
    surface = PuppetSurface(mesh, [0], settings=replace(COARSE, most_vertices=1000))
    assert any("of them, and the others follow" in note for note in surface.notes)


def test_the_coarse_surface_is_one_like_the_fine():
    mesh = tube(40, 100)
    coarse = sample_coarse_surface(mesh, np.array([7, 3000, 7, 8]), 300)
    assert np.array_equal(coarse.mesh.vertices[coarse.held], mesh.vertices[[7, 3000, 7, 8]])
    count = len(coarse.mesh.vertices)
    assert 250 <= count <= 350
    # A closed surface without handles has 2 V - 4 faces. Links that are not faces are rare.
    assert abs(len(coarse.mesh.faces) - (2 * count - 4)) <= 4 and len(coarse.links) <= 4
    assert abs(coarse.mesh.area / mesh.area - 1) < 0.05
    a, b, c = (coarse.mesh.vertices[coarse.mesh.faces[:, k]] for k in range(3))
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(np.pi * 0.15**2, rel=0.2)
