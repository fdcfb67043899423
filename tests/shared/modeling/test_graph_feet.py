"""Tests of the feet of possessed meshes: pinned while they stand, pinned while low, lifted, or as
performed.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document import GraphCharacter, GraphPart, PoseStream, Project, SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    foot_lock_mode,
    key_characters,
    lock_feet,
    mirror_character,
    move_character,
    scale_character,
)
from enliven.modeling.edits.graph_feet import find_feet
from enliven.samples.shipped import load_sample

STEP = 1.0 / 30.0
TALL = 1.0
LEGS = ((-0.2, 0.2), (0.2, 0.2), (-0.2, -0.2), (0.2, -0.2))
"""x and z of a table's legs, metres."""


def table() -> GraphCharacter:
    """Returns a table 1 m high: five nodes for each leg, one for the top, and a vertex at each node."""
    heights = np.linspace(0.0, 0.8, 5)
    nodes = [(x, y, z) for x, z in LEGS for y in heights] + [(0.0, TALL, 0.0)]
    edges = [(5 * leg + k, 5 * leg + k + 1) for leg in range(4) for k in range(4)]
    edges += [(5 * leg + 4, 20) for leg in range(4)]
    positions = np.array(nodes)
    faces = np.array([(5 * a + 4, 5 * b + 4, 20) for a, b in ((0, 1), (1, 3), (3, 2), (2, 0))], np.int32)
    mesh = Mesh(positions, faces, "table")
    indices = np.zeros((21, 4), np.uint16)
    indices[:, 0] = np.arange(21)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (21, 1))
    part = GraphPart("walk", np.arange(21))
    return GraphCharacter(
        "table", positions, np.array(edges, np.int32), mesh, SkinWeights(indices, weights), (part,)
    )


def walking(speed: float = 0.05, sunk: float = 0.0, frames: int = 61) -> Project:
    """Returns a table that moves along x as a whole. Its first leg is lifted in the second half."""
    shape, times = table(), STEP * np.arange(frames)
    places = np.repeat(shape.positions[None], frames, 0)
    places[:, :, 0] += (speed * times)[:, None]
    places[:, :, 1] -= sunk
    lift = np.clip(times - times[-1] / 2, 0.0, None)
    places[:, :5, 1] += 0.4 * lift[:, None] * np.linspace(1.0, 0.0, 5)
    stream = PoseStream("walk", np.tile(np.eye(3), (frames, 21, 1, 1)), places, STEP)
    return Project().with_streams(stream).with_characters(shape)


def feet_at(project: Project, times) -> np.ndarray:
    """Returns (T, 4, 3) metres, the lowest vertex of each leg."""
    return np.stack([compute_vertices(project, "table", float(time))[[0, 5, 10, 15]] for time in times])


def slide(feet: np.ndarray) -> np.ndarray:
    """Returns (4,) metres, the largest movement of each foot over the floor between two moments."""
    return np.linalg.norm(np.diff(feet[:, :, [0, 2]], axis=0), axis=2).max(0)


def test_the_feet_of_a_table_and_of_the_chair_are_its_legs() -> None:
    shape = table()
    feet = find_feet(shape, np.arange(21))
    assert sorted(foot.node for foot in feet) == [0, 5, 10, 15]
    mesh = load_sample("chair")
    nodes = np.array([[x, y, z] for x in (-0.25, 0.25) for y in (0.05, 0.5, 1.0) for z in (-0.25, 0.25)])
    away = np.linalg.norm(np.asarray(mesh.vertices)[:, None] - nodes, axis=2)
    indices = np.zeros((len(mesh.vertices), 4), np.uint16)
    indices[:, 0] = away.argmin(1)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(indices), 1))
    part = GraphPart("rest", np.arange(len(nodes)))
    chair = GraphCharacter("chair", nodes, np.zeros((0, 2)), mesh, SkinWeights(indices, weights), (part,))
    assert len(find_feet(chair, np.arange(len(nodes)))) == 4


@pytest.mark.slow
@settings(deadline=None, max_examples=5)
@given(st.floats(0.02, 0.055), st.sampled_from(["plain", "moved", "crossing"]))
def test_held_feet_do_not_slide_and_lift_where_they_were_lifted(speed: float, way: str) -> None:
    project, times = walking(speed), np.arange(0.2, 1.9, 0.05)
    if way == "moved":
        project = move_character(project, "table", [1.0, 0.0, -2.0], turn=[0.6, 0.0, 0.8, 0.0])
    if way == "crossing":
        project = key_characters(project, ["table"], 0.0)
        project = key_characters(project, ["table"], 2.0, (0.0, 0.0, 0.05))
    before = feet_at(project, times)
    assert (slide(before) > 0.04 * speed).all(), "they slide as performed"
    for feet in ("auto", "always"):
        locked = lock_feet(project, "table", [0], feet)
        assert foot_lock_mode(locked.graph("table"), 0) == feet
        after = feet_at(locked, times)
        assert (slide(after)[1:] < 1e-3).all()
        assert slide(after[: len(times) // 3])[0] < 1e-3 and after[-1, 0, 1] > 0.2, "a step is taken"
        top = [compute_vertices(each, "table", 1.0)[20] for each in (project, locked)]
        np.testing.assert_allclose(top[0], top[1], atol=0.5 * speed)
    unlocked = lock_feet(locked, "table", [0], "never")
    np.testing.assert_allclose(feet_at(unlocked, times), before, atol=1e-12)
    assert foot_lock_mode(unlocked.graph("table"), 0) == "never"


def test_on_the_ground_no_foot_is_below_the_floor_and_none_is_held() -> None:
    project, times = walking(sunk=0.03), np.arange(0.2, 1.9, 0.05)
    before, after = feet_at(project, times), feet_at(lock_feet(project, "table", [0], "ground"), times)
    assert feet_at(lock_feet(project, "table", [0], "always"), times)[..., 1].min() > -1e-6
    assert before[:, :, 1].min() < -0.02 and after[:, :, 1].min() > -1e-6
    np.testing.assert_allclose(after[..., [0, 2]], before[..., [0, 2]], atol=1e-9)


def test_held_feet_stay_held_through_edits_and_are_found_again_after_an_edit_of_the_clip() -> None:
    held, times = lock_feet(walking(), "table", [0], "always"), np.arange(0.2, 1.9, 0.05)
    now = feet_at(held, times)
    larger = feet_at(scale_character(held, "table", 2.0), times)
    assert slide(larger)[1:].max() < 2e-3
    mirrored = feet_at(mirror_character(held, "table", [1.0, 0.0, 0.0]), times)
    assert slide(mirrored)[1:].max() < 1e-3
    later = change_layers(held, "table", [0], offset=1.0)
    assert slide(feet_at(later, times + 1.0))[1:].max() > 1e-3, "the clip moved, the feet were held before"
    later = lock_feet(later, "table", [0], "always")
    np.testing.assert_allclose(feet_at(later, times + 1.0), now, atol=1e-3)
    assert len(later.graph("table").over) == 1, "one layer holds them"


def test_missing_feet_or_unknown_mode_are_reported() -> None:
    project = walking()
    with pytest.raises(InputError, match="sometimes"):
        lock_feet(project, "table", [0], "sometimes")
    top = project.graph("table").with_changes(ends=np.full((5, 3), 9.0))
    with pytest.raises(InputError, match="none of the chosen parts has a foot"):
        lock_feet(project.with_characters(top), "table", [0], "always")
