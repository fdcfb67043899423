"""Tests of stiffness painted on a mesh: the effect of a stroke, and that every edit keeps the paint."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_surgery_graphs import block

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.document import History, Plane, Project, graph_shape_from_poses
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.formats.project.one_character import character_bytes
from enliven.meshes import extract_submesh, refine
from enliven.modeling.edits import (
    brush_stiffness,
    copy_character,
    cut_character,
    merge_characters,
    mirror_character,
    move_character,
    paint_character,
    scale_character,
    unpaint_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.wire import character_to_message, message_to_character

laws = settings(deadline=None, max_examples=10)
SEEDS = st.integers(0, 2**32 - 1)
BRUSHES = st.sampled_from(["stiffer", "softer", "erase"])
MESH = block(steps=(13, 4, 4))
CHARACTER = character_from_graph(MESH, DeformationGraph.build(MESH, 12, seed=1), "block")
SHAPE, STREAM = graph_shape_from_poses(CHARACTER, [CHARACTER.rest_pose(k) for k in (0, 10**9)], "still")
PLAIN = Project().with_streams(STREAM).with_characters(SHAPE)
LEFT_AND_RIGHT = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def painted(seed=3):
    """Returns a block with random painted strokes."""
    rng, project = np.random.default_rng(seed), PLAIN
    for brush in ("stiffer", "softer"):
        stroke = rng.uniform(-1, 1, (3, 3)) * [1.0, 0.25, 0.25]
        project = paint_character(project, "block", stroke, 0.6, brush)
    assert project.graph("block").mesh.stiffness is not None
    return project


@laws
@given(SEEDS, BRUSHES, st.floats(0.1, 1.5))
def test_stroke_changes_only_covered_surface(seed, brush, radius):
    rng = np.random.default_rng(seed)
    mesh = painted(seed % 7).graph("block").mesh
    stroke = rng.uniform(-1, 1, (4, 3))
    after = brush_stiffness(mesh, stroke, radius, brush)
    after = np.ones(len(mesh.vertices), np.float32) if after is None else after
    apart = np.linalg.norm(mesh.vertices[:, None] - stroke[None], axis=2).min(1)
    np.testing.assert_array_equal(after[apart >= radius], mesh.stiffness[apart >= radius])
    assert after.min() >= 1 / 16 and after.max() <= 16
    before, ratio = np.log2(mesh.stiffness), np.log2(after) - np.log2(mesh.stiffness)
    way = {"stiffer": ratio, "softer": -ratio, "erase": -ratio * np.sign(before)}[brush]
    assert (way >= -2e-3).all() and np.abs(ratio).max() <= 4 + 1e-5
    # How often and how slowly it passes a place makes no difference.
    slow = np.repeat(stroke, 3, 0)
    again = brush_stiffness(mesh, slow, radius, brush)
    np.testing.assert_array_equal(np.ones(len(after), np.float32) if again is None else again, after)


@laws
@given(SEEDS, st.sampled_from(["stiffer", "softer"]))
def test_a_mirrored_stroke_paints_both_sides_alike(seed, brush):
    stroke = np.random.default_rng(seed).uniform(-1, 1, (3, 3))
    after = brush_stiffness(MESH, stroke, 0.7, brush, LEFT_AND_RIGHT)
    other = brush_stiffness(MESH, stroke * [-1, 1, 1], 0.7, brush, LEFT_AND_RIGHT)
    assert (after is None) == (other is None)
    if after is not None:
        np.testing.assert_allclose(after, other, rtol=1e-6)


def test_undo_is_bit_for_bit_and_clearing_leaves_nothing():
    history = History(PLAIN)
    project = paint_character(PLAIN, "block", np.zeros((1, 3)), 0.5, "softer")
    history.record_edit("paint", project)
    bytes_before = project_bytes(PLAIN)
    assert project_bytes(history.project) != bytes_before
    assert project_bytes(history.undo()) == bytes_before
    assert project_bytes(unpaint_character(project, "block")) == bytes_before
    full = paint_character(project, "block", np.zeros((1, 3)), 1e-9, "erase")
    assert full.graph("block").mesh.stiffness is not None
    with pytest.raises(InputError):
        paint_character(PLAIN, "nothing", np.zeros((1, 3)), 0.5, "softer")


@laws
@given(SEEDS, st.floats(-0.7, 0.7))
def test_cut_and_merge_keep_paint(seed, x):
    project = painted(seed % 5)
    mesh = project.graph("block").mesh
    stiffness_at = {tuple(v): s for v, s in zip(mesh.vertices.tolist(), mesh.stiffness.tolist(), strict=True)}
    cut, ids = cut_character(project, "block", PlaneCut([x, 0, 0], [1.0, 0.1, 0]), 0.0)
    sides = [cut.graph(part).mesh for part in ids]
    kept_count = 0
    for side in sides:
        assert mesh.stiffness.min() * 0.999 <= side.stiffness.min()
        assert side.stiffness.max() <= mesh.stiffness.max() * 1.001
        for place, value in zip(side.vertices.tolist(), side.stiffness.tolist(), strict=True):
            if tuple(place) in stiffness_at:
                assert value == stiffness_at[tuple(place)]
                kept_count += 1
    assert kept_count >= len(mesh.vertices)
    merged = merge_characters(cut, *ids, 0.0)
    merged_mesh = merged.graph(ids[0]).mesh
    for place, value in zip(merged_mesh.vertices.tolist(), merged_mesh.stiffness.tolist(), strict=True):
        if tuple(place) in stiffness_at and abs(place[0] - x) > 0.5:
            assert value == pytest.approx(stiffness_at[tuple(place)], rel=1e-6)


def test_all_edits_keep_paint():
    project = painted()
    own = project.graph("block").mesh.stiffness
    copied, name = copy_character(project, "block")
    moved = move_character(scale_character(copied, name, 1.7), name, [1.0, 0, 0])
    for edited in (copied, moved, mirror_character(copied, name, [1.0, 0, 0])):
        np.testing.assert_array_equal(edited.graph(name).mesh.stiffness, own)
    for read in (parse_project(project_bytes(project)), parse_project(character_bytes(project, "block"))):
        np.testing.assert_array_equal(read.graph("block").mesh.stiffness, own)
    mesh = project.graph("block").mesh
    received = message_to_character(character_to_message(replace(CHARACTER, stiffness=own), 1))
    np.testing.assert_array_equal(received.stiffness, own)
    fine = refine(mesh, 0.1)
    np.testing.assert_array_equal(fine.stiffness[: len(own)], own)
    assert len(fine.stiffness) == len(fine.vertices) and fine.stiffness.max() <= own.max() * 1.001
    some = extract_submesh(mesh, np.arange(len(mesh.faces)) < 40)
    assert set(some.stiffness.tolist()) <= set(own.tolist())
