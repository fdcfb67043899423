"""Tests of undo and redo: after any edits, the project is restored bit for bit."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layer_edits import set_layer
from surgery_worlds import bending_arm, random_project, random_turns

from enliven.document.history import History, HistorySettings
from enliven.document.project import are_identical
from enliven.errors import InputError
from enliven.modeling.edits import copy_character, mirror_character, move_character, scale_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.posed import compute_pose
from enliven.modeling.rigged.posing import turn_bone
from enliven.modeling.rigged.stroke_cut import cut_shape_along_stroke


def random_edit(project, random):
    """Applies a random edit, which may be refused."""
    shape_id = str(random.choice(list(project.shapes)))
    count = len(project.shape(shape_id).skeleton)
    j = int(random.integers(0, count))
    time = None if random.random() < 0.3 else float(random.uniform(-1, 3))
    kind = int(random.integers(0, 10)) if count < 14 else int(random.integers(1, 3))
    match kind:
        case 0:
            return "insert", insert_node(project, shape_id, j, float(random.uniform(0, 1)))[0]
        case 1:
            return "remove", remove_node(project, shape_id, j)
        case 2:
            return "cut", cut_bone(project, shape_id, j, float(random.uniform(0, 1)), time)[0]
        case 3:
            other = str(random.choice(list(project.shapes)))
            at = float(random.choice([1.0, random.uniform(0, 1)]))
            return "merge", merge(project, shape_id, j, other, time, at=at)[0]
        case 4:
            if len(project.shapes) > 5:
                return "delete", project.drop_character(shape_id)
            return "copy", copy_character(project, shape_id, offset=random.normal(size=3))[0]
        case 5:
            return "mirror", mirror_character(project, shape_id, random.normal(size=3))
        case 6:
            return "scale", scale_character(project, shape_id, float(random.uniform(0.5, 2)))
        case 7:
            plane = PlaneCut(
                compute_pose(project, project.shape(shape_id), time)[1][j], random.normal(size=3), 0.5
            )
            return "stroke", cut_shape_along_stroke(project, shape_id, plane, time)[0]
        case 8:
            return "turn", turn_bone(project, shape_id, j, random_turns(random), time)
        case _:
            layers = [layer.id for layer in project.shape(shape_id).layers]
            if not layers:
                raise InputError("it plays nothing")
            layer = str(random.choice(layers))
            return "weight", set_layer(project, shape_id, layer, weight=float(random.uniform(0, 1)))


@settings(deadline=None, max_examples=2)
@given(st.integers(0, 2**32 - 1))
def test_undo_after_200_random_edits_restores_the_project_bit_for_bit(seed):
    project, random = random_project(seed)
    start = copy.deepcopy((dict(project.characters), dict(project.takes)))
    history, done, refused = History(project), [], 0
    while len(done) < 200:
        before = history.project
        try:
            name, edited = random_edit(before, random)
        except InputError:
            refused += 1
            assert history.project is before
            continue
        done.append((name, history.record_edit(name, edited)))
    assert {"insert", "remove", "cut"} <= {name for name, _ in done}
    after = history.project
    for name, edited in reversed(done):
        assert history.undo_name == name
        assert are_identical(history.project, edited)
        history.undo()
    now = (dict(history.project.characters), dict(history.project.takes))
    assert are_identical(now, start)
    for _ in done:
        history.redo()
    assert are_identical(history.project, after)


def test_undo_restores_meshes_and_weights_too():
    project, random = bending_arm(), np.random.default_rng(2)
    start = copy.deepcopy(dict(project.shapes))
    history, done = History(project), []
    while len(done) < 40:
        try:
            name, edited = random_edit(history.project, random)
        except InputError:
            continue
        done.append(name)
        history.record_edit(name, edited)
        for shape in edited.shapes.values():
            np.testing.assert_allclose(shape.skin.weights.sum(1), 1, atol=1e-4)
            assert len(shape.skin.weights) == len(shape.mesh.vertices)
    assert {"cut", "merge"} <= set(done)
    for _ in done:
        history.undo()
    assert are_identical(dict(history.project.shapes), start)


def test_a_drag_is_one_step():
    project, random = random_project(1)
    history = History(project)
    for _ in range(20):
        history.record_edit(
            "turn", turn_bone(history.project, "shape 0", 1, random_turns(random)), drag="hand"
        )
    history.end_drag()
    history.record_edit("turn", turn_bone(history.project, "shape 0", 1, random_turns(random)), drag="hand")
    assert history.names == ("turn", "turn")
    history.undo()
    assert are_identical(history.undo(), project)
    history.redo()
    history.record_edit("move", move_character(history.project, "shape 0", [1, 0, 0]), drag="hand")
    assert history.names == ("turn", "move")
    assert history.redo_name is None


def test_history_steps_share_unchanged_data():
    project, _ = random_project(2)
    history = History(project)
    before = history.megabytes
    assert before > 0
    for _ in range(50):
        rebuilt = copy.deepcopy(dict(history.project.takes))
        history.record_edit(
            "move", move_character(history.project, "shape 0", [0.1, 0, 0]).with_takes(*rebuilt.values())
        )
    assert history.megabytes == pytest.approx(before + 50 * project.shape("shape 0").place.nbytes / 1e6)
    assert history.project.takes["walk"] is project.takes["walk"]


def test_the_oldest_steps_are_forgotten_and_never_the_project():
    project, _ = random_project(2)
    size = History(project).megabytes
    history = History(project, HistorySettings(megabytes=1.2 * size))
    for _ in range(200):
        edited = history.record_edit("move", move_character(history.project, "shape 0", [0.1, 0, 0]))
    assert 0 < len(history.names) < 200
    assert history.megabytes <= 1.2 * size
    assert are_identical(history.project, edited)
    nothing = History(project, HistorySettings(megabytes=0.0))
    nothing.record_edit("move", move_character(project, "shape 0", [1, 0, 0]))
    assert nothing.names == ()
    for step, word in ((nothing.undo, "undo"), (nothing.redo, "redo")):
        with pytest.raises(InputError, match=word):
            step()


def test_single_changed_bit_is_detected():
    project, _ = random_project(4)
    moved = move_character(project, "shape 0", [0.0, 0.0, 0.0])
    assert are_identical(project, moved)
    shape = project.shape("shape 0")
    bit = project.with_characters(shape.with_changes(place=np.nextafter(shape.place, np.inf)))
    assert not are_identical(project, bit)
    zero = project.with_characters(shape.with_changes(place=np.zeros(3)))
    minus = project.with_characters(shape.with_changes(place=-np.zeros(3)))
    assert not are_identical(zero, minus)
    assert not are_identical(project, project.drop_character("shape 1"))
    assert not are_identical(1, 1.0)
