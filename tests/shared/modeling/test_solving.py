"""Tests of solving a possessed mesh's motion again from its performers, and of edits that keep a solution
valid.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.cactus import make_cactus
from sample_meshes.chair import make_chair
from surgery_worlds import random_turns
from swaying import possessed_chair, take_of, without_cache

from enliven.deformation.graph.graph import graph_from_character
from enliven.document import HoldChange, Project, are_identical
from enliven.document.history import History
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    copy_character,
    cut_character,
    merge_characters,
    mirror_character,
    move_character,
    paint_character,
    paste_character,
    scale_character,
    shift_character,
    turn_character,
    unpaint_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.solving import (
    extract_part_at_rest,
    has_missing_motion,
    possess_mesh,
    solve_again,
    stale,
)
from enliven.possession import EmbeddedActor, settings_from_possession
from enliven.possession.placement import Placement
from enliven.possession.replaying import replay

laws = settings(deadline=None, max_examples=5)
SEEDS = st.integers(0, 2**32 - 1)
WORLD = possessed_chair(frames=40)
TIMES = (0.0, 0.4, 0.9, 1.3)
SETTLED = 2e-3
"""Tolerance in metres. If its input differs by rounding, an iterative solver repeats to this accuracy."""


def is_stale(project, name):
    return stale(project, project.graph(name))


def similar(project, name, kind, random):
    """Applies an edit with random numbers that transforms the whole shape."""
    match kind:
        case 0:
            return move_character(project, name, random.normal(size=3), random_turns(random))
        case 1:
            return scale_character(project, name, float(random.uniform(0.4, 2.5)))
        case 2:
            return mirror_character(project, name, random.normal(size=3))
        case 3:
            return turn_character(project, name, random_turns(random))
        case 4:
            return shift_character(project, name, float(random.normal()))
        case _:
            return change_layers(project, name, [0], speed=float(random.choice([0.5, 2.0])), loop=True)


@laws
@given(seed=SEEDS)
def test_rigid_edits_keep_motion_and_solution(seed):
    """Solving commutes with moves, turns, scales, mirrors and times, in any order."""
    random, (project, name) = np.random.default_rng(seed), WORLD
    for kind in random.permutation(6):
        project = similar(project, name, int(kind), random)
    assert not is_stale(project, name)
    assert are_identical(solve_again(project, name), project), "what fits is not solved"
    again = solve_again(without_cache(project, name), name)
    size = project.graph(name).parts[0].size
    for time in TIMES:
        np.testing.assert_allclose(
            compute_vertices(again, name, time),
            compute_vertices(project, name, time),
            atol=max(size, 1.0) * SETTLED,
        )
    assert not is_stale(again, name)


def held_misses(project, name, number=0):
    """Returns the mean distance per frame between the held points and the performer's points.

    The distances are metres of the performance: any scale of the whole shape is divided out.
    """
    shape = project.graph(name)
    part = shape.parts[number]
    (bare, _), take, actors = extract_part_at_rest(shape, number), project.bodies[part.possession.take], []

    class Watched(EmbeddedActor):
        def __init__(self, *given):
            super().__init__(*given)
            actors.append(self)

    import enliven.possession.replaying as replaying

    before, replaying.EmbeddedActor = replaying.EmbeddedActor, Watched
    try:
        misses = []
        for pose in replay(bare, graph_from_character(bare), take, part.possession):
            (actor,) = actors
            for hold in actor.holds:
                attachments = [grip.attachment for grip in hold.attachments]
                targets, pulls = hold.targets
                reached = np.concatenate([moved(a, actor.graph.positions, pose) for a in attachments])
                scale, yaw, *offset = actor.place
                goals = Placement(scale, yaw, np.array(offset)).to_world(targets)
                misses.append(np.average(np.linalg.norm(reached - goals, axis=1), weights=pulls + 1e-9))
        return np.array(misses[6:])
    finally:
        replaying.EmbeddedActor = before


def moved(attachment, rest, pose):
    """Returns (L, 3) positions of the held points in a pose."""
    places = np.zeros((len(attachment), 3))
    for k in range(4):
        node = attachment.node_indices[:, k]
        arm = np.einsum("lab,lb->la", pose.linear[node], attachment.points - rest[node])
        places += attachment.node_weights[:, k, None] * (arm + pose.positions[node])
    return places


@pytest.mark.slow
@laws
@given(factor=st.floats(0.7, 1.6), seed=st.integers(0, 20))
def test_a_larger_or_smaller_mesh_is_held_and_follows(factor, seed):
    """With the performers' size kept, every held point stays within 4 cm of its performer, at the mean."""
    chair = make_chair(0.06)
    mesh = replace(chair, vertices=factor * chair.vertices, name="chair")
    project, name = possessed_chair(frames=24, seed=seed)
    take, how = project.bodies["sway"], project.graph(name).parts[0].possession
    project, other = possess_mesh(project, mesh, take, replace(how, height=0.0), nodes=40)
    assert other == "chair 2" and len(project.bodies) == 1
    assert held_misses(project, other).max() < 0.04
    span = np.ptp([compute_vertices(project, other, t) for t in np.linspace(0.2, 0.75, 8)], axis=0)
    assert np.linalg.norm(span, axis=1).mean() > 0.03, "it hardly moves"


def leg_cut(project, name, time=0.0):
    """Returns the chair without the lower end of one leg, and the ids of the chair and of the leg."""
    seen = compute_vertices(project, name, time)
    outward = np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0)
    foot = seen[(seen @ outward).argmax()]
    cut, parts = cut_character(project, name, PlaneCut(foot + [0.0, 0.3, 0.0], outward), time)  # noqa: RUF005
    return cut, sorted(parts, key=lambda part: -len(cut.graph(part).mesh.vertices))


@pytest.mark.slow
@laws
@given(seed=st.integers(0, 20))
def test_both_parts_are_solved_after_cutting_a_leg(seed):
    """The chair follows its performer as closely as before, and parts above the seat hardly change."""
    project, name = possessed_chair(frames=30, seed=seed)
    whole = compute_vertices(project, name, 0.7)
    cut, (chair, leg) = leg_cut(project, name)
    assert all(is_stale(cut, part) for part in (chair, leg))
    assert len(cut.graph(leg).mesh.vertices) < 0.2 * len(whole)
    seen = np.concatenate([compute_vertices(cut, part, 0.7) for part in (chair, leg)])
    for place in whole[::7]:
        assert np.linalg.norm(seen - place, axis=1).min() < 1e-6, "a cut moves nothing by itself"
    again = solve_again(cut, chair)
    assert not is_stale(again, chair) and again.graph(chair).mesh is cut.graph(chair).mesh
    assert held_misses(again, chair).max() < 1.5 * held_misses(project, name).max() + 0.01
    off = np.linalg.norm(compute_vertices(again, chair, 0.7) - compute_vertices(cut, chair, 0.7), axis=1)
    rest = cut.graph(chair).mesh.vertices[:, 1]
    assert np.median(off[rest > 0.55 * rest.max()]) < 0.04
    assert are_identical(again.graph(leg), cut.graph(leg)), "the leg is not touched"
    both = solve_again(again, leg)
    assert not is_stale(both, leg) and np.isfinite(compute_vertices(both, leg, 0.7)).all()


def test_a_merge_is_solved_part_by_part_and_a_ride_goes_on():
    project, name = WORLD
    project, twin = copy_character(project, name, offset=[0.8, 0.0, 0.0])
    merged = merge_characters(project, name, twin, 0.5, loose=True)
    assert [part.possession is not None for part in merged.graph(name).parts] == [True, True]
    again = solve_again(without_cache(merged, name), name)
    assert not is_stale(again, name)
    for time in TIMES:
        off = compute_vertices(again, name, time) - compute_vertices(merged, name, time)
        assert np.linalg.norm(off, axis=1).mean() < 0.02


def test_paste_keeps_performers_and_undo_restores_solution():
    project, name = WORLD
    other, copied = paste_character(Project(), project, name)
    assert list(other.bodies) == ["sway"] and not is_stale(other, copied)
    clash = Project().with_bodies(take_of(5, seed=3))
    clash, copied = paste_character(clash, project, name)
    assert clash.graph(copied).parts[0].possession.take == "sway 2" and not is_stale(clash, copied)
    cut, parts = leg_cut(other, name)
    history = History(other)
    history.record_edit("cut", cut)
    history.record_edit("solve", solve_again(cut, parts[0]))
    assert are_identical(history.undo(), cut) and are_identical(history.undo(), other)


def test_a_file_keeps_performers_and_damaged_motion_is_solved_again(tmp_path):
    project, name = WORLD
    data = project_bytes(project)
    assert are_identical(parse_project(data), project)
    for lose in (False, True):
        opened = parse_project(without_stream(data, project.streams[name], lose))
        assert has_missing_motion(opened.graph(name)) and is_stale(opened, name)
        again = solve_again(opened, name)
        np.testing.assert_allclose(
            compute_vertices(again, name, 0.9), compute_vertices(project, name, 0.9), atol=1e-9
        )
    take = project.bodies["sway"]
    with pytest.raises(InputError, match="damaged"):
        parse_project(without_array(data, take.joints, True))


def without_stream(data, stream, lose):
    return without_array(without_array(data, stream.linear, lose), stream.positions, lose)


def without_array(data, array, lose):
    """Returns the file with one array removed, shortened or changed."""
    from enliven.formats.project.values import array_checksum

    entry, out = f"arrays/{array_checksum(array)}.npy", io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as archive, zipfile.ZipFile(out, "w") as rewritten:
        for member in archive.namelist():
            content = archive.read(member)
            rewritten.writestr(
                member,
                content[: len(content) // 2]
                if member == entry and lose
                else content[:-8] + b"\1" * 8
                if member == entry
                else content,
            )
    return out.getvalue()


def test_progress_notes_and_refusals():
    project, name = WORLD
    damaged, progress, notes = without_cache(project, name), [], []
    solve_again(damaged, name, progress.append, notes)
    assert (
        progress == sorted(progress)
        and progress[0] >= 0.0
        and progress[-1] == pytest.approx(1.0)
        and not notes
    )
    shape = damaged.graph(name)
    how = shape.parts[0].possession
    holds = (HoldChange(0.1), HoldChange(0.3, performer=9), HoldChange(0.5, mode="release"))
    parts = (replace(shape.parts[0], possession=replace(how, holds=holds)),)
    free = solve_again(damaged.with_characters(shape.with_changes(parts=parts)), name, notes=notes)
    assert notes == ["At 0.30 s: performer 9 is not in view."]
    late = [compute_vertices(free, name, t) for t in (1.2, 1.3)]
    np.testing.assert_allclose(late[0], late[1], atol=1e-6, err_msg="who lets go moves nothing")
    far = replace(make_cactus(cell=0.08), name="far")
    far = replace(far, vertices=far.vertices + 9.0)
    with pytest.raises(InputError, match="within"):
        possess_mesh(project, far, project.bodies["sway"], how)
    lacking = [{"rest": how.rest[:5]}, {"rest": np.zeros(3)}, {"place": (1.0, 0.0)}, {"size": 0.0}]
    for wrong in (*lacking, {"end": np.nan}):
        with pytest.raises(InputError):
            replace(shape.parts[0], possession=replace(how, **wrong))
    with pytest.raises(InputError, match="JSON"):
        settings_from_possession(replace(how, settings="{"))
    with pytest.raises(InputError, match="unknown key"):
        settings_from_possession(replace(how, settings='{"fades": 1}'))


def test_painted_softness_affects_the_next_solve():
    project, name = WORLD
    middle, wide = project.graph(name).mesh.vertices.mean(0)[None], 5.0
    soft = paint_character(project, name, middle, wide, "softer")
    assert not is_stale(project, name) and is_stale(soft, name)
    times = np.linspace(0.2, 1.2, 6)
    before, after = ([compute_vertices(each, name, float(t)) for t in times] for each in (project, soft))
    assert are_identical(np.array(before), np.array(after)), "nothing moves otherwise until it is solved"
    solved = solve_again(soft, name)
    assert not is_stale(solved, name)
    after = [compute_vertices(solved, name, float(t)) for t in times]
    assert np.abs(np.array(after) - np.array(before)).max() > 0.005
    back = solve_again(unpaint_character(solved, name), name)
    reread = [compute_vertices(back, name, float(t)) for t in times]
    np.testing.assert_allclose(reread, before, atol=SETTLED)
