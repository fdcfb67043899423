"""Tests of placing a standing person in a mesh, for any position and rotation of the mesh."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.meshes.mesh import Mesh
from enliven.person.joints import PARENTS, Joint
from enliven.possession.likeness.standing_person import (
    ProximityGrid,
    fit_figures,
    fit_standing_person,
    make_standing_figure,
)
from enliven.possession.placement import rotation_about_y

FRONT = np.array([0.0, 0.0, 1.0])


def box(low: tuple[float, float, float], high: tuple[float, float, float], cuts: int = 6) -> Mesh:
    """Returns a closed box with many triangles."""
    t = np.linspace(0.0, 1.0, cuts)
    a, b = (g.reshape(-1) for g in np.meshgrid(t, t, indexing="ij"))
    vertices, faces = [], []
    for axis in range(3):
        for end in (0.0, 1.0):
            points = np.insert(np.stack([a, b], 1), axis, end, axis=1)
            k = np.arange(cuts * cuts).reshape(cuts, cuts)
            quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], -1).reshape(-1, 4)
            # The winding is counter-clockwise from outside, for the far side of X and Z, and for the near
            # side of Y.
            quads = quads if (end == 1.0) == (axis != 1) else quads[:, ::-1]
            start = len(vertices) * cuts * cuts
            faces += [quads[:, [0, 1, 2]] + start, quads[:, [0, 2, 3]] + start]
            vertices.append(points)
    size = np.array(high) - low
    return Mesh(np.concatenate(vertices) * size + low, np.concatenate(faces))


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + s for m, s in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


@pytest.fixture(scope="module")
def horse() -> Mesh:
    """Returns a horse towards +X: four legs, a trunk, a neck and a head."""
    legs = [box((x, 0.0, z), (x + 0.12, 0.9, z + 0.1)) for x in (-0.7, 0.45) for z in (-0.18, 0.08)]
    trunk, neck = box((-0.75, 0.85, -0.2), (0.62, 1.3, 0.2)), box((0.5, 1.2, -0.08), (0.7, 1.75, 0.08))
    return joined(*legs, trunk, neck, box((0.6, 1.55, -0.07), (1.0, 1.75, 0.07)))


@pytest.fixture(scope="module")
def chair() -> Mesh:
    return make_chair()


def moved(mesh: Mesh, quarter: int, x: float, z: float, scale: float = 1.0) -> Mesh:
    turned = scale * mesh.vertices @ rotation_about_y(quarter * np.pi / 2).T + [x, 0.0, z]
    return Mesh(turned, mesh.faces, mesh.name, mesh.colours)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.integers(0, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.2, 5.0))
def test_the_chair_is_brought_back_to_where_it_was_made(chair, quarter, x, z, scale) -> None:
    back, fit = fit_standing_person(moved(chair, quarter, x, z, scale))
    assert np.abs(back.vertices / scale - chair.vertices).max() < 0.09
    assert fit > 0.25


def test_performer_in_horse_has_matching_legs_and_heading(horse) -> None:
    yaw, offset, _ = fit_figures(horse, [make_standing_figure()])
    np.testing.assert_allclose(rotation_about_y(yaw) @ FRONT, [1.0, 0.0, 0.0], atol=1e-6)
    assert abs(offset[2]) < 0.06
    assert min(abs(offset[0] - x) for x in (-0.64, 0.51)) < 0.12


def test_two_who_stand_apart_share_a_horse(horse) -> None:
    """Two people stand one behind the other at the distance of the legs. Each matches one pair of legs."""
    ahead, behind = make_standing_figure(), make_standing_figure()
    ahead[:, 2] += 0.57
    behind[:, 2] -= 0.58
    yaw, offset, _ = fit_figures(horse, [ahead, behind])
    # Both headings are accepted, since the pairs of legs are alike.
    assert abs((rotation_about_y(yaw) @ FRONT)[0]) == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(offset - [-0.07, 0.0, 0.0]) < 0.12


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_point_is_as_near_as_the_cell_that_it_is_in(seed) -> None:
    """One by one, in the grid and beyond it, against all points and places at once."""
    dice = np.random.default_rng(seed)
    given = dice.uniform(-1, 1, (20, 3))
    near = ProximityGrid(given, 0.2, 0.1)
    points, shifts = dice.uniform(-2, 2, (9, 3)), dice.uniform(-2, 2, (7, 3)) * [1, 0, 1]
    low, high = given.min(0) - 3 * 0.2, given.max(0) + 3 * 0.2
    counts = np.ceil((high - low) / near.cell).astype(int) + 1
    nearness = near.sample_shifted(points, shifts)
    for s, shift in enumerate(shifts):
        for p, point in enumerate(points):
            cell = np.round((point + shift - low) / near.cell).astype(int)
            length = np.linalg.norm(given - (low + cell * near.cell), axis=1).min()
            inside = (cell >= 0).all() and (cell < counts).all() and length < 4 * 0.2
            assert nearness[s, p] == pytest.approx(np.exp(-((length / 0.2) ** 2)) if inside else 0.0)


def test_only_the_meshs_position_changes(chair) -> None:
    other = moved(chair, 1, 2.0, 0.5)
    back, _ = fit_standing_person(other)
    lengths = [
        np.linalg.norm(m.vertices[m.faces[:, 0]] - m.vertices[m.faces[:, 1]], axis=1) for m in (other, back)
    ]
    np.testing.assert_allclose(*lengths, atol=1e-12)
    np.testing.assert_allclose(back.vertices[:, 1], other.vertices[:, 1], atol=1e-12)
    assert back.colours is other.colours


@pytest.mark.slow
def test_flat_and_wide_meshes_have_a_place_too() -> None:
    for mesh in (box((-40, 0, -40), (40, 0.5, 40)), box((-1, 0, 0), (1, 1.75, 0.0001))):
        back, fit = fit_standing_person(mesh)
        assert np.isfinite(back.vertices).all()
        assert 0.0 <= fit <= 1.0


def test_the_standing_figure_is_a_person(chair) -> None:
    joints = make_standing_figure(1.6)
    across = joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    assert across[0] > 0.1
    assert joints[:, 1].min() > 0
    assert 1.4 < joints[Joint.HEAD, 1] < 1.6
    for joint, parent in enumerate(PARENTS[1:], 1):
        assert 0.03 < np.linalg.norm(joints[joint] - joints[parent]) < 0.5
