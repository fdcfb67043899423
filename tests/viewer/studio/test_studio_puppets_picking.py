"""Tests of rays, gizmo handles, control points under the pointer, and mirror images."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from made_studio_puppets import SIDES, TIPS, project_with, star, vertex

from enliven.document.puppet import ExampleCharacter
from enliven.examples.puppet_motion import convert_to_world_frame
from enliven.modeling.edits import move_character, turn_character
from enliven.modeling.puppet.poses import set_symmetry
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.puppets.gizmo import (
    ARROW_LENGTH_PX,
    FINGER_GRAB_DISTANCE_PX,
    GIZMO_PARTS,
    Gizmo,
)
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.puppets.symmetry import find_partner_vertex, mirror_places
from enliven_viewer.studio.viewport.picking import find_joint_at, find_surface_at
from enliven_viewer.studio.viewport.ray import NEAREST, find_first_hit, find_hit_vertex

PLACE = np.array([0.1, 0.5, -0.2])


def editor_with(*names: str) -> Editor:
    editor = Editor(project=project_with(*names))
    get_puppet_editor(editor)  # This call registers the editor of puppets, as the workspace does.
    editor.size = (640.0, 480.0)
    editor.frame_all(at_once=True)
    editor.select_only("star")
    return editor


@cache
def seen() -> Editor:
    """Returns a view with a camera that can be rotated."""
    return editor_with()


@cache
def five() -> ExampleCharacter:
    """Returns the star with a control point at each end, and its symmetry plane."""
    names = ("left", "right", "head", "foot", "other")
    return set_symmetry(project_with(*names), "star", SIDES).puppets["star"]


def pixel_of(editor: Editor, place: np.ndarray) -> tuple[float, float]:
    x, y = editor.lens.project(np.asarray(place)[None])[0][0]
    return float(x), float(y)


def first_face(vertices, faces, eye, way):
    """Returns the nearest face on a ray and its distance, computed for all faces at once."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    side, other, arm = b - a, c - a, eye - a
    across, turned = np.cross(way, other), np.cross(arm, side)
    determinant = np.einsum("fi,fi->f", side, across)
    safe = np.where(np.abs(determinant) > 1e-18, determinant, np.nan)
    u, v = np.einsum("fi,fi->f", arm, across) / safe, turned @ way / safe
    distance = np.einsum("fi,fi->f", other, turned) / safe
    with np.errstate(invalid="ignore"):
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > NEAREST)
    return (int(np.where(met, distance, np.inf).argmin()), distance[met].min()) if met.any() else (-1, np.inf)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_compiled_ray_matches_the_slow_reference(seed: int) -> None:
    rng, mesh = np.random.default_rng(seed), star()
    eye = rng.normal(0, 1, 3) * 2 + [0, 0.5, 0]
    way = rng.normal([0.0, 0.5, 0.0], 0.3) - eye
    way /= np.linalg.norm(way)
    face, distance = find_first_hit(mesh.vertices, mesh.faces, eye, way)
    slow, metres = first_face(mesh.vertices, mesh.faces, eye, way)
    assert face == slow or distance == pytest.approx(metres), "a ray through an edge may meet either face"
    assert distance == pytest.approx(metres)


def test_of_a_face_the_nearest_corner_is_taken() -> None:
    mesh = star()
    face = mesh.faces[7]
    for corner in face:
        near = 0.9 * mesh.vertices[corner] + 0.1 * mesh.vertices[face].mean(0)
        assert find_hit_vertex(mesh.vertices, face, near) == corner


@pytest.mark.parametrize("name", TIPS)
def test_a_puppet_is_picked_where_it_stands(name: str) -> None:
    editor = editor_with()
    turn = from_rotation_vector(np.array([0.0, 0.7, 0.0]))
    editor.edit("away", lambda p: turn_character(move_character(p, "star", [0.6, 0.2, -0.3]), "star", turn))
    standing = get_puppet_editor(editor).stage_puppets[0]
    middle = standing.vertices.mean(0)
    place = standing.vertices[vertex(name)] * 0.93 + middle * 0.07
    hit = find_surface_at(editor.stage_characters, editor.lens, pixel_of(editor, place))
    assert hit is not None and hit.character == standing.id
    met = editor.lens.view.eye + hit.depth * editor.lens.ray(pixel_of(editor, place))
    assert np.linalg.norm(met - place) < 0.15
    assert find_surface_at(editor.stage_characters, editor.lens, (3.0, 3.0)) is None


def test_points_are_transformed_into_the_mesh_and_back() -> None:
    editor = editor_with("head")
    turn = from_rotation_vector(np.array([0.3, 0.7, -0.2]))
    editor.edit("away", lambda p: turn_character(move_character(p, "star", [0.6, 0.2, -0.3]), "star", turn))
    standing = get_puppet_editor(editor).stage_puppets[0]
    assert np.allclose(standing.to_mesh(standing.vertices), star().vertices)
    assert np.allclose(
        standing.vertices, convert_to_world_frame(standing.character, standing.state, star().vertices)
    )
    assert np.allclose(standing.handles[0], standing.vertices[vertex("head")])
    assert np.allclose(standing.solved, standing.vertices, atol=1e-6)


def test_the_point_under_the_pointer_is_found_and_of_two_the_one_before() -> None:
    editor = editor_with("head", "left")
    standing, lens = get_puppet_editor(editor).stage_puppets[0], editor.lens
    x, y = pixel_of(editor, standing.handles[1])
    hit = find_joint_at([standing], lens, (x + 5, y - 5), 11.0)
    assert hit is not None and hit.handle == 1
    assert find_joint_at([standing], lens, (x + 15, y), 11.0) is None
    assert find_joint_at([get_puppet_editor(editor_with()).stage_puppets[0]], lens, (x, y), 11.0) is None


@pytest.mark.parametrize("part", GIZMO_PARTS)
def test_a_handle_is_where_it_is_drawn_and_moves_along_itself(part: str) -> None:
    editor = editor_with()
    editor.camera.orbit(0.5, 0.4)
    editor.camera.advance(10.0)
    tool = Gizmo(PLACE, editor.lens)
    axes = np.eye(3)
    if part == "view":
        handle = PLACE
    elif len(part) == 1:
        handle = PLACE + axes[GIZMO_PARTS.index(part)] * 0.7 * ARROW_LENGTH_PX * tool.pixel
    else:
        missing = GIZMO_PARTS.index(part) - 3
        handle = PLACE + (1 - axes[missing]) * 33 * tool.pixel
    start = pixel_of(editor, handle)
    assert tool.find_part(start) == part
    way = tool.drag_offset(part, start, (start[0] + 31.0, start[1] - 23.0), snap=False)
    seen = pixel_of(editor, handle + way)
    if part == "view":
        assert way @ editor.lens.forward == pytest.approx(0.0, abs=1e-9)
    elif len(part) == 1:
        assert np.count_nonzero(way) == 1 and way[GIZMO_PARTS.index(part)] != 0.0
    else:
        assert way[GIZMO_PARTS.index(part) - 3] == pytest.approx(0.0, abs=1e-9)
    if len(part) > 1:
        assert seen == pytest.approx((start[0] + 31.0, start[1] - 23.0), abs=1e-3), (
            "it stays under the pointer"
        )
    assert not tool.drag_offset(part, start, start, snap=False).any()


@pytest.mark.parametrize("part", ["x", "y", "z"])
def test_finger_grabs_an_arrow_next_to_it(part: str) -> None:
    editor = editor_with()
    editor.camera.orbit(0.5, 0.4)
    editor.camera.advance(10.0)
    gizmo = Gizmo(PLACE, editor.lens)
    tip = np.array(
        pixel_of(editor, PLACE + np.eye(3)[GIZMO_PARTS.index(part)] * ARROW_LENGTH_PX * gizmo.pixel)
    )
    along = (tip - pixel_of(editor, PLACE)) / np.linalg.norm(tip - pixel_of(editor, PLACE))
    across = np.array([-along[1], along[0]])
    for distance in (0.0, 0.9 * FINGER_GRAB_DISTANCE_PX, -0.9 * FINGER_GRAB_DISTANCE_PX):
        assert gizmo.find_nearest_part(tuple(tip + distance * across)) == part
    assert gizmo.find_part(tuple(tip + 0.9 * FINGER_GRAB_DISTANCE_PX * across)) == ""
    assert gizmo.find_nearest_part(tuple(tip + 1.1 * FINGER_GRAB_DISTANCE_PX * across)) == ""


def test_finger_does_not_grab_an_arrow_along_the_line_of_sight() -> None:
    editor = editor_with()
    editor.camera.face(0.0, 0.02)
    editor.camera.advance(10.0)
    gizmo = Gizmo(editor.camera.target, editor.lens)
    x, y = pixel_of(editor, editor.camera.target)
    grid = [(x + i, y + j) for i in range(-60, 61, 6) for j in range(-60, 61, 6)]
    assert {gizmo.find_nearest_part(pixel) for pixel in grid} == {"", "x", "y", "xy", "view"}


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(GIZMO_PARTS),
    st.floats(-300, 300),
    st.floats(-200, 200),
    st.floats(-3, 3),
    st.floats(-1, 1),
)
def test_a_drag_is_finite_from_every_side_and_snaps_to_steps(part, across, down, azimuth, elevation) -> None:
    editor = seen()
    editor.camera.face(azimuth, elevation)
    editor.camera.advance(10.0)
    tool = Gizmo(PLACE, editor.lens)
    start = pixel_of(editor, PLACE)
    way = tool.drag_offset(part, start, (start[0] + across, start[1] + down), snap=True)
    assume(way is not None)
    assert np.isfinite(way).all()
    assert np.abs(way / tool.step - np.round(way / tool.step)).max() < 1e-6
    power = tool.step / 10 ** np.floor(np.log10(tool.step) + 1e-9)
    assert min(abs(power - round_number) for round_number in (1, 2, 5, 10)) < 1e-6


def test_beyond_the_horizon_of_a_plane_there_is_no_place() -> None:
    editor = editor_with()
    editor.camera.face(0.0, 0.2)
    editor.camera.advance(10.0)
    tool = Gizmo(PLACE, editor.lens)
    start = pixel_of(editor, PLACE)
    assert tool.drag_offset("zx", start, (start[0], -5000.0), snap=False) is None
    assert tool.drag_offset("zx", start, (start[0], start[1] + 20.0), snap=False) is not None


def test_gizmo_has_constant_size_on_screen() -> None:
    editor = editor_with()
    sizes = []
    for place in (PLACE, PLACE + editor.lens.forward * 1.5):
        tool = Gizmo(place, editor.lens)
        up = editor.lens.up * ARROW_LENGTH_PX * tool.pixel
        sizes.append(np.linalg.norm(np.subtract(pixel_of(editor, place + up), pixel_of(editor, place))))
    assert sizes == pytest.approx([ARROW_LENGTH_PX, ARROW_LENGTH_PX], rel=1e-6)


def test_points_behind_the_camera_are_not_picked() -> None:
    editor = editor_with()
    tool = Gizmo(editor.lens.view.eye - editor.lens.forward, editor.lens)
    assert tool.find_part((320.0, 240.0)) == "" and tool.marks("") == ()
    assert tool.find_nearest_part((320.0, 240.0)) == ""


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(list(TIPS)), st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_mirroring_twice_changes_nothing(name: str, way: tuple[float, ...]) -> None:
    puppet = five()
    point = puppet.index(name)
    assume(name != "head")
    places = puppet.rest.copy()
    places[point] += way
    mirrored = mirror_places(puppet, places, point)
    other = (
        int(np.flatnonzero(np.abs(mirrored - places).max(1) > 0)[0])
        if not np.allclose(mirrored, places)
        else point
    )
    assert np.allclose(mirror_places(puppet, mirrored, other), mirrored)
    assert find_partner_vertex(puppet, vertex("left")) is not None
