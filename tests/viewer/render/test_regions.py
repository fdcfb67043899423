"""Tests that rendering only the occupied regions gives the same image as rendering everything."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from enliven.document.character import Pose
from enliven.document.props import BALL, BOX, Props
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render import renderer as renderer_module
from enliven_viewer.render.camera import CameraView, look_at, make_perspective
from enliven_viewer.render.capsules import make_capsule_template
from enliven_viewer.render.drawn_regions import find_visible_region
from enliven_viewer.render.gl.region import full_region, regions_around
from enliven_viewer.render.overlay.tubes import Tubes, make_tube_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle
from enliven_viewer.render.surface import order_along_morton_curve
from enliven_viewer.settings import RenderSettings

SIZE = (320, 180)
SMALL = RenderSettings(shadow_size=128, contact_size=64)
ROUNDING = 2
"""Tolerance in levels of 255. A dither or a sample's weight may be rounded differently."""


def side_view(distance: float = 4.0) -> CameraView:
    """Returns a camera in front and slightly above, with space around the scene."""
    eye = np.array([0.4, 1.6, distance])
    return CameraView(
        eye,
        look_at(eye, np.array([0.0, 0.5, 0.0])),
        make_perspective(math.radians(40), SIZE[0] / SIZE[1], 0.05, 100),
    )


def bent(character, seed: int = 1) -> Pose:
    """Returns a pose that rotates, stretches and moves every node."""
    rng = np.random.default_rng(seed)
    linear = np.eye(3) + 0.3 * rng.normal(0, 1, (len(character.pivots), 3, 3))
    positions = character.pivots + rng.normal(0, 0.1, character.pivots.shape)
    return Pose(character.id, 0, linear.astype(np.float32), positions.astype(np.float32))


def full_scene(box, make_body) -> Scene:
    """Draws a bent box with a body in it, attachment points, and two props next to it."""
    cues = CueFrame("box", np.arange(3, dtype=np.int32), np.ones(3, np.float32))
    props = Props(
        0,
        np.array([1, 2]),
        np.array([BOX, BALL], np.uint8),
        np.array([[0.1, 0.2, 0.15], [0.12, 0.12, 0.12]], np.float32),
        np.array([[200, 80, 60], [80, 90, 210]], np.uint8),
        np.array([[0.9, 0.2, 0.1], [-0.8, 0.5, 0.3]]),
        np.array([[0.9, 0.1, 0.3, 0.3], [1.0, 0.0, 0.0, 0.0]]) / [[1.0], [1.0]],
    )
    return Scene(
        (SceneCharacter(box, bent(box), cues),), (make_body((0.0, 0.7, 0.1)),), SceneStyle(graph=0.5), props
    )


@pytest.mark.parametrize("samples", [1, 4])
def test_region_rendering_matches_full_rendering(gl, box, make_body, monkeypatch, samples) -> None:
    settings = replace(SMALL, samples=samples)
    scene, view = full_scene(box, make_body), side_view()
    narrow = Renderer(gl, SIZE, settings)
    narrow.draw(scene, view)
    region = narrow.picture.region
    assert region[2] * region[3] < 0.75 * SIZE[0] * SIZE[1], "there is something to leave out"
    monkeypatch.setattr(renderer_module, "find_visible_region", lambda _p, _c, size, _r=0: full_region(size))
    monkeypatch.setattr(
        renderer_module, "find_shadow_bounds", lambda *_: (np.full(2, -np.inf), np.full(2, np.inf))
    )
    wide = Renderer(gl, SIZE, settings)
    wide.draw(scene, view)
    assert wide.picture.region == full_region(SIZE)
    apart = np.abs(narrow.pixels().astype(int) - wide.pixels())
    assert apart.max() <= ROUNDING
    assert gl.error == "GL_NO_ERROR"


@pytest.mark.parametrize("nodes", [1, 6, 40])
def test_a_hull_holds_every_vertex(gl, make_character, make_box, nodes) -> None:
    character = make_character(*make_box((-0.3, 0, -0.2), (0.3, 1, 0.2)), nodes=nodes)
    renderer, view = Renderer(gl, SIZE, SMALL), side_view()
    ways = np.random.default_rng(0).normal(0, 1, (3, 200))
    for actor in (
        SceneCharacter(character, bent(character)),
        SceneCharacter(character, character.rest_pose(), vertices=character.vertices + np.float32(0.3)),
    ):
        (mesh,) = renderer.prepare_meshes(Scene((actor,)))
        places, hull = mesh.positions().astype(float), mesh.hull()
        assert ((places @ ways).max(0) <= (hull @ ways).max(0) + 1e-5).all()
        x, y, width, height = find_visible_region(hull, view.clip_from_world, SIZE)
        pixels = (view.project(places) + 1) / 2 * SIZE
        assert (pixels >= [x, y]).all() and (pixels <= [x + width, y + height]).all()


def test_points_behind_the_eye_need_the_full_region() -> None:
    view = side_view()
    before, behind = np.array([[0.0, 0.5, 0.0]]), view.eye[None] + [0.0, 0.0, 1.0]
    assert find_visible_region(before, view.clip_from_world, SIZE)[2] < 20
    assert find_visible_region(np.concatenate([before, behind]), view.clip_from_world, SIZE) == full_region(
        SIZE
    )
    assert find_visible_region(np.full((1, 3), np.nan), view.clip_from_world, SIZE) == full_region(SIZE)
    assert find_visible_region(np.zeros((0, 3)), view.clip_from_world, SIZE)[2:] == (0, 0)


@pytest.mark.parametrize(
    "region", [(0, 0, 0, 0), (3, 4, 5, 6), (0, 0, 20, 5), (7, 0, 13, 12), (0, 0, 20, 12)]
)
def test_region_and_background_equal_the_whole_picture(region) -> None:
    count = np.zeros((12, 20), int)
    for x, y, width, height in [region, *regions_around(region, (20, 12))]:
        count[y : y + height, x : x + width] += 1
    assert (count == 1).all()


def test_overlays_may_be_drawn_outside_the_region(gl, box) -> None:
    renderer, view = Renderer(gl, SIZE, SMALL), side_view()
    renderer.draw(Scene((SceneCharacter(box, box.rest_pose()),), style=SceneStyle(0, 0, 0)), view)
    before = renderer.pixels().astype(int)
    at = np.array([[1.3, 0.8, 0.0]])
    x, y, width, height = renderer.picture.region
    across, up = ((view.project(at) + 1) / 2 * SIZE)[0]
    assert not (x <= across < x + width and y <= up < y + height)
    rows = make_tube_rows(at, at, np.array([0.08]), np.array([[0.9, 0.2, 0.1]], np.float32))
    Tubes(gl).draw(renderer.picture, rows, 0.0)
    changed = np.abs(renderer.pixels() - before).max(-1) > ROUNDING
    rows_, columns = np.nonzero(changed)
    assert changed.sum() > 20
    assert np.hypot(columns - across, rows_ - (SIZE[1] - up)).max() < 12


def test_with_one_sample_what_is_behind_glass_is_seen_too(gl, box, make_body) -> None:
    body = replace(make_body(), joints=np.tile([0.0, 0.6, 0.22], (20, 1)))
    actors, pictures = (SceneCharacter(box, box.rest_pose()),), []
    for samples, reveal in ((4, 0.0), (4, 1.0), (1, 1.0)):
        renderer = Renderer(gl, SIZE, replace(SMALL, samples=samples))
        renderer.draw(Scene(actors, (body,), SceneStyle(0.0, reveal, 0.0)), side_view())
        pictures.append(renderer.pixels().astype(int))
    solid, glass, alone = pictures
    through = np.abs(glass - solid).max(-1) > 20
    assert through.sum() > 40
    assert np.abs(glass - alone)[through].mean() < 3


def test_neighbours_are_drawn_in_turn() -> None:
    """In software OpenGL's cache of 256 vertices, the new order has at most half as many misses."""
    side = 60
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    vertices = np.stack([u, np.sin(0.1 * u * v), v], -1).reshape(-1, 3).astype(np.float32)
    first = (u[:-1, :-1] * side + v[:-1, :-1]).ravel()
    faces = np.concatenate([first[:, None] + [0, 1, side], first[:, None] + [side, 1, side + 1]]).astype(
        np.int32
    )
    shuffled = np.random.default_rng(0).permutation(faces)
    ordered = order_along_morton_curve(vertices, shuffled)
    assert {tuple(face) for face in ordered.tolist()} == {tuple(face) for face in faces.tolist()}
    assert len(ordered) == len(faces) and misses(ordered) < 0.5 * misses(shuffled)
    assert misses(ordered) < 1.6 * len(vertices)
    assert len(order_along_morton_curve(vertices, faces[:0])) == 0


def misses(faces: np.ndarray, size: int = 256) -> int:
    """Returns the number of vertex cache misses."""
    kept, count = [-1] * size, 0
    for vertex in faces.ravel().tolist():
        if kept[vertex % size] != vertex:
            kept[vertex % size] = vertex
            count += 1
    return count


@pytest.mark.parametrize(("rings", "ball", "ends"), [(5, True, 0), (5, False, 0), (1, False, 2)])
def test_capsules_are_closed_but_for_limbs_between_balls(rings, ball, ends) -> None:
    segments = 18
    vertices, faces = make_capsule_template(segments, rings, ball=ball)
    np.testing.assert_allclose(np.linalg.norm(vertices[:, :3], axis=1), 1.0, atol=1e-6)
    places = vertices[:, :3] + [[0.0, 0.0 if ball else 2.0, 0.0]] * vertices[:, 3:]
    a, b, c = (places[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals, axis=1).min() > 1e-3, "no face is nothing"
    middle = (a + b + c) / 3
    middle[:, 1] -= np.clip(middle[:, 1], 0.0, 0.0 if ball else 2.0)
    assert (np.einsum("ij,ij->i", normals, middle) > 0).all(), "faces turn outwards"
    same = np.unique(places.round(4), axis=0, return_inverse=True)[1].reshape(-1)[faces]
    edges = np.sort(np.concatenate([same[:, [0, 1]], same[:, [1, 2]], same[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).sum() == ends * segments and count.max() == 2
