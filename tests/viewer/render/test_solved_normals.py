"""Tests of the drawn normals of solved vertices: against rest normals, a slow reference and the skinning
shader.
"""

from __future__ import annotations

import numpy as np
import pytest
from sample_meshes.chair import make_chair

from enliven.arrays import Float
from enliven.document.character import Character, Pose, SkinWeights
from enliven.rotation import from_rotation_vector, to_matrix
from enliven_viewer.render.camera import CameraView, OrbitCamera
from enliven_viewer.render.normals import make_solved_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle
from enliven_viewer.render.surface import split_creases
from enliven_viewer.settings import RenderSettings

CHAIR = make_chair(0.025)
VERTICES, FACES = CHAIR.vertices.astype(np.float32), CHAIR.faces
SURFACE = split_creases(VERTICES, FACES)
SIZE = (200, 160)


def slow(vertices: Float) -> Float:
    """Returns the sum of unit normals of each group's corner faces, weighted by the corner angles at rest."""
    rows = np.zeros((len(SURFACE.source), 6))
    a, b, c = (vertices[FACES[:, k]].astype(float) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for n, (source, group) in enumerate(zip(SURFACE.source, SURFACE.group, strict=True)):
        corners = np.argwhere(SURFACE.groups == group)
        total = sum(SURFACE.angles[f, k] * normals[f] for f, k in corners)
        rows[n] = *vertices[source], *(total / np.linalg.norm(total))
    return rows


def rigid(character: Character) -> Pose:
    """Returns the character after a rigid motion."""
    turn = to_matrix(from_rotation_vector(np.array([0.3, 0.7, -0.2])))
    places = character.pivots @ turn.T + [0.2, 0.1, -0.1]
    count = len(character.pivots)
    return Pose(character.id, 0, np.tile(turn, (count, 1, 1)).astype(np.float32), places.astype(np.float32))


@pytest.fixture
def character() -> Character:
    """Returns the chair, with one transform."""
    indices = np.zeros((len(VERTICES), 4), np.uint16)
    weights = np.tile(np.float32([1, 0, 0, 0]), (len(VERTICES), 1))
    skin, pivots = SkinWeights(indices, weights), np.zeros((1, 3), np.float32)
    return Character("chair", VERTICES, FACES, skin, pivots, np.zeros((0, 2), np.int32))


def view() -> CameraView:
    camera = OrbitCamera(0.6)
    camera.frame((VERTICES.min(0) - 0.3, VERTICES.max(0) + 0.3), SIZE[0] / SIZE[1], at_once=True)
    return camera.view(SIZE[0] / SIZE[1])


def test_normals_at_rest_equal_the_skinned_mesh() -> None:
    rows = make_solved_rows(VERTICES, FACES, SURFACE)
    np.testing.assert_array_equal(rows[:, :3], VERTICES[SURFACE.source])
    np.testing.assert_allclose(rows[:, 3:], SURFACE.normals, atol=1e-5)


@pytest.mark.slow
def test_moved_normals_match_the_slow_reference() -> None:
    moved = VERTICES + np.random.default_rng(0).normal(0, 0.004, VERTICES.shape).astype(np.float32)
    np.testing.assert_allclose(make_solved_rows(moved, FACES, SURFACE), slow(moved), atol=1e-5)


def test_nan_vertices_and_empty_faces_give_finite_normals() -> None:
    broken = VERTICES.copy()
    broken[:40], broken[40], broken[41] = 0.0, np.nan, np.inf
    rows = make_solved_rows(broken, FACES, SURFACE)
    assert np.isfinite(rows).all()
    np.testing.assert_allclose(np.linalg.norm(rows[:, 3:], axis=1), 1.0, atol=1e-5)


def test_the_picture_of_solved_vertices_is_that_of_the_same_vertices_skinned(gl, character) -> None:
    renderer = Renderer(gl, SIZE, RenderSettings(shadow_size=128, contact_size=64))
    bare, pose = SceneStyle(body=0, reveal=0, cues=0), rigid(character)
    room = np.full(3, -1.5), np.full(3, 1.5)  # equal bounds, so that both shadow maps cover the same area
    renderer.draw(Scene((SceneCharacter(character, pose),), style=bare, extent=room), view())
    skinned = renderer.pixels().astype(int)
    where = VERTICES @ pose.linear[0].T + pose.positions[0]
    renderer.draw(Scene((SceneCharacter(character, pose, vertices=where),), style=bare, extent=room), view())
    assert renderer.ctx.error == "GL_NO_ERROR"
    solved = renderer.pixels().astype(int)
    assert skinned.std() > 10
    assert (np.abs(solved - skinned).max(2) > 6).mean() < 0.003


def test_a_camera_has_the_whole_of_what_was_solved_in_its_picture(character) -> None:
    where = (VERTICES + np.array([5.0, 0.0, 0.0])).astype(np.float32)
    box = Scene((SceneCharacter(character, character.rest_pose(), vertices=where),)).box
    assert box is not None
    assert (box[0] <= where.min(0)).all()
    assert (box[1] >= where.max(0)).all()
    assert box[0][0] > 3.0
