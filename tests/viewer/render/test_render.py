"""Tests of the renderer: skinned positions, cues, shadows, and an empty stage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from enliven.document.character import Pose
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.camera import CameraView, OrbitCamera, look_at, make_perspective
from enliven_viewer.render.renderer import EMPTY_BOX, Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle
from enliven_viewer.settings import RenderSettings

SIZE = (256, 192)
BARE = SceneStyle(body=0, reveal=0, cues=0)


@pytest.fixture(scope="module")
def renderer(gl) -> Renderer:
    return Renderer(gl, SIZE, RenderSettings(shadow_size=128, contact_size=64))


def front_view(distance: float = 3.0, height: float = 0.6) -> CameraView:
    """Returns a camera on +Z that looks along -Z."""
    eye = np.array([0.0, height, distance])
    camera = look_at(eye, np.array([0.0, height, 0.0]))
    return CameraView(eye, camera, make_perspective(math.radians(40), SIZE[0] / SIZE[1], 0.05, 100))


def drawn(renderer: Renderer, scene: Scene, view: CameraView | None = None) -> np.ndarray:
    renderer.draw(scene, view or front_view())
    assert renderer.ctx.error == "GL_NO_ERROR"
    return renderer.pixels().astype(int)


def bent(character, seed: int = 1, stretch: bool = False) -> Pose:
    """Returns a pose with a rotation, and optionally a stretch, at every node."""
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(0, 1, (len(character.pivots), 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    linear = np.eye(3) + 0.4 * (turns - np.eye(3))
    if stretch:
        linear = linear @ np.diag([1.6, 0.7, 1.0])
    positions = character.pivots + rng.normal(0, 0.1, character.pivots.shape)
    return Pose(character.id, 0, linear.astype(np.float32), positions.astype(np.float32))


def skinned_by_hand(character, pose: Pose) -> np.ndarray:
    """Evaluates the equation in the docstring of ``Pose`` vertex by vertex."""
    moved = np.zeros((len(character.vertices), 3))
    for v, vertex in enumerate(character.vertices.astype(float)):
        for node, weight in zip(character.skin.indices[v], character.skin.weights[v], strict=True):
            moved[v] += weight * (
                pose.linear[node] @ (vertex - character.pivots[node]) + pose.positions[node]
            )
    return moved


@pytest.mark.parametrize("nodes", [1, 6, 300, 1500])
def test_skinning_is_the_equation_of_pose(renderer, make_character, make_box, nodes) -> None:
    character = make_character(*make_box((-0.3, 0, -0.2), (0.3, 1, 0.2)), nodes=nodes)
    pose = bent(character)
    (mesh,) = renderer.prepare_meshes(Scene((SceneCharacter(character, pose),), style=BARE))
    expected = skinned_by_hand(character, pose)
    places = mesh.positions()
    assert len(places) == 24
    assert np.abs(places[:, None] - expected[None]).max(-1).min(1).max() < 1e-4


def test_normals_stay_perpendicular_to_a_stretched_board(renderer, make_character, make_box) -> None:
    character = make_character(*make_box((-0.3, 0, -0.2), (0.3, 1, 0.2)), nodes=1)
    shear = np.array([[1.0, 0.8, 0.0], [0.0, 1.5, 0.3], [0.1, 0.0, 0.5]], np.float32)
    pose = Pose("box", 0, shear[None], character.pivots)
    (mesh,) = renderer.prepare_meshes(Scene((SceneCharacter(character, pose),), style=BARE))
    faces = np.frombuffer(mesh._faces.read(), np.int32).reshape(-1, 3)
    a, b, c = (mesh.positions()[faces[:, k]] for k in range(3))
    true = np.cross(b - a, c - a)
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", true, mesh.normals()[faces[:, 0]]).min() > 0.999


def test_a_box_covers_the_pixels_that_it_projects_to(renderer, box) -> None:
    view = front_view()
    empty = drawn(renderer, Scene(style=BARE), view)
    shown = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),), style=BARE), view)
    changed = np.abs(shown - empty).sum(-1) > 60
    front = np.array([[x, y, 0.25] for x in (-0.25, 0.25) for y in (0.0, 1.0)])
    corner = (view.project(front) + 1) / 2 * SIZE
    left, right = round(corner[:, 0].min()), round(corner[:, 0].max())
    top, bottom = round(SIZE[1] - corner[:, 1].max()), round(SIZE[1] - corner[:, 1].min())
    assert changed[top + 2 : bottom - 2, left + 2 : right - 2].mean() > 0.97
    assert changed[: top - 12].mean() < 0.01


def test_the_body_shows_through_near_it_and_only_there(renderer, box, make_body) -> None:
    body = make_body((0.0, 0.85, 0.20), confidence=1.0)
    joints = np.tile([0.0, 0.85, 0.22], (20, 1))
    body = replace(body, joints=joints)
    actor = SceneCharacter(box, box.rest_pose())
    view = front_view()
    solid = drawn(renderer, Scene((actor,), (body,), BARE), view)
    glass = drawn(renderer, Scene((actor,), (body,), replace(BARE, reveal=1.0)), view)
    changed = np.abs(glass - solid).sum(-1) > 12
    rows, columns = np.nonzero(changed)
    pixel = ((view.project(joints[:1])[0] * [1, -1] + 1) / 2 * SIZE)[::-1]
    away = np.hypot(rows - pixel[0], columns - pixel[1])
    metre = SIZE[1] / (2 * 3.0 * math.tan(math.radians(20)))
    assert changed[int(pixel[0]), int(pixel[1])]
    assert away.max() < 1.25 * metre * (0.04 * 1.6 + 0.10)


def test_body_without_confidence_reveals_nothing(renderer, box, make_body) -> None:
    actor, guess = SceneCharacter(box, box.rest_pose()), make_body((0, 0.8, 0.2), confidence=0.0)
    solid = drawn(renderer, Scene((actor,), (guess,), BARE))
    glass = drawn(renderer, Scene((actor,), (guess,), replace(BARE, reveal=1.0)))
    # The spotlight moves towards the scene from one frame to the next.
    assert np.abs(solid - glass).max() <= 5


def test_a_body_inside_the_mesh_is_seen(renderer, box, make_body) -> None:
    body = replace(make_body(), joints=np.tile([0.0, 0.6, 0.0], (20, 1)))
    actor = SceneCharacter(box, box.rest_pose())
    without = drawn(renderer, Scene((actor,), (), SceneStyle()))
    within = drawn(renderer, Scene((actor,), (body,), SceneStyle(reveal=0)))
    assert np.abs(within - without)[80:110, 110:146].max() > 10


def test_attachment_points_glow_where_the_nodes_are(renderer, box) -> None:
    node = int(np.argmax(box.pivots[:, 2]))
    cues = CueFrame("box", np.array([node], np.int32), np.array([1.0], np.float32))
    view = front_view()
    points = SceneStyle(held=0.0)
    plain = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),)), view)
    glowing = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose(), cues),), style=points), view)
    gain = (glowing - plain).sum(-1)
    row, column = np.unravel_index(gain.argmax(), gain.shape)
    at = (view.project(box.pivots[[node]].astype(float))[0] * [1, -1] + 1) / 2 * SIZE
    assert gain.min() >= -3
    assert np.hypot(column - at[0], row - at[1]) < 6


def test_cues_of_nodes_that_are_not_there_are_left_out(renderer, box) -> None:
    cues = CueFrame("box", np.array([999], np.int32), np.array([1.0], np.float32))
    marked = drawn(
        renderer, Scene((SceneCharacter(box, box.rest_pose(), cues),), style=SceneStyle(graph=1.0))
    )
    plain = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),), style=SceneStyle(graph=1.0)))
    assert np.abs(marked - plain).max() <= 1


def test_the_box_casts_a_shadow_away_from_the_light(renderer, box) -> None:
    camera = OrbitCamera(math.radians(40))
    camera.frame((np.array([-1.5, 0, -1.5]), np.array([1.5, 1, 1.5])), 4 / 3, at_once=True)
    camera.orbit(0.0, 1.2)
    camera.advance(10)
    view = camera.view(4 / 3)
    shown = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),), style=BARE), view)
    behind, beside = np.array([[-0.45, 0.0, -0.55]]), np.array([[0.45, 0.0, 0.55]])

    def floor_at(place: np.ndarray) -> float:
        x, y = (view.project(place)[0] * [1, -1] + 1) / 2 * SIZE
        return float(shown[int(y) - 2 : int(y) + 3, int(x) - 2 : int(x) + 3].mean())

    assert floor_at(behind) < 0.6 * floor_at(beside)


def test_a_mesh_with_large_faces_and_one_with_holes_are_drawn(renderer, make_character, make_box) -> None:
    vertices, faces = make_box((-0.3, 0, -0.2), (0.3, 1, 0.2))
    empty = drawn(renderer, Scene(style=BARE))
    for some in (faces, faces[2:]):
        shown = drawn(
            renderer,
            Scene((SceneCharacter(c := make_character(vertices, some, nodes=3), c.rest_pose()),), style=BARE),
        )
        assert (np.abs(shown - empty).sum(-1) > 60).mean() > 0.1


def test_an_empty_scene_has_a_floor_and_a_horizon(renderer) -> None:
    camera = OrbitCamera()
    camera.frame(EMPTY_BOX, 4 / 3, at_once=True)
    picture = drawn(renderer, Scene(), camera.view(4 / 3))
    assert picture[-20:].mean() > 2 * picture[:5].mean()
    assert picture.std() > 20


def test_a_pose_that_is_not_finite_draws(renderer, box) -> None:
    broken = Pose("box", 0, np.full((6, 3, 3), np.nan, np.float32), np.full((6, 3), np.inf, np.float32))
    drawn(renderer, Scene((SceneCharacter(box, broken),), style=SceneStyle()))
    after = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),), style=SceneStyle()))
    assert after.std() > 30, "what follows a broken pose is drawn as ever"


def test_characters_are_added_and_removed(renderer, box, make_character, make_box) -> None:
    other = replace(make_character(*make_box((1, 0, 0), (1.2, 1, 0.3)), nodes=2), id="other")
    drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()), SceneCharacter(other, other.rest_pose()))))
    assert set(renderer._meshes) == {"box", "other"}
    drawn(renderer, Scene((SceneCharacter(other, other.rest_pose()),)))
    assert set(renderer._meshes) == {"other"}


def test_resizing_and_a_minimised_window(renderer) -> None:
    renderer.resize((100, 60))
    assert drawn(renderer, Scene()).shape == (60, 100, 3)
    renderer.resize((0, 0))
    assert renderer.size == (100, 60)
    renderer.resize(SIZE)


@pytest.mark.parametrize("samples", [1, 4])
def test_image_is_similar_without_multisampling(gl, box, samples) -> None:
    renderer = Renderer(gl, (64, 48), RenderSettings(samples=samples, shadow_size=64, contact_size=32))
    picture = drawn(renderer, Scene((SceneCharacter(box, box.rest_pose()),)))
    assert picture.shape == (48, 64, 3) and picture.std() > 5
