"""Tests that an overdub of a possessed mesh, and a punch-in, leave everything else unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from performed_arm import ARM, BEGIN, STEP, create_performance, create_waving_rotations
from scipy.optimize import minimize
from swaying import possessed_chair

from enliven.document import GraphCharacter, Project, character_from_graph_shape
from enliven.document.character import Pose
from enliven.document.project import are_identical
from enliven.document.time_map import Segment
from enliven.modeling.edits.characters import (
    cut_character,
    mirror_character,
    move_character,
    scale_character,
    turn_character,
)
from enliven.modeling.edits.merging import merge_characters
from enliven.modeling.edits.rigs import pose_of_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.pose import graph_pose, graph_vertices
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.overdub.performance import PerformedMotion
from enliven.overdub.performance_takes import add_performance
from enliven.overdub.possessed_overdub import LiveOverdub, OverdubTransfer, find_shared_motion
from enliven.overdub.punch_in import FADE_S, PunchIn
from enliven.rotation import from_rotation_vector, to_matrix

FRAMES = 40


@pytest.fixture(scope="module")
def chair() -> Project:
    """Returns a chair that was possessed for one second."""
    return possessed_chair(30, nodes=24)[0]


def lifted(shape: GraphCharacter, size: float = 0.3, frames: int = FRAMES) -> PerformedMotion:
    """Returns an edge's messages for the chair held at its top, which swings away from its playing
    position.
    """
    character, poses = character_from_graph_shape(shape), []
    top = shape.positions[:, 1] > np.quantile(shape.positions[:, 1], 0.7)
    stands = to_matrix(from_rotation_vector(np.array([0.0, 0.7, 0.0])))
    for frame in range(frames):
        bow = to_matrix(from_rotation_vector(np.array([0.0, 0.0, size * np.sin(0.3 * frame)])))
        about = np.array([0.0, np.quantile(shape.positions[:, 1], 0.7), 0.0])
        places = shape.positions.copy()
        places[top] = (places[top] - about) @ bow.T + about
        linear = np.where(top[:, None, None], bow, np.eye(3))
        turned = (places @ stands.T + [3.0, 0.0, -2.0]).astype(np.float32)
        poses.append(Pose(shape.id, BEGIN + frame * STEP, (stands @ linear).astype(np.float32), turned))
    key = (shape.id, 2)
    return PerformedMotion("take 2", BEGIN, characters={key: character}, poses={key: poses})


def test_overdub_changes_only_attached_parts(chair: Project) -> None:
    before = chair.graph("chair")
    merged, names = add_performance(chair, lifted(before), BEGIN)
    after = merged.graph("chair")
    assert names == ("chair",) and after.parts == before.parts and len(after.over) == 1
    low = before.positions[:, 1] < np.quantile(before.positions[:, 1], 0.65)
    for second in (0.3, 0.8):
        before_pose, after_pose = (graph_pose(each, each.graph("chair"), second) for each in (chair, merged))
        np.testing.assert_allclose(
            after_pose[1][low], before_pose[1][low], atol=2e-3, err_msg="its legs walk on"
        )
        moved = np.linalg.norm(after_pose[1] - before_pose[1], axis=1)
        assert moved[~low].max() > 0.05, "its back bows"


def test_live_display_matches_later_playback(chair: Project) -> None:
    done = lifted(chair.graph("chair"))
    merged, _ = add_performance(chair, done, BEGIN)
    live = LiveOverdub(chair, "chair", done.characters["chair", 2])
    for frame in (5, 15, 25):
        base = pose_of_character(chair, "chair", frame * STEP * 1e-9)
        pose = live.pose(done.poses["chair", 2][frame], base)
        _, positions = graph_pose(merged, merged.graph("chair"), frame * STEP * 1e-9)
        np.testing.assert_allclose(pose.positions, positions, atol=2e-3)


def test_nodes_of_another_graph_of_the_same_mesh_move_as_its_surface_did(chair: Project) -> None:
    shape = chair.graph("chair")
    done = lifted(shape)
    character = done.characters["chair", 2]
    order = np.random.default_rng(0).permutation(len(character.pivots))
    number = np.argsort(order)
    skin = replace(character.skin, indices=number[character.skin.indices].astype(np.uint16))
    other = replace(character, pivots=character.pivots[order], edges=character.edges[:0], skin=skin)
    poses = [(pose.linear[order], pose.positions[order]) for pose in done.poses["chair", 2]]
    own = [(pose.linear, pose.positions) for pose in done.poses["chair", 2]]
    stacked = [[np.stack(each).astype(float) for each in zip(*rows, strict=True)] for rows in (own, poses)]
    same_nodes = OverdubTransfer(shape, character)(*stacked[0])
    others = OverdubTransfer(shape, other)(*stacked[1])
    np.testing.assert_allclose(others[1], same_nodes[1], atol=1e-4)


@given(st.integers(0, 10_000), st.integers(0, 4))
@settings(max_examples=15)
def test_the_shared_motion_is_that_of_the_least_distances(seed: int, astray: int) -> None:
    random = np.random.default_rng(seed)
    rest = random.normal(size=(12, 3))
    turn = to_matrix(from_rotation_vector(random.normal(size=3)))
    places = rest @ turn.T + random.normal(size=3)
    places[:astray] += random.normal(size=(astray, 3))
    turns, moves = find_shared_motion(places[None], rest)

    def distances(free: np.ndarray) -> float:
        slow = to_matrix(from_rotation_vector(free[:3])) @ turns[0]
        return float(np.linalg.norm(places - rest @ slow.T - moves[0] - free[3:], axis=1).sum())

    best = minimize(distances, np.zeros(6), method="Nelder-Mead", options={"maxiter": 400}).fun
    # The kernel counts distances below its 2 mm alike.
    assert distances(np.zeros(6)) <= best + 12 * 2e-3


@given(st.integers(0, 10_000), st.integers(0, 30))
@settings(max_examples=20)
def test_the_shared_motion_is_that_of_its_twin_in_numpy(seed: int, astray: int) -> None:
    random = np.random.default_rng(seed)
    rest = random.normal(size=(60, 3))
    turn = to_matrix(from_rotation_vector(random.normal(size=3)))
    places = rest @ turn.T + random.normal(size=3) + 0.01 * random.normal(size=(2, 60, 3))
    places[:, :astray] += random.normal(size=(astray, 3))
    turns, moves = find_shared_motion(places, rest)
    for frame in range(2):
        slow_turn, slow_move = shared_by_numpy(places[frame], rest)
        # Twelve rounds carry the rounding of a singular value decomposition and of Jacobi's turns apart.
        np.testing.assert_allclose(turns[frame], slow_turn, atol=1e-9)
        np.testing.assert_allclose(moves[frame], slow_move, atol=1e-9)


def shared_by_numpy(places: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    weights = np.ones(len(rest))
    for _ in range(12):
        middle, centre = (np.average(each, axis=0, weights=weights) for each in (places, rest))
        u, _, vt = np.linalg.svd(((places - middle) * weights[:, None]).T @ (rest - centre))
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        move = middle - turn @ centre
        weights = 1.0 / np.maximum(np.linalg.norm(places - rest @ turn.T - move, axis=1), 2e-3)
    return turn, move


def seen(project: Project, name: str, second: float) -> np.ndarray:
    shape = project.graph(name)
    return graph_vertices(shape, *graph_pose(project, shape, second))


@given(st.floats(0.2, 0.9))
@settings(max_examples=5)
def test_global_edits_keep_overdub(chair: Project, second: float) -> None:
    merged, _ = add_performance(chair, lifted(chair.graph("chair")), BEGIN)
    before = seen(merged, "chair", second)
    moved = move_character(merged, "chair", [1.0, 0.5, 0.0])
    np.testing.assert_allclose(seen(moved, "chair", second), before + np.array([1.0, 0.5, 0.0]), atol=1e-9)
    turned = turn_character(merged, "chair", from_rotation_vector(np.array([0.0, 1.0, 0.0])))
    size = np.linalg.norm(np.ptp(before, axis=0))
    assert are_identical(merged.graph("chair").over, turned.graph("chair").over) and size > 0.5
    centre = merged.graph("chair").positions[0]
    larger = scale_character(merged, "chair", 1.7)
    np.testing.assert_allclose(seen(larger, "chair", second), centre + 1.7 * (before - centre), atol=1e-6)
    flipped = mirror_character(merged, "chair", [1.0, 0.0, 0.0])
    np.testing.assert_allclose(
        seen(flipped, "chair", second) - centre, (before - centre) * [-1.0, 1.0, 1.0], atol=1e-6
    )


def test_cut_and_merge_keep_overdub(chair: Project) -> None:
    overdubbed, _ = add_performance(chair, lifted(chair.graph("chair")), BEGIN)
    middle = seen(overdubbed, "chair", 0.6).mean(0)
    cut, (near, far) = cut_character(overdubbed, "chair", PlaneCut(middle, np.array([0.0, 1.0, 0.0])), 0.6)
    for name in (near, far):
        positions = graph_pose(cut, cut.graph(name), 0.8)[1]
        whole_pose = graph_pose(overdubbed, overdubbed.graph("chair"), 0.8)[1]
        nearest = np.linalg.norm(positions[:, None] - whole_pose[None], axis=2).min(1)
        assert nearest.max() < 1e-9, "every node is where it was"
    aside = move_character(cut, far, [0.02, 0.0, 0.0])
    merged = merge_characters(aside, near, far, 0.6, loose=True)
    parts_before = [graph_pose(aside, aside.graph(name), 0.6)[1] for name in (near, far)]
    np.testing.assert_allclose(
        graph_pose(merged, merged.graph(near), 0.6)[1], np.concatenate(parts_before), atol=1e-9
    )


SPANS = st.tuples(st.floats(0.0, 1.5), st.floats(0.3, 1.0))


@given(SPANS, st.booleans(), st.booleans())
@settings(max_examples=30)
def test_punch_in_changes_layer_only_within_its_span(span, hold: bool, loop: bool) -> None:
    own = create_waving_rotations({1: 0.7})
    project, _ = add_performance(Project().with_characters(ARM), create_performance(own), BEGIN - 500_000_000)
    layer = replace(project.shape("arm").layers[0], hold=hold, loop=loop)
    length, punch = project.length_of(layer), PunchIn(span[0], sum(span), 3.0)
    left = punch(project, layer)
    outside = [t for t in np.linspace(0.0, 3.0, 61) if not punch.begin - 2e-3 <= t <= punch.end + 2e-3]
    inside = np.linspace(punch.begin + FADE_S, punch.end - FADE_S, 5)[1:4]
    for time in outside:
        was = layer.moment(time, length)
        now = None if left is None else left.moment(time, length)
        assert was.weight == 0.0 if now is None else now.weight == pytest.approx(was.weight), time
        if now is not None and was.weight:
            assert now.second == pytest.approx(was.second, abs=1e-6)
    assert left is None or not any(left.moment(time, length).weight for time in inside)


def test_a_recording_in_the_place_of_another_replaces_its_span_and_no_more(chair: Project) -> None:
    longer, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.5, 2: 0.5})), BEGIN
    )
    short = create_performance(create_waving_rotations({1: 0.9})[:8], "take 2")
    begin = BEGIN - 100_000_000
    merged, _ = add_performance(longer, short, begin, replaces=True)
    for second in (0.02, 0.09, 0.345, 0.36):
        before, after = (evaluate_pose(each, "arm", second).turns for each in (longer, merged))
        np.testing.assert_allclose(after, before, atol=1e-6)
    alone, _ = add_performance(Project().with_characters(ARM), short, begin)
    middle = 0.1 + 3.5 * STEP * 1e-9
    bone = [evaluate_pose(each, "arm", middle).turns[1] for each in (merged, alone)]
    np.testing.assert_allclose(bone[0], bone[1], atol=1e-6)
    assert are_identical(merged.takes["take 1 on arm"], longer.takes["take 1 on arm"])

    done = lifted(chair.graph("chair"), frames=12)
    punched, _ = add_performance(chair, done, BEGIN - 300_000_000, replaces=True)
    for second in (0.1, 0.29, 0.7, 0.95):
        np.testing.assert_allclose(seen(punched, "chair", second), seen(chair, "chair", second), atol=1e-6)
    assert np.abs(seen(punched, "chair", 0.48) - seen(chair, "chair", 0.48)).max() > 0.01
    replaced, _ = add_performance(chair, lifted(chair.graph("chair")), BEGIN, replaces=True)
    assert replaced.graph("chair").over == (), "what replaces everything is a performance of its own"


def test_clips_that_were_blended_are_punched_too() -> None:
    project, _ = add_performance(
        Project().with_characters(ARM), create_performance(create_waving_rotations({1: 0.7})), BEGIN
    )
    layer = project.shape("arm").layers[0]
    blended = replace(layer, segments=(Segment(0.0, 2.0), Segment(1.2, 3.0, 0.1)))
    left = PunchIn(1.4, 2.5, 4.0)(project, blended)
    assert left is not None
    for time in (0.3, 1.1, 2.6, 2.9):
        length = project.length_of(layer)
        assert left.moment(time, length).second == pytest.approx(
            blended.moment(time, length).second, abs=1e-6
        )
    assert left.moment(1.4 + 2 * FADE_S, 0.4).weight == 0.0
