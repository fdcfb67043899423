"""Tests of ghosts and motion trails for every rig: computed in the background, and updated after every
edit.
"""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "modeling"))
from test_character_laws import WORLDS, near

from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    find_keys,
    get_rig_edits,
    key_layer,
    move_character,
    set_key,
)
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.animation.ghost_pass import GhostPass
from enliven_viewer.studio.features.animation.ghost_picture import smooth_trail
from enliven_viewer.studio.features.animation.ghost_times import choose_ghost_times, find_key_times
from enliven_viewer.studio.features.animation.ghosts import Ghosts
from enliven_viewer.studio.features.animation.motion_samples import MotionSamples, smooth_normals
from enliven_viewer.studio.features.animation.trail_points import find_far_ends
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.overlay import Overlay
from enliven_viewer.studio.viewport.viewport import Viewport
from enliven_viewer.theme import FUTURE_POSE, PAST_POSE


@pytest.fixture
def computed(monkeypatch) -> list[MotionSamples]:
    """Returns the list to which each computation of samples appends its result."""
    import enliven_viewer.studio.features.animation.ghosts as room

    results, real = list[MotionSamples](), room.sample_motion

    def sample(*words) -> MotionSamples:
        results.append(real(*words))
        return results[-1]

    monkeypatch.setattr(room, "sample_motion", sample)
    return results


rigs = pytest.mark.parametrize("rig", ["bones", "graph", "points", "cage"])


def desk(rig: str, time: float = 0.8) -> tuple[Editor, Ghosts, str]:
    project, name = WORLDS[rig]
    project = change_layers(project, name, range(len(project.characters[name].playing)), offset=0.0)
    editor = Editor(project=project)
    if rig == "points":
        get_puppet_editor(editor).motion_solver.settle(project, name)
    editor.select_only(name)
    editor.time = time
    ghosts = Ghosts(editor)
    ghosts.toggle()
    return editor, ghosts, name


@rigs
def test_ghosts_stand_where_the_character_was_and_will_be(rig: str, computed) -> None:
    editor, ghosts, name = desk(rig)
    picture = ghosts.settle()
    assert picture is not None and picture.bodies
    bodies = computed[-1].bodies
    for moment, body in bodies.items():
        vertices = compute_vertices(editor.project, name, moment)
        if len(body.faces):
            near(body.rows[:, :3], vertices, 1e-5)
        else:
            near(body.points, vertices, 1e-5)
        tint = {drawn.tint for drawn in picture.bodies if drawn.body is body}
        assert tint == {PAST_POSE if moment < editor.time else FUTURE_POSE}
    opacities = {
        second: next(b.opacity for b in picture.bodies if b.body is bodies[second]) for second in bodies
    }
    for side in (
        [second for second in bodies if second < 0.8][::-1],
        [second for second in bodies if second > 0.8],
    ):
        assert [opacities[second] for second in side] == sorted(
            (opacities[second] for second in side), reverse=True
        )


@rigs
def test_trails_go_through_where_its_ends_were_and_follow_an_edit(rig: str, computed) -> None:
    editor, ghosts, name = desk(rig)
    ghosts.settle()
    for offset in (0.0, 1.5):
        if offset:
            editor.edit("move", lambda project, by=offset: move_character(project, name, [by, 0.0, 0.0]))
            get_puppet_editor(editor).motion_solver.settle(editor.project, name) if rig == "points" else None
            ghosts.settle()
        sampled = computed[-1]
        for frame in (sampled.request.first, sampled.request.last):
            time = frame * sampled.request.step
            pose, handles = get_rig_edits(editor.project.characters[name]).create_player(
                editor.project, editor.project.characters[name]
            )(time)
            near(sampled.points[frame], handles if len(handles) else pose.positions, 1e-5)
    picture = ghosts.settle()
    assert picture is not None and len(picture.tubes)
    points = np.concatenate([part for part in computed[-1].points.values()])
    low, high = points.min(0) - 0.2, points.max(0) + 0.2
    assert (picture.tubes[:, :3] >= low).all() and (picture.tubes[:, :3] <= high).all()


def test_one_switch_shows_and_hides_and_without_it_nothing_is_worked_out(computed) -> None:
    _, ghosts, _ = desk("bones")
    assert ghosts.settle() is not None
    count = len(computed)
    ghosts.toggle()
    assert ghosts.picture() is None and ghosts.settle() is None and len(computed) == count
    ghosts.toggle()
    picture = ghosts.picture()
    assert picture is not None and not picture.bodies, "nothing is kept while they are off"
    ghosts.settle()


def test_the_window_never_waits_and_the_newest_edit_wins(monkeypatch, computed) -> None:
    import enliven_viewer.studio.features.animation.ghosts as room

    editor, ghosts, name = desk("bones")
    free, real = threading.Event(), room.sample_motion
    threads = set()

    def slow(*words):
        threads.add(threading.current_thread())
        free.wait(20)
        return real(*words)

    monkeypatch.setattr(room, "sample_motion", slow)
    for offset in (0.1, 0.2, 0.3):
        editor.edit("move", lambda project, by=offset: move_character(project, name, [by, 0.0, 0.0]))
        picture = ghosts.picture()
        assert picture is not None and not picture.bodies, "nothing is known yet, and nobody waited"
    free.set()
    ghosts.settle()
    assert threading.current_thread() not in threads
    assert computed[-1].request.character is editor.project.characters[name]


def test_a_chosen_bone_has_the_trail(computed) -> None:
    editor, ghosts, _ = desk("bones")
    every = ghosts.settle()
    editor.select(handle=1)
    single = ghosts.settle()
    assert every is not None and single is not None
    sampled = computed[-1]
    line = np.stack([sampled.points[k][1] for k in range(sampled.request.first, sampled.request.last + 1)])
    away = np.linalg.norm(single.tubes[:, None, :3] - line[None], axis=2).min(1)
    assert away.max() < 0.1, "all of it lies along the way of that joint"


@pytest.mark.parametrize(("rig", "handle"), [("bones", 2), ("graph", 4), ("points", None), ("cage", None)])
def test_ghosts_stand_at_the_keys_of_what_is_chosen_of_every_rig(
    rig: str, handle: int | None, computed
) -> None:
    editor, ghosts, name = desk(rig)
    project = editor.project
    for time, degrees in ((0.2, (0, 0, 0)), (0.5, (0, 50, 0)), (1.1, (0, 0, 0)), (1.5, (0, 20, 0))):
        project = set_key(project, name, handle, time, degrees)
    number = key_layer(project, name, handle)
    assert number is not None
    editor.edit("keys", lambda _: project)
    if rig == "points":
        get_puppet_editor(editor).motion_solver.settle(editor.project, name)
    for chosen in ({"handle": handle}, {"layer": number}):
        editor.select_only(name)
        editor.select(**chosen)
        ghosts.settle()
        moments = computed[-1].request.moments
        assert set(moments) <= {key[0] for key in find_keys(project, name, handle)} and len(moments) == 4
    later = change_layers(project, name, [number], offset=0.5)
    moved = find_key_times(later, later.character(name), handle, number)
    assert moved == pytest.approx((0.7, 1.0, 1.6, 2.0))
    muted = change_layers(project, name, [number], muted=True)
    assert 0.5 not in find_key_times(muted, muted.character(name), handle, number)


def test_a_puppets_ghosts_stand_at_its_key_poses(computed) -> None:
    editor, ghosts, name = desk("points")
    ghosts.settle()
    keys = find_key_times(editor.project, editor.project.characters[name])
    assert keys and set(computed[-1].bodies) <= set(keys)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.floats(0, 10), max_size=8),
    st.floats(0, 10),
    st.integers(0, 4),
    st.floats(0.05, 2.0),
)
def test_ghosts_are_the_nearest_on_each_side_and_never_beyond(keys, time, count, step) -> None:
    moments = choose_ghost_times(tuple(sorted(keys)), time, 10.0, count, step)
    before, after = (
        [moment for moment in moments if moment < time],
        [moment for moment in moments if moment > time],
    )
    assert list(moments) == [*before, *after] == sorted(moments)
    assert len(before) <= count and len(after) <= count
    assert all(-2e-3 <= moment <= 10.002 for moment in moments)
    if keys:
        assert set(moments) <= set(keys)
        for side, way in ((before, -1.0), (after, 1.0)):
            others = [moment for moment in keys if (moment - time) * way > 1e-3 and moment not in side]
            assert not side or all(
                (moment - time) * way >= max((x - time) * way for x in side) for moment in others
            )
    elif moments:
        assert all(abs(moment / step - round(moment / step)) < 1e-6 for moment in moments)


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 12), st.integers(0, 10**6))
def test_a_smooth_line_goes_through_every_frame(frames: int, seed: int) -> None:
    line = np.random.default_rng(seed).normal(size=(frames, 3))
    fine = smooth_trail(line)
    np.testing.assert_allclose(fine[:: (len(fine) - 1) // (frames - 1)], line, atol=1e-12)


def test_far_ends_are_hands_and_feet_and_not_every_finger() -> None:
    hands = [[0.8, 1.4, 0], [0.82, 1.42, 0], [-0.8, 1.4, 0]]
    points = np.array([[0, 1, 0], [0, 1.8, 0], *hands, [0.1, 0, 0], [-0.3, 0, 0.1]])
    ends = find_far_ends(points, np.arange(1, 7), points[0])
    assert {1, 4, 5, 6} <= set(ends) and len({2, 3} & set(ends)) == 1


def test_smooth_normals_of_a_ball_point_outwards() -> None:
    from enliven.samples.shipped import load_sample

    mesh = load_sample("cactus")
    normals = smooth_normals(mesh.vertices, mesh.faces)
    used = np.unique(mesh.faces)
    np.testing.assert_allclose(np.linalg.norm(normals[used], axis=1), 1.0, atol=1e-6)
    across = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
    assert (np.einsum("ij,ij->i", across, normals[mesh.faces[:, 0]]) > 0).mean() > 0.9


@pytest.mark.slow
@rigs
def test_ghosts_are_seen_in_their_colours(rig: str) -> None:
    """With ghosts, the image has more blue and more orange than without."""
    editor, ghosts, _ = desk(rig)
    editor.size = (320.0, 240.0)
    editor.frame_all(at_once=True)
    ghosts.settle()
    ghosts.toggle()
    context = create_offscreen_context()
    viewport = Viewport(context, (320, 240), RenderSettings(), [GhostPass(context, ghosts)])
    seen = []
    for _ in range(2):
        viewport.draw(editor.stage_characters, editor.lens, editor.selection, Overlay(), bones=False)
        seen.append(viewport.renderer.pixels().astype(int))
        ghosts.toggle()
        ghosts.settle()
    changed = np.abs(seen[1] - seen[0]).max(2) > 12
    assert changed.sum() > 100
    gained = (seen[1] - seen[0])[changed]
    assert ((gained[:, 2] - gained[:, 0]) > 5).any() and ((gained[:, 0] - gained[:, 2]) > 5).any()
