"""Tests of surfaces from scans: visible surface is present and faces the sensor; gaps, steps and hidden sides
are open.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.meshes.files import load_mesh
from enliven.meshes.scan_surface import parse_pcd, surface_through_points


def ball(centre: np.ndarray, radius: float, count: int = 20_000) -> np.ndarray:
    """Returns (count, 3) points spread evenly over a sphere."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, k * np.pi * (1 + 5**0.5)
    level = np.sqrt(1 - height**2)
    return centre + radius * np.stack([level * np.cos(turn), height, level * np.sin(turn)], -1)


@settings(max_examples=8, deadline=None)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(1.0, 4.0), st.floats(0.15, 0.4))
def test_of_a_ball_the_near_half_is_there_and_faces_the_sensor(x, y, away, radius) -> None:
    viewpoint, centre = np.array([x, y, 0.5]), np.array([0.2, 0.9, -away])
    mesh = surface_through_points(ball(centre, radius), viewpoint)
    distance = np.linalg.norm(mesh.vertices - centre, axis=1)
    assert np.abs(distance - radius).max() < 0.01
    towards = viewpoint - centre
    # Less than half of a ball is visible, depending on its distance, and its rim is seen at too flat an
    # angle.
    seen = 2 * np.pi * radius**2 * (1 - radius / np.linalg.norm(towards))
    assert 0.65 * seen < mesh.area < 1.1 * seen
    middles = mesh.vertices[mesh.faces].mean(1)
    assert ((mesh.face_vectors() * (viewpoint - middles)).sum(1) > 0).all()


def test_a_step_and_a_gap_stay_open() -> None:
    x, y = (g.reshape(-1) for g in np.meshgrid(np.arange(0, 0.6, 0.008), np.arange(0, 0.6, 0.008)))
    depth = np.where(x < 0.3, 2.0, 2.2)
    points = np.stack([x, y, -depth], -1)[(x < 0.4) | (x > 0.46)]
    mesh = surface_through_points(points, np.zeros(3))
    corners = mesh.vertices[mesh.faces]
    assert np.ptp(corners[..., 2], axis=1).max() < 0.05
    assert np.ptp(corners[..., 0], axis=1).max() < 0.05
    assert mesh.area == pytest.approx(0.3 * 0.6 + 0.07 * 0.6 + 0.13 * 0.6, rel=0.1)  # 3 cm are hidden


def test_unmeasured_areas_and_specks_are_left_out() -> None:
    points = ball(np.array([0.0, 0.0, -2.0]), 0.3)
    specks = np.array([[1.0, 1.0, -2.0], [1.005, 1.0, -2.0], [1.0, 1.008, -2.0], [np.nan, 0.0, -2.0]])
    mesh = surface_through_points(np.concatenate([points, specks]), np.zeros(3))
    assert mesh.vertices[:, 0].max() < 0.4


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_points_are_reported(count: int) -> None:
    with pytest.raises(InputError, match="too few for a surface"):
        surface_through_points(np.ones((count, 3)), np.zeros(3))


def pcd(path: Path, points: np.ndarray, kind: str) -> Path:
    """Writes a PCD file with padding and a colour before the points, measured from (0, 1, 0)."""
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y z _\nSIZE 4 4 4 4 1\nTYPE U F F F U\nCOUNT 1 1 1 1 4\n"
    head += f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 1 0 1 0 0 0\nPOINTS {len(points)}\nDATA {kind}\n"
    if kind == "ascii":
        rows = "\n".join(f"7 {x:.9g} {y:.9g} {z:.9g} 0 0 0 0" for x, y, z in points)
        path.write_text(head + rows + "\n")
        return path
    rows = np.zeros(len(points), np.dtype([("rgb", "<u4"), ("xyz", "<f4", 3), ("_", "u1", 4)]))
    rows["xyz"] = points
    path.write_bytes(head.encode() + rows.tobytes())
    return path


@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_pcd_files_are_read_and_become_meshes(tmp_path, kind) -> None:
    points = ball(np.array([0.1, 0.9, -2.0]), 0.25, 4000).astype(np.float32)
    path = pcd(tmp_path / "person.pcd", points, kind)
    read, viewpoint = parse_pcd(path.read_bytes(), "person.pcd")
    np.testing.assert_allclose(read, points, rtol=1e-6)
    np.testing.assert_array_equal(viewpoint, [0.0, 1.0, 0.0])
    mesh = load_mesh(path).mesh
    assert mesh.name == "person"
    assert np.abs(np.linalg.norm(mesh.vertices - [0.1, 0.9, -2.0], axis=1) - 0.25).max() < 0.01


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: b"solid\n" + data[200:], "not a PCD file"),
        (lambda data: data[:-500], "do not match its header"),
        (lambda data: data.replace(b"DATA binary", b"DATA binary_compressed"), "binary_compressed"),
        (lambda data: data.replace(b"rgb x y z", b"rgb u v w"), "do not match its header"),
    ],
)
def test_damaged_pcd_files_are_reported(tmp_path, damage, said) -> None:
    path = pcd(tmp_path / "a.pcd", ball(np.array([0.0, 0.0, -2.0]), 0.3, 500), "binary")
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match=said) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value)
