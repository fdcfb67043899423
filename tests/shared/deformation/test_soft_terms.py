"""Tests of the soft plane terms from depth, the floor, and neighbouring limbs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.isosurface import surface_of

from enliven import rotation
from enliven.deformation.constraints.floor_contact import FloorContact, FloorSettings
from enliven.deformation.constraints.observed import (
    ObservedSettings,
    ObservedSurface,
    find_compatible_surface_points,
)
from enliven.deformation.constraints.self_contact import SelfContact, SelfContactSettings
from enliven.deformation.constraints.soft import ConstrainedPoints, join_planes, subsample_on_grid
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.document.character import Pose
from enliven.meshes.mesh import Mesh

RADIUS = 0.06
FORWARD, UP = np.array([0, 0, 0.05]), np.array([0, 1.0, 0])
LEGS = np.array(
    [
        [[-0.15, 0.06, 0], [-0.15, 0.8, 0]],
        [[0.15, 0.06, 0], [0.15, 0.8, 0]],
        [[-0.15, 0.8, 0], [0.15, 0.8, 0]],
    ]
)


def to_capsules(points, ends, radius=RADIUS):
    """Returns (N,) signed distances in metres from points to capsules, negative inside."""
    best = np.full(len(points), np.inf)
    for a, b in ends:
        share = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return best - radius


@pytest.fixture(scope="module")
def trousers():
    """Returns two legs hanging from a bar: character, graph and mesh."""
    low, high = np.array([-0.3, -0.1, -0.15]), np.array([0.3, 1.0, 0.15])
    mesh = Mesh(*surface_of(lambda p: to_capsules(p, LEGS), low, high, 0.03), "trousers")
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "trousers"), graph, mesh


def rest(graph):
    return np.tile(np.eye(3), (len(graph.positions), 1, 1)), graph.positions


def turned(graph, seed):
    """Returns nodes with random rotations and displacements."""
    rng = np.random.default_rng(seed)
    turns = rotation.to_matrix(rotation.from_rotation_vector(rng.normal(size=(len(graph.positions), 3))))
    return turns, graph.positions + 0.1 * rng.normal(size=graph.positions.shape)


def slack(planes, graph, linear, positions):
    """Returns (M,) the plane residuals n·φ(p) − b."""
    at = ConstrainedPoints(planes.points, planes.node_indices, planes.node_weights, graph.positions)
    return np.einsum("ma,ma->m", planes.normals, at.deform_points(linear, positions)) - planes.offsets


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_points_move_as_vertices_do(trousers, seed):
    character, graph, _ = trousers
    linear, positions = turned(graph, seed)
    pose = Pose("trousers", 0, linear.astype(np.float32), positions.astype(np.float32))
    every = ConstrainedPoints.from_vertices(character, np.arange(len(character.vertices)))
    np.testing.assert_allclose(
        every.deform_points(linear, positions), skin_vertices(character, pose), atol=1e-5
    )


@given(st.integers(1, 400), st.integers(1, 200), st.integers(0, 100))
@settings(max_examples=40, deadline=None)
def test_a_spread_is_no_more_than_asked_and_misses_no_place(count, most, seed):
    points = np.random.default_rng(seed).uniform(size=(count, 3))
    few = subsample_on_grid(points, most)
    assert 1 <= len(few) <= min(most, count) and len(set(few)) == len(few)
    if count <= most:
        assert len(few) == count
    else:
        gaps = np.linalg.norm(points[:, None] - points[few][None], axis=2).min(1)
        assert gaps.max() < 3.5 / np.sqrt(len(few))


def test_joining_no_sets_gives_an_empty_set(trousers):
    character, graph, _ = trousers
    assert join_planes([]) is None
    above = FloorContact(character).planes(*rest(graph), 0.03)
    assert join_planes([above]) is above
    assert len(join_planes([above, above])) == 2 * len(above)


def seen_of(mesh, every=3):
    """Returns points of the mesh's front with normals, as measured by a sensor at +Z."""
    normals = mesh.vertex_normals()
    front = np.flatnonzero(normals[:, 2] > 0.3)[::every]
    return mesh.vertices[front], normals[front]


def test_depth_on_the_surface_exerts_no_pull(trousers):
    character, graph, mesh = trousers
    planes = ObservedSurface(character).planes(*rest(graph), *seen_of(mesh))
    assert len(planes) > 100 and not planes.one_sided.any()
    assert np.abs(slack(planes, graph, *rest(graph))).max() < 0.008
    assert planes.weights.min() > 2.0


def test_depth_in_front_of_the_surface_pulls_it(trousers):
    character, graph, mesh = trousers
    points, normals = seen_of(mesh)
    planes = ObservedSurface(character).planes(*rest(graph), points + FORWARD, normals)
    moved = (np.eye(3)[None].repeat(len(graph.positions), 0), graph.positions + FORWARD)
    before, after = (np.abs(slack(planes, graph, *state)).mean() for state in (rest(graph), moved))
    assert before > 0.02 and after < 0.35 * before


def test_mismatched_depth_exerts_no_pull(trousers):
    character, graph, mesh = trousers
    points, normals = seen_of(mesh)
    surface = ObservedSurface(character)
    near = ObservedSurface(character, ObservedSettings(farthest=0.05))
    assert len(near.planes(*rest(graph), points, -normals)) < 0.05 * len(points)
    assert len(surface.planes(*rest(graph), points + 40 * FORWARD, normals)) == 0
    assert len(surface.planes(*rest(graph), np.empty((0, 3)), np.empty((0, 3)))) == 0
    lost = points.copy()
    lost[::2] = np.nan
    planes = surface.planes(*rest(graph), lost, normals)
    assert 0 < len(planes) <= len(points) / 2 + 1 and np.isfinite(planes.offsets).all()


def test_farther_points_count_less_and_the_count_is_bounded(trousers):
    character, graph, mesh = trousers
    points, normals = seen_of(mesh, 1)
    surface = ObservedSurface(character, ObservedSettings(points=50))
    weights = [
        surface.planes(*rest(graph), points + normals * gap, normals).weights.mean()
        for gap in (0.0, 0.05, 0.1, 0.2)
    ]
    assert np.all(np.diff(weights) < 0) and weights[-1] < 0.2 * weights[0]
    assert len(surface.planes(*rest(graph), points, normals)) <= 50


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 3), st.floats(-0.9, 0.9))
@settings(max_examples=30, deadline=None)
def test_the_nearest_compatible_point_is_the_one_that_a_look_at_all_would_find(seed, farthest, cosine):
    rng = np.random.default_rng(seed)
    points, surface = rng.normal(size=(20, 3)), rng.normal(size=(40, 3))
    normals, facing = rng.normal(size=(20, 3)), rng.normal(size=(40, 3))
    nearest, lengths = find_compatible_surface_points(points, normals, surface, facing, farthest, cosine)
    for i in range(20):
        apart = np.linalg.norm(surface - points[i], axis=1)
        apart[(facing @ normals[i] <= cosine) | (apart >= farthest)] = np.inf
        if np.isfinite(apart).any():
            assert nearest[i] == apart.argmin() and lengths[i] == pytest.approx(apart.min())
        else:
            assert nearest[i] == -1


def test_contact_spheres_fill_the_legs(trousers):
    character, graph, _ = trousers
    contact = SelfContact(character, graph)
    legs = graph.positions[:, 1] < 0.6
    assert np.median(contact.radii[legs]) == pytest.approx(RADIUS, rel=0.25)
    assert contact.radii.min() > 0
    sides = np.sign(graph.positions[contact.pairs][:, :, 0]).prod(1)
    assert (sides < 0).mean() > 0.6, "mostly one leg against the other"


def crossed(graph, by):
    """Returns node positions with the left leg moved towards the right one, and through it."""
    moved = graph.positions.copy()
    moved[(moved[:, 0] > 0) & (moved[:, 1] < 0.6), 0] -= by
    return np.tile(np.eye(3), (len(moved), 1, 1)), moved


def test_limbs_that_do_not_touch_are_left_alone(trousers):
    character, graph, _ = trousers
    contact = SelfContact(character, graph)
    for state in (rest(graph), crossed(graph, 0.1)):
        planes = contact.planes(*state)
        assert (slack(planes, graph, *state) >= -1e-9).all(), "one-sided planes that hold pull nothing"


def test_limbs_that_overlap_are_pushed_back_the_way_they_came(trousers):
    """This also holds if the centres of two facing balls have passed each other."""
    character, graph, _ = trousers
    contact = SelfContact(character, graph)
    for by in np.arange(0, 0.34, 0.02):
        state = crossed(graph, by)
        planes = contact.planes(*state)
    violated = slack(planes, graph, *state) < -1e-3
    count = len(planes) // 2
    level = np.abs(planes.points[:count, 1] - planes.points[count:, 1]) < 0.02
    facing = violated & np.tile(level, 2)
    assert facing.sum() > 4 and planes.one_sided.all()
    left = planes.points[facing, 0] > 0
    assert (planes.normals[facing][left, 0] > 0.3).all() and (planes.normals[facing][~left, 0] < -0.3).all()


def test_surface_stays_above_the_floor(trousers):
    character, graph, _ = trousers
    floor = FloorContact(character, FloorSettings(use="above"))
    planes = floor.planes(*rest(graph), 0.03)
    assert (slack(planes, graph, *rest(graph)) >= -1e-9).all(), "at rest nothing is pushed"
    sunk = (rest(graph)[0], graph.positions - [0, 0.05, 0])
    planes = floor.planes(*sunk, 0.03)
    gaps = slack(planes, graph, *sunk)
    assert (gaps < -0.04).sum() >= 2 and planes.one_sided.all()
    np.testing.assert_array_equal(planes.normals, np.tile([0, 1, 0], (len(planes), 1)))
    high = (rest(graph)[0], graph.positions + UP / 2)
    assert floor.planes(*high, 0.03) is None


@given(way=st.floats(-0.5, 0.5), floor=st.floats(-0.2, 0.0))
def test_raised_mesh_keeps_shape_and_touches_the_floor(trousers, way, floor):
    character, graph, _ = trousers
    contact = FloorContact(character, FloorSettings(use="raised"))
    linear, positions = rest(graph)
    moved = positions + np.array([0.0, way, 0.0])
    raised = contact.raise_above_floor(linear, moved, floor)
    lift = raised - moved
    np.testing.assert_allclose(lift, np.tile([0.0, lift[0, 1], 0.0], (len(lift), 1)), atol=1e-12)
    lowest = contact.soles.deform_points(linear, raised)[:, 1].min()
    ground = min(floor, float(character.vertices[:, 1].min()))
    assert lowest >= ground - 1e-6
    assert lift[0, 1] == 0.0 or lowest == pytest.approx(ground, abs=1e-6), "no higher than it must"


def play(floor, graph, ways, seconds=1 / 30):
    """Returns the contact states of the feet over frames in which the whole mesh is moved by ``ways`` (F,
    3).
    """
    out = []
    for way in ways:
        planes = floor.planes(rest(graph)[0], graph.positions + way, seconds)
        out.append(([foot.lock_strength for foot in floor.feet], planes))
    return out


def test_a_foot_that_is_still_stands_and_one_that_is_drawn_away_lets_go(trousers):
    character, graph, _ = trousers
    own = FloorSettings(use="stand")
    floor = FloorContact(character, own)
    assert len(floor.feet) == 2
    still = play(floor, graph, np.zeros((20, 3)))
    assert still[0][0] == [0, 0] and still[-1][0] == [1, 1]
    firms = np.array([firm for firm, _ in still])[:, 0]
    assert np.diff(firms).max() < 0.3, "it comes to stand little by little"
    pins = still[-1][1]
    assert (~pins.one_sided).sum() == 2 * len(floor.soles)
    assert np.abs(slack(pins, graph, *rest(graph))[~pins.one_sided]).max() < 1e-6
    drawn = play(floor, graph, np.linspace([0, 0, 0], [0.12, 0, 0], 15))
    assert drawn[-1][0] == [0, 0]
    firms = np.array([firm for firm, _ in drawn])[:, 0]
    assert np.abs(np.diff(firms)).max() < 0.3, "it lets go little by little"


def test_a_foot_that_sways_a_little_stands_on_and_one_in_the_air_does_not(trousers):
    character, graph, _ = trousers
    floor = FloorContact(character, FloorSettings(use="stand"))
    play(floor, graph, np.zeros((20, 3)))
    sway = 0.03 * np.sin(np.linspace(0, 12, 60))[:, None] * [1, 0, 0]
    assert min(min(firm) for firm, _ in play(floor, graph, sway)) == 1
    play(floor, graph, np.tile([0, 0.2, 0], (20, 1)))
    assert [foot.contact_points for foot in floor.feet] == [None, None]


def test_contacts_can_be_set_from_toml_words():
    assert not SelfContactSettings().use and FloorSettings().use == "off"
