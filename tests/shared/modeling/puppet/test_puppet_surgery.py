"""Tests of cutting and merging puppets: world pose and key poses are kept, and the results still move."""

import made_puppets
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from enliven.document.project import are_identical
from enliven.document.puppet import Plane, PuppetLayer
from enliven.errors import InputError
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import convert_to_world_frame, evaluate_state
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import copy_character, merge_characters, move_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.puppet.parts import solve_surfaces, surface_of_puppet
from enliven.modeling.puppet.surgery import MAX_HALF_DEVIATION, cut_puppet
from enliven.rotation import from_rotation_vector

laws = settings(deadline=None, max_examples=6)
TOLERANCE = MAX_HALF_DEVIATION


@pytest.fixture(scope="module")
def bean():
    turn = from_rotation_vector(np.array([0.0, 0.5, 0.0]))
    return made_puppets.project(layers=(PuppetLayer("dance"),), place=np.array([1.0, 0.0, 0.5]), turn=turn)


def seen(project, name, time):
    """Returns (V, 3) world positions, metres."""
    puppet = project.puppet(name)
    state = evaluate_state(project, puppet, time)
    return convert_to_world_frame(puppet, state, surface_of_puppet(puppet).solve_from_rest(state.places))


def size_of(project, name="bean"):
    return float(np.linalg.norm(np.ptp(project.puppet(name).mesh.vertices, axis=0)))


def whence(part, whole):
    """Returns (N, 2) vertices of a part and the corresponding vertices of the whole, matched by rest
    positions.
    """
    away, old = cKDTree(whole.vertices).query(part.vertices)
    new = np.flatnonzero(away < 1e-9)
    return new, old[new]


@pytest.mark.slow
@laws
@given(st.floats(0.3, 0.7), st.floats(0.0, 2.4), st.floats(-0.4, 0.4))
def test_at_the_time_of_a_cut_nothing_moves(bean, height, time, lean):
    before, mesh_before = seen(bean, "bean", time), bean.puppet("bean").mesh
    at = before[int(np.abs(mesh_before.vertices[:, 1] - height).argmin())]
    notes = []
    after, names = cut_puppet(bean, "bean", PlaneCut(at + 1e-3, [lean, 1.0, 0.1]), time, notes=notes)
    assert names == ("bean", "bean 2") and len(notes) >= 2
    matched = 0
    for name in names:
        new, old = whence(after.puppet(name).mesh, mesh_before)
        off = np.linalg.norm(seen(after, name, time)[new] - before[old], axis=1)
        assert off.max() < 3 * TOLERANCE * size_of(bean)
        matched += len(new)
    assert matched == len(mesh_before.vertices)


@pytest.mark.slow
@laws
@given(st.floats(0.3, 0.7), st.floats(0.0, 2.4))
def test_cut_half_keeps_its_shape_in_key_poses(bean, height, time):
    whole = bean.puppet("bean")
    at = seen(bean, "bean", time)[int(np.abs(whole.mesh.vertices[:, 1] - height).argmin())]
    after, names = cut_puppet(bean, "bean", PlaneCut(at + 1e-3, [0.1, 1.0, 0.0]), time)
    was = solve_surfaces(surface_of_puppet(whole), np.array([pose.places for pose in whole.poses]))
    for name in names:
        half = after.puppet(name)
        assert not find_missing_examples(after, half) and len(half.poses) >= len(whole.poses)
        new, old = whence(half.mesh, whole.mesh)
        now = solve_surfaces(
            surface_of_puppet(half), np.array([pose.places for pose in half.poses[: len(was)]])
        )
        assert np.linalg.norm(now[:, new] - was[:, old], axis=2).max() <= TOLERANCE * size_of(bean) + 1e-9


@pytest.mark.slow
def test_both_halves_go_on_moving_as_they_did():
    still = made_puppets.project()
    whole = still.puppet("bean")
    after, names = cut_puppet(still, "bean", PlaneCut([0, 0.5, 0], [0, 1.0, 0.0]), 0.7)
    for name in names:
        new, old = whence(after.puppet(name).mesh, whole.mesh)
        off, moved = [], []
        for time in np.arange(0.0, 2.4, 0.3):
            before = seen(still, "bean", time)[old]
            off.append(np.linalg.norm(seen(after, name, time)[new] - before, axis=1))
            moved.append(np.linalg.norm(before - whole.mesh.vertices[old], axis=1))
        assert np.sqrt(np.mean(np.square(off))) < 0.15 * np.sqrt(np.mean(np.square(moved)))


def test_half_with_feet_travels_and_the_other_half_stays(bean):
    middle = seen(bean, "bean", 0.7).mean(0)
    after, (low, high) = cut_puppet(bean, "bean", PlaneCut(middle, [0, 1.0, 0.0]), 0.7)
    assert [layer.travel for layer in after.puppet(low).layers] == [True]
    assert [layer.travel for layer in after.puppet(high).layers] == [False]
    assert evaluate_state(after, after.puppet(high), 2.0).yaw == 0.0
    assert after.takes == bean.takes


@pytest.mark.slow
def test_a_half_without_paired_points_follows_through_new_ones():
    project = made_puppets.project()
    after, (low, _) = cut_puppet(project, "bean", PlaneCut([0, 0.3, 0], [0, 1.0, 0.0]), 0.0)
    bare = project.puppet("bean")
    kept = [p for p in bare.points if p.name == "top"]
    assert kept and "top" not in [p.name for p in after.puppet(low).points]
    tip = bare.with_changes(
        points=bare.points[1:],
        poses=[pose.__class__(pose.take, pose.time, pose.places[1:]) for pose in bare.poses],
    )
    after, (low, _) = cut_puppet(project.with_characters(tip), "bean", PlaneCut([0, 0.3, 0], [0, 1, 0]), 0.0)
    half = after.puppet(low)
    assert half.points and all(p.joint for p in half.points) and not find_missing_examples(after, half)
    assert np.abs(seen(after, low, 1.1) - seen(after, low, 0.2)).max() > 0.01


def test_cut_removes_symmetry_but_keeps_mirrored_poses():
    plane = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    project = made_puppets.project(symmetry=plane)
    notes = []
    after, names = cut_puppet(project, "bean", PlaneCut([0, 0.5, 0], [0, 1.0, 0.0]), 0.7, notes=notes)
    assert any("symmetry" in note for note in notes)
    for name in names:
        half = after.puppet(name)
        assert half.symmetry is None and len(half.poses) > len(project.puppet("bean").poses) + 1


def test_edits_are_values(bean):
    data = project_bytes(bean)
    plane = PlaneCut(seen(bean, "bean", 0.7).mean(0), [0, 1.0, 0.0])
    after, _ = cut_puppet(bean, "bean", plane, 0.7)
    assert project_bytes(bean) == data and are_identical(parse_project(project_bytes(after)), after)
    with pytest.raises(InputError, match="does not cross the mesh"):
        cut_puppet(bean, "bean", PlaneCut([0, 99.0, 0], [0, 1.0, 0.0]), 0.7)
    with pytest.raises(InputError, match="time nan is not a finite number"):
        cut_puppet(bean, "bean", plane, float("nan"))
    with pytest.raises(InputError, match="no puppet"):
        cut_puppet(bean, "pea", plane, 0.7)


def test_a_puppet_that_is_not_ready_is_cut_at_rest():
    project = made_puppets.project(layers=())
    puppet = project.puppet("bean").with_changes(poses=())
    after, names = cut_puppet(project.with_characters(puppet), "bean", PlaneCut([0, 0.5, 0], [0, 1, 0]), 0.0)
    for name in names:
        np.testing.assert_allclose(seen(after, name, 0.0), after.puppet(name).mesh.vertices, atol=1e-6)


@pytest.fixture(scope="module")
def pair():
    """Returns a bean, and a second bean that crosses it at 0.7 s and dances to its own take."""
    project = made_puppets.project()
    project = project.with_takes(
        made_puppets.take(seed=5).__class__(
            "sway",
            *(getattr(made_puppets.take(seed=5), name) for name in ("skeleton", "turns", "root", "step")),
        )
    )
    project, name = copy_character(project, "bean")
    other = project.puppet(name)
    layer = PuppetLayer("sway", travel=False)
    project = project.with_characters(other.with_changes(layers=(layer,)))
    side = from_rotation_vector(np.array([0.0, 0.0, -1.3]))
    place = seen(project, "bean", 0.7)[np.abs(other.mesh.vertices[:, 1] - 0.5).argmin()]
    return move_character(project, name, place - [0.06, 0.0, 0.0], side), name


@pytest.mark.slow
def test_at_the_time_of_a_merge_both_are_where_they_were(pair):
    project, other = pair
    notes = []
    merged = merge_characters(project, "bean", other, 0.7, notes=notes)
    assert list(merged.puppets) == ["bean"] and any("Away from the seam" in note for note in notes)
    puppet = merged.puppet("bean")
    assert not find_missing_examples(merged, puppet) and len({p.name for p in puppet.points}) == len(
        puppet.points
    )
    placed = cKDTree(seen(merged, "bean", 0.7))
    host, graft = seen(project, "bean", 0.7), seen(project, other, 0.7)
    for own, theirs in ((host, graft), (graft, host)):
        away = own[cKDTree(theirs).query(own)[0] > 0.15]
        assert len(away) > 60
        assert placed.query(away)[0].max() < 0.03 * size_of(merged)


@pytest.mark.slow
def test_key_poses_of_both_stay_and_both_go_on(pair):
    project, other = pair
    merged = merge_characters(project, "bean", other, 0.7)
    whole, host = merged.puppet("bean"), project.puppet("bean")
    times = {(pose.take, round(pose.time, 6)) for pose in whole.poses}
    for puppet in (host, project.puppet(other)):
        assert {(pose.take, round(pose.time, 6)) for pose in puppet.poses} <= times
    assert [layer.take for layer in whole.layers] == ["dance", "sway"]
    for number, pose in enumerate(host.poses):
        np.testing.assert_allclose(whole.poses[number].places[: len(host.points)], pose.places, atol=1e-9)
    off, moved = [], []
    for time in np.arange(0.0, 2.4, 0.3):
        before, after = (evaluate_state(p, p.puppet("bean"), time).places for p in (project, merged))
        off.append(np.linalg.norm(after[: len(host.points)] - before, axis=1))
        moved.append(np.linalg.norm(before - host.rest, axis=1))
    assert np.sqrt(np.mean(np.square(off))) < 0.2 * np.sqrt(np.mean(np.square(moved)))
    places = [evaluate_state(merged, whole, time).places[len(host.points) :] for time in (0.2, 1.4)]
    assert np.abs(places[0] - places[1]).max() > 0.03
    assert are_identical(parse_project(project_bytes(merged)), merged)


@pytest.mark.slow
def test_a_graft_that_plays_nothing_is_carried(pair):
    project, other = pair
    still = project.with_characters(project.puppet(other).with_changes(layers=()))
    merged = merge_characters(still, "bean", other, 0.7)
    whole = merged.puppet("bean")
    (layer,) = whole.layers
    assert set(layer.points) == {point.name for point in whole.points}
    count = len(project.puppet("bean").points)
    graft, host = (
        np.array([evaluate_state(merged, whole, time).places for time in (0.7, 1.6)])[:, rows]
        for rows in (slice(count, 2 * count), slice(0, count))
    )
    assert np.abs(host[0] - host[1]).max() > 0.05 and np.abs(graft[0] - graft[1]).max() > 0.02


@pytest.mark.slow
def test_two_that_play_the_same_have_one_layer(pair):
    project, other = pair
    alike = project.puppet(other).with_changes(layers=(PuppetLayer("dance", travel=False),))
    notes = []
    merged = merge_characters(project.with_characters(alike), "bean", other, 0.7, notes=notes)
    assert len(merged.puppet("bean").layers) == 1
    assert not any("another take" in note for note in notes)
    merge_characters(project, "bean", other, 0.7, notes=notes)
    assert any("another take" in note for note in notes)


@pytest.mark.slow
def test_a_cut_that_is_merged_again_is_whole():
    project = made_puppets.project()
    cut, (low, high) = cut_puppet(project, "bean", PlaneCut([0, 0.5, 0], [0, 1.0, 0.0]), 0.7)
    cut = move_character(cut, high, [0.0, -0.03, 0.0])
    whole = merge_characters(cut, low, high, 0.7)
    before, after = seen(project, "bean", 0.7), seen(whole, low, 0.7)
    assert cKDTree(after).query(before)[0].max() < 0.05
    assert len(whole.puppet(low).points) >= 4


@pytest.mark.slow
def test_impossible_merge_is_reported(pair):
    project, other = pair
    with pytest.raises(InputError, match="with itself"):
        merge_characters(project, "bean", "bean", 0.7)
    with pytest.raises(InputError, match="no character"):
        merge_characters(project, "bean", "pea", 0.7)
    torn = project.puppet(other)
    mesh = torn.mesh.__class__(torn.mesh.vertices, torn.mesh.faces[5:], "torn")
    broken = project.with_characters(torn.with_changes(mesh=mesh))
    try:
        merge_characters(broken, "bean", other, 0.7)
    except InputError as error:
        assert "union of the two meshes failed" in str(error)
    loose = merge_characters(broken, "bean", other, 0.7, loose=True)
    assert np.isfinite(seen(loose, "bean", 1.5)).all()
