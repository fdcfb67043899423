"""Tests of alternative takes (comping): stored together, selected, and removed with all their data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from performed_arm import ARM, BEGIN, create_performance, create_waving_rotations
from swaying import possessed_chair

from enliven.document.project import Project, are_identical
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits.characters import paste_character
from enliven.modeling.edits.merging import merge_characters
from enliven.modeling.edits.take_comping import (
    choose_take,
    drop_take,
    find_alternatives,
    keep_take,
    list_alternative_takes,
)
from enliven.modeling.possessed.pose import graph_pose
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.overdub.performance_takes import add_performance

SIZES = (0.2, 0.5, 0.9)


def three(count: int = 3) -> Project:
    """Returns an arm with one layer that always plays, and some alternatives above it."""
    project, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.3}), "take 0"), BEGIN
    )
    for number, size in enumerate(SIZES[:count], 1):
        beside = "take 1" if number > 1 else ""
        silent = choose_take(project, "take 1", "") if beside else project
        done = create_performance(create_waving_rotations({2: size}), f"take {number}")
        project, _ = add_performance(silent, done, BEGIN, beside=beside)
    return project


def turn(project: Project, second: float = 0.25) -> np.ndarray:
    return evaluate_pose(project, "arm", second).turns


def test_last_alternative_plays_and_each_plays_alone() -> None:
    project = three()
    assert list_alternative_takes(project, "take 1") == {"take 1": False, "take 2": False, "take 3": True}
    assert (
        find_alternatives(project, "take 2") == "take 1" and find_alternatives(project, "take 0") == "take 0"
    )
    base, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.3}), "take 0"), BEGIN
    )
    for number, size in enumerate(SIZES, 1):
        chosen = choose_take(project, "take 1", f"take {number}")
        alone, _ = add_performance(base, create_performance(create_waving_rotations({2: size})), BEGIN)
        np.testing.assert_allclose(turn(chosen), turn(alone), atol=1e-9)
    np.testing.assert_allclose(turn(choose_take(project, "take 1", "")), turn(base), atol=1e-9)


@given(st.permutations([1, 2, 3]))
@settings(max_examples=6)
def test_dropping_removes_one_alternative_completely(order) -> None:
    project = three()
    for left, number in zip((2, 1, 0), order, strict=True):
        was = list_alternative_takes(project, "take 1")
        project = drop_take(project, "take 1", f"take {number}")
        beside = list_alternative_takes(project, "take 1")
        assert len(beside) == left and f"take {number} on arm" not in project.takes
        assert sum(beside.values()) == min(left, 1), "one of them is heard"
        still = [name for name in beside if was[name]]
        assert all(beside[name] for name in still), "what was heard goes on"
    assert "take 0 on arm" in project.takes
    kept = keep_take(three(), "take 1", "take 2")
    assert list_alternative_takes(kept, "take 1") == {"take 2": True}


def test_they_are_kept_in_files_and_go_along_with_copies() -> None:
    project = three()
    read = parse_project(project_bytes(project), "file")
    assert are_identical(read, project)
    both, name = paste_character(read, project, "arm")
    chosen = choose_take(both, "take 1", "take 1")
    np.testing.assert_allclose(
        evaluate_pose(chosen, name, 0.2).turns, evaluate_pose(chosen, "arm", 0.2).turns, atol=1e-9
    )
    with pytest.raises(InputError, match="not in this group of alternative takes"):
        choose_take(project, "take 1", "take 9")
    with pytest.raises(InputError, match="not in this group of alternative takes"):
        drop_take(project, "take 1", "take 9")


def test_the_first_recording_of_a_possessed_mesh_is_dropped_too() -> None:
    project, name = possessed_chair(20, nodes=16)
    first = project.graph(name)
    part = first.parts[0].__class__(
        **{**vars(first.parts[0]), "recorded": "take 1", "alternatives": "take 1"}
    )
    project = project.with_characters(first.with_changes(parts=(part,)))
    dropped = drop_take(project, "take 1", "take 1")
    still = dropped.graph(name)
    assert (
        list_alternative_takes(dropped, "take 1") == {}
        and part.take not in dropped.streams
        and not dropped.bodies
    )
    poses = [graph_pose(dropped, still, second)[1] for second in (0.0, 0.4)]
    np.testing.assert_array_equal(poses[0], poses[1])
    np.testing.assert_allclose(poses[0], graph_pose(project, first, 0.0)[1], atol=1e-9)


def test_a_merge_keeps_which_takes_they_are() -> None:
    project = three(2)
    both, other = paste_character(project, project, "arm")
    merged = merge_characters(both, "arm", other, 0.1, loose=True)
    assert list_alternative_takes(merged, "take 1") == {"take 1": False, "take 2": True}
