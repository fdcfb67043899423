"""Tests of puppet edits: they are pure and undoable, errors give the reason, and invariants hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from puppet_worlds import SIDES, STEP, places_for, puppet_project, stool, walker
from tolerances import assert_alike

from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.project import Project, are_identical
from enliven.document.puppet import Plane
from enliven.errors import InputError
from enliven.examples.puppet_motion import convert_to_world_frame, evaluate_state, solve_layer_motion
from enliven.formats.project.file import project_bytes
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import (
    change_layers,
    copy_character,
    delete_character,
    mirror_character,
    move_character,
    paste_character,
    remove_layer,
    scale_character,
    turn_character,
)
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point, change_point, remove_point
from enliven.modeling.puppet.poses import (
    add_key_pose,
    change_key_pose,
    mirror_key_pose,
    remove_key_pose,
    set_symmetry,
)
from enliven.rotation import from_rotation_vector, rotate

seeds = st.integers(0, 10**6)
few = settings(max_examples=6, deadline=None)
TIMES = (0.0, 0.37, 1.2, 2.9)


def busy_project(seed=0):
    """Returns a project whose puppet has constraints, a subset of points, and a second layer."""
    project = puppet_project(seed, positions=(Position("top", 9, (0.0, 1.1, 0.0)),))
    return play_take(
        project,
        "stool",
        "walk",
        points=("top", "left hand"),
        offset=0.2,
        weight=0.5,
        velocities=(Velocity("top", 20, (0.1, 0.0, 0.0), "x"),),
        couplings=(Coupling("top", "left hand", 30, "y", (0.0, 0.4, 0.0)),),
    )


def world(project, time, puppet="stool"):
    """Returns (P, 3) world positions of the control points, metres."""
    character = project.puppets[puppet]
    state = evaluate_state(project, character, time)
    return convert_to_world_frame(character, state, state.places)


def test_edit_does_not_change_the_original_project():
    project = busy_project()
    before = project_bytes(project)
    clip = walker(1, "other")
    add_point(project, "stool", 100)
    remove_point(project, "stool", "top")
    change_point(project, "stool", "top", vertex=101, name="head")
    add_key_pose(project, "stool", "walk", 1.9, project.puppets["stool"].rest)
    mirror_key_pose(set_symmetry(project, "stool", SIDES), "stool", 0)
    change_layers(project, "stool", [0], loop=True)
    scale_character(project, "stool", 2.0)
    mirror_character(project, "stool", [1, 0, 0])
    move_character(project, "stool", [1, 0, 0])
    delete_character(project, "stool")
    play_take(project.with_takes(clip), "stool", "other")
    assert project_bytes(project) == before


@pytest.mark.slow
@given(seeds, st.integers(0, 400))
@few
def test_adding_and_removing_a_point_restores_the_puppet(seed, vertex):
    project = busy_project(seed)
    if vertex in [point.vertex for point in project.puppets["stool"].points]:
        vertex += 1
    more = add_point(project, "stool", vertex, "tail", "Spine", True)
    assert more.puppets["stool"].points[-1].name == "tail"
    assert are_identical(remove_point(more, "stool", "tail"), project)


def test_a_new_point_is_where_the_surface_is_in_each_key_pose():
    project = puppet_project()
    puppet = project.puppets["stool"]
    edited = add_point(project, "stool", 222).puppets["stool"]
    surface = PuppetSurface(puppet.mesh, [point.vertex for point in puppet.points])
    for before, after in zip(puppet.poses, edited.poses, strict=True):
        assert_alike(after.places[:-1], before.places)
        np.testing.assert_allclose(after.places[-1], surface.solve_from_rest(before.places)[222], atol=1e-9)
        assert (after.take, after.time) == (before.take, before.time)


def test_a_point_on_another_vertex_keeps_the_others():
    project = puppet_project()
    puppet = project.puppets["stool"]
    moved = change_point(project, "stool", "top", vertex=222).puppets["stool"]
    for before, after in zip(puppet.poses, moved.poses, strict=True):
        assert_alike(after.places[:4], before.places[:4])
        assert np.linalg.norm(after.places[4] - before.places[4]) > 1e-3


@given(seeds)
@few
def test_a_name_is_changed_everywhere_and_back(seed):
    project = busy_project(seed)
    named = change_point(project, "stool", "top", name="head")
    layers = named.puppets["stool"].layers
    assert layers[1].points == ("head", "left hand") and layers[0].positions[0].point == "head"
    assert layers[1].couplings[0].point == "head" and layers[1].velocities[0].point == "head"
    assert_alike(world(named, 1.0), world(project, 1.0))
    assert are_identical(change_point(named, "stool", "head", name="top"), project)


def test_a_point_goes_with_its_constraints_and_with_layers_of_its_own():
    project = play_take(busy_project(), "stool", "walk", points=("top",))
    puppet = remove_point(project, "stool", "top").puppets["stool"]
    assert len(puppet.layers) == 2
    assert puppet.layers[0].positions == () and puppet.layers[1].points == ("left hand",)
    assert puppet.layers[1].velocities == () and puppet.layers[1].couplings == ()


@given(seeds)
@few
def test_a_key_pose_mirrored_twice_is_itself(seed):
    project = set_symmetry(puppet_project(seed), "stool", SIDES)
    once = mirror_key_pose(project, "stool", 2)
    places = project.puppets["stool"].poses[2].places
    rest = project.puppets["stool"].rest
    swapped = rest + (places - rest)[[1, 0, 3, 2, 4]] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(once.puppets["stool"].poses[2].places, swapped, atol=1e-12)
    twice = mirror_key_pose(once, "stool", 2)
    np.testing.assert_allclose(twice.puppets["stool"].poses[2].places, places, atol=1e-12)


def test_symmetry_plane_defaults_to_the_meshs_plane():
    project = puppet_project()
    mirrored = mirror_key_pose(project, "stool", 0).puppets["stool"].poses[0].places
    set_so = mirror_key_pose(set_symmetry(project, "stool", SIDES), "stool", 0)
    np.testing.assert_allclose(mirrored, set_so.puppets["stool"].poses[0].places, atol=0.02)


@given(seeds, st.floats(-3, 3), st.floats(-2, 2))
@few
def test_a_moved_puppet_is_moved_at_every_time(seed, angle, x):
    project = busy_project(seed)
    turn, about = from_rotation_vector(np.array([0.0, angle, 0.0])), np.array([0.3, 0.0, -0.2])
    moved = move_character(project, "stool", [x, 0.0, 1.0], turn, about)
    for time in TIMES:
        there = rotate(turn, world(project, time) - about) + about + [x, 0.0, 1.0]
        np.testing.assert_allclose(world(moved, time), there, atol=1e-9)


def test_rotated_puppet_stays_in_place():
    project = move_character(puppet_project(), "stool", [3.0, 0.0, 1.0])
    turned = turn_character(project, "stool", from_rotation_vector(np.array([0.0, 1.0, 0.0])))
    rest = stool().vertices
    for each in (project, turned):
        puppet = each.puppets["stool"]
        np.testing.assert_allclose(
            (rotate(puppet.turn, rest) + puppet.place).mean(0)[[0, 2]], [3, 1], atol=1e-9
        )


@given(seeds, st.floats(0.2, 5.0))
@few
def test_a_scaled_puppet_is_scaled_at_every_time(seed, factor):
    project = move_character(busy_project(seed), "stool", [1.0, 0.0, 2.0])
    scaled = scale_character(project, "stool", factor)
    foot = np.array([1.0, 0.0, 2.0])
    for time in TIMES:
        there = foot + factor * (world(project, time) - foot)
        np.testing.assert_allclose(world(scaled, time), there, atol=1e-6 * factor)


@given(seeds, st.floats(-3, 3))
@few
def test_a_mirrored_puppet_is_the_mirror_image_at_every_time(seed, angle):
    project = move_character(
        busy_project(seed), "stool", [1.0, 0.0, 2.0], from_rotation_vector(np.array([0.0, 0.4, 0.0]))
    )
    normal = np.array([np.cos(angle), 0.0, np.sin(angle)])
    mirrored = mirror_character(project, "stool", normal)
    foot = project.puppets["stool"].place
    for time in TIMES:
        here = world(project, time)
        there = here - 2.0 * ((here - foot) @ normal)[:, None] * normal
        np.testing.assert_allclose(world(mirrored, time), there, atol=1e-7)
    again = mirror_character(mirrored, "stool", normal)
    for time in TIMES:
        np.testing.assert_allclose(world(again, time), world(project, time), atol=1e-7)
    mesh = mirrored.puppets["stool"].mesh
    outside = np.einsum("fc,fc->f", mesh.face_normals(), mesh.vertices[mesh.faces].mean(1) - [0, 0.5, 0])
    assert (outside > 0).all()


def test_a_copy_plays_later_and_elsewhere():
    project, name = copy_character(busy_project(), "stool", offset=[2.0, 0.0, 0.0], delay=0.5)
    assert name == "stool 2" and list(project.takes) == ["walk"]
    for time in TIMES:
        np.testing.assert_allclose(
            world(project, time + 0.5, name), world(project, time) + np.array([2.0, 0, 0]), atol=1e-9
        )


def test_a_paste_brings_the_takes():
    source = busy_project()
    other = walker(1, "walk", turning=0.0)
    target, name = paste_character(Project().with_takes(other), source, "stool")
    assert name == "stool" and list(target.takes) == ["walk", "walk 2"]
    assert {pose.take for pose in target.puppets["stool"].poses} == {"walk 2"}
    assert_alike(world(target, 1.2), world(source, 1.2))
    once, _ = paste_character(target, source, "stool")
    assert list(once.takes) == ["walk", "walk 2", "walk 3"]
    twice, name = paste_character(source, source, "stool")
    assert list(twice.takes) == ["walk"] and name == "stool 2"


def test_removing_is_of_the_number_that_is_meant():
    project = busy_project()
    poses = remove_key_pose(project, "stool", 1).puppets["stool"].poses
    assert poses == project.puppets["stool"].poses[:1] + project.puppets["stool"].poses[2:]
    assert remove_layer(project, "stool", 0).puppets["stool"].layers == project.puppets["stool"].layers[1:]
    gone = delete_character(project, "stool")
    assert not gone.puppets and list(gone.takes) == ["walk"]


def test_constraints_that_contradict_are_all_named_and_nothing_changes():
    project = puppet_project()
    kept = solve_layer_motion(project, project.puppets["stool"], 0)
    with pytest.raises(InputError) as refused:
        change_layers(
            project,
            "stool",
            [0],
            positions=(Position("top", 5, (0, 1, 0), "y"), Position("left hand", 5, (0, 0.2, 0), "y")),
            couplings=(Coupling("top", "left hand", 5),),
        )
    for name in (
        "position of the control point 'top' at frame 5",
        "position of the control point 'left hand' at frame 5",
        "coupling of the control points 'top'",
    ):
        assert name in str(refused.value)
    assert solve_layer_motion(project, project.puppets["stool"], 0) is kept


def test_the_feet_that_a_user_puts_somewhere_are_not_levelled():
    """If equal heights contradict the user's positions, the user's positions win."""
    free = puppet_project()
    solved = solve_layer_motion(free, free.puppets["stool"], 0)
    frames = [f for f in range(1, solved.frames) if solved.anchors[f] != solved.anchors[f - 1]]
    frame = next(f for f in frames if solved.anchors[f] >= 0 and solved.anchors[f - 1] >= 0)
    asked = (Position("left foot", frame, (0, 0.05, 0), "y"), Position("right foot", frame, (0, 0.0, 0), "y"))
    project = change_layers(free, "stool", [0], positions=asked)
    places = solve_layer_motion(project, project.puppets["stool"], 0).places[frame]
    np.testing.assert_allclose(places[:2, 1], [0.05, 0.0], atol=1e-9)


def scrap():
    mesh = stool()
    return Mesh(np.concatenate([mesh.vertices, [[0.0, 0.5, 0.0]]]), mesh.faces, "scrap")


LOOSE = len(stool().vertices)
FIVE = np.zeros((5, 3))


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (
            lambda p: add_point(p, "stool", 99999),
            "the mesh has no vertex 99999. The vertices of the mesh are numbered 0..",
        ),
        (lambda p: add_point(p, "stool", -1), "the mesh has no vertex -1"),
        (lambda p: add_point(p, "stool", 100, "top"), "another control point already has the name 'top'"),
        (
            lambda p: add_point(p, "stool", p.puppets["stool"].points[0].vertex),
            "already has the control point 'left foot'",
        ),
        (
            lambda p: add_point(p, "chair", 1),
            "the project has no puppet 'chair'. The project contains: stool.",
        ),
        (lambda p: change_point(p, "stool", "nose", joint="Head"), "no control point 'nose'"),
        (
            lambda p: change_point(p, "stool", "top", jiont="Head"),
            "the attribute 'jiont' does not exist. Known attributes: name, vertex",
        ),
        (lambda p: change_point(p, "stool", "top", weight=-1.0), "the weight -1.0 is not valid"),
        (
            lambda p: change_point(p, "stool", "top", name="left foot"),
            "two control points have the same name",
        ),
        (lambda p: remove_point(p, "stool", "nose"), "Known control points: left foot, right foot"),
        (
            lambda p: add_key_pose(p, "stool", "run", 0.0, FIVE),
            "the project has no take 'run'. Known takes: walk.",
        ),
        (
            lambda p: add_key_pose(p, "stool", "walk", 9.0, FIVE),
            "9 s is outside the take. Choose a time from 0 to 3 s",
        ),
        (lambda p: add_key_pose(p, "stool", "walk", np.nan, FIVE), "nan s is outside"),
        (
            lambda p: add_key_pose(p, "stool", "walk", 2.0, np.zeros((4, 3))),
            "the key pose has positions of shape (4, 3) for 5 control points",
        ),
        (lambda p: add_key_pose(p, "stool", "walk", 2.0, np.full((5, 3), np.nan)), "is not finite"),
        (
            lambda p: add_key_pose(p, "stool", "walk", 0.0, FIVE),
            "frame 0 of the take 'walk' already has the key pose 0",
        ),
        (
            lambda p: change_key_pose(p, "stool", 1, time=0.0),
            "frame 0 of the take 'walk' already has the key pose 0",
        ),
        (lambda p: change_key_pose(p, "stool", 9, time=0.0), "no key pose 9"),
        (
            lambda p: remove_key_pose(p, "stool", -1),
            "the puppet has no key pose -1. The key poses are numbered from 0. Number of key poses: 4.",
        ),
        (lambda p: play_take(p, "stool", "run"), "the project has no take 'run'. Known takes: walk."),
        (lambda p: play_take(p, "stool", "walk", sped=2.0), "the attribute 'sped' does not exist"),
        (lambda p: play_take(p, "stool", "walk", speed=0.0), "is not valid"),
        (
            lambda p: play_take(p, "stool", "walk", points=("nose",)),
            "no control point 'nose'",
        ),
        (
            lambda p: play_take(p, "stool", "walk", positions=(Position("top", 999, (0, 0, 0)),)),
            "is outside the motion's frames. Choose a frame from 0 to 90.",
        ),
        (
            lambda p: change_layers(p, "stool", [3], loop=True),
            "the character has no layer 3. The layers are numbered from 0. Number of layers: 1.",
        ),
        (lambda p: remove_layer(p, "stool", 1), "no layer 1"),
        (lambda p: scale_character(p, "stool", 0.0), "a character cannot be scaled by 0.0"),
        (lambda p: move_character(p, "stool", [np.nan, 0, 0]), "the displacement"),
        (lambda p: mirror_character(p, "stool", [0, 0, 0]), "is not a direction"),
        (lambda p: copy_character(p, "stool", delay=np.inf), "the delay inf s"),
        (
            lambda p: set_symmetry(p, "stool", Plane((0, 0, 0), (0, 0, 0))),
            "is not valid. Pass a finite point",
        ),
        (lambda p: make_puppet(p, stool(), "stool"), "another character already has this name"),
        (lambda p: make_puppet(p, stool(), ""), "the name of the puppet is empty"),
        (lambda p: make_puppet(p, Mesh(np.zeros((3, 3)), np.zeros((0, 3), np.int32)), "a"), "has no faces"),
        (lambda p: add_point(make_puppet(p, scrap(), "b"), "b", LOOSE), f"vertex {LOOSE} belongs to no face"),
        (
            lambda p: mirror_key_pose(
                set_symmetry(add_point(p, "stool", 100, "tail"), "stool", SIDES), "stool", 0
            ),
            "'tail' has no mirror image",
        ),
    ],
)
def test_invalid_edit_is_refused_with_the_reason(edit, said):
    project = puppet_project()
    before = project_bytes(project)
    with pytest.raises(InputError) as refused:
        edit(project)
    assert said in str(refused.value)
    assert project_bytes(project) == before


def test_equal_examples_are_refused_by_number_and_the_last_good_motion_stays():
    project = puppet_project()
    puppet = project.puppets["stool"]
    last_good = solve_layer_motion(project, puppet, 0)
    clip = project.takes["walk"]
    still = replace(clip, id="still", turns=clip.turns[[0, 0]], root=clip.root[[0, 0]])
    poses = (puppet.poses[0], replace(puppet.poses[1], take="still", time=STEP))
    wrong = project.with_takes(still).with_characters(puppet.with_changes(poses=poses))
    with pytest.raises(InputError, match="examples 0 and 1 have the same pose of the performer"):
        solve_layer_motion(wrong, wrong.puppets["stool"], 0)
    single = remove_key_pose(remove_key_pose(remove_key_pose(project, "stool", 3), "stool", 2), "stool", 1)
    with pytest.raises(InputError, match="Pose one more example"):
        solve_layer_motion(single, single.puppets["stool"], 0)
    assert solve_layer_motion(project, puppet, 0) is last_good


def test_a_key_pose_of_a_pose_that_there_is_is_refused():
    """The walk is periodic, so one second later the performer has the same pose."""
    project = puppet_project(poses=2)
    rest = project.puppets["stool"].rest
    with pytest.raises(InputError, match="examples 0 and 2 have the same pose of the performer"):
        add_key_pose(project, "stool", "walk", 1.0, rest)
    with pytest.raises(InputError, match="examples 0 and 1 have the same pose of the performer"):
        change_key_pose(project, "stool", 1, time=2.0)
    loose = change_point(project, "stool", "top", joint="")
    assert len(add_key_pose(loose, "stool", "walk", 1.0, rest).puppets["stool"].poses) == 3


def test_a_take_that_is_not_finite_is_no_take():
    clip = walker(1)
    turns = clip.turns.copy()
    turns[3, 2] = np.nan
    with pytest.raises(InputError, match="is not a finite number"):
        replace(clip, turns=turns)


def test_an_added_point_wants_places_of_its_own_size():
    project = puppet_project(poses=0, play=False)
    for number in range(3):
        rest = project.puppets["stool"].rest
        project = add_key_pose(project, "stool", "walk", number * 0.3, places_for(rest, number))
        project = add_point(project, "stool", 100 + number)
    assert {pose.places.shape for pose in project.puppets["stool"].poses} == {(8, 3)}
