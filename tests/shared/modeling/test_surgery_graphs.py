"""Tests of cutting and merging possessed meshes: every node and vertex keeps its position and its motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import assert_alike

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.document import GraphPart, PoseStream, character_from_graph_shape, graph_shape_from_poses
from enliven.document.character import Pose
from enliven.document.history import History
from enliven.document.project import Project, are_identical
from enliven.errors import InputError
from enliven.formats.project.file import read_project, write_project
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import (
    copy_character,
    merge_characters,
    mirror_character,
    move_character,
    scale_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.pose import graph_pose, graph_vertices, pose_of_graph
from enliven.modeling.possessed.surgery import cut_graph
from enliven.rotation import from_rotation_vector, to_matrix

laws = settings(deadline=None, max_examples=12)
TIMES = st.floats(-0.5, 3.0)


def block(size=(2.0, 0.5, 0.5), steps=(17, 5, 5)):
    """Returns a closed, centred box with small faces."""
    axes = [np.linspace(-s / 2, s / 2, n) for s, n in zip(size, steps, strict=True)]
    points, faces = [], []
    for k in range(3):
        u, v = axes[(k + 1) % 3], axes[(k + 2) % 3]
        for side, x in enumerate((axes[k][0], axes[k][-1])):
            first = sum(len(p) for p in points)
            grid = np.empty((len(u), len(v), 3))
            grid[..., k], grid[..., (k + 1) % 3], grid[..., (k + 2) % 3] = x, u[:, None], v[None]
            points.append(grid.reshape(-1, 3))
            for i in range(len(u) - 1):
                for j in range(len(v) - 1):
                    a, b = first + i * len(v) + j, first + (i + 1) * len(v) + j
                    quad = [[a, b, b + 1], [a, b + 1, a + 1]]
                    faces += [face[::-1] if side == 0 else face for face in quad]
    vertices = np.concatenate(points)
    unique, number = np.unique(vertices.round(9), axis=0, return_inverse=True)
    return Mesh(unique, number.reshape(-1)[np.array(faces)].astype(np.int32), "block")


@pytest.fixture(scope="module")
def walking():
    """Returns a possessed block. Its nodes bend and sway independently, but smoothly along the block."""
    mesh = block()
    graph = DeformationGraph.build(mesh, 24, seed=1)
    character = character_from_graph(mesh, graph, "block")
    poses = []
    for frame in range(13):
        sway = 0.5 * np.sin(frame / 2 + graph.positions[:, 0])
        turns = from_rotation_vector(np.stack([0 * sway, 0.4 * sway, sway], 1))
        stretch = np.eye(3) * (1 + 0.1 * np.sin(frame + graph.positions[:, :1, None]))
        moved = graph.positions + np.stack([0.05 * frame + 0 * sway, 0.3 * sway, 0.1 * sway], 1)
        poses.append(
            Pose(
                "block",
                round(frame * 2e8),
                (to_matrix(turns) @ stretch).astype(np.float32),
                moved.astype(np.float32),
            )
        )
    shape, stream = graph_shape_from_poses(character, poses, "sway")
    return Project().with_streams(stream).with_characters(shape), character, poses


def vertices_at(project, shape_id, time):
    shape = project.graph(shape_id)
    return graph_vertices(shape, *graph_pose(project, shape, time))


def closed(mesh):
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    ways = {tuple(edge) for edge in edges.tolist()}
    return len(ways) == len(edges) and all((b, a) in ways for a, b in ways)


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_shape_plays_the_recording(walking):
    project, character, poses = walking
    shape = project.graph("block")
    for k in (0, 5, 12):
        expected = skin_vertices(character, poses[k])
        np.testing.assert_allclose(vertices_at(project, "block", k * 0.2), expected, atol=1e-5)
        shown = skin_vertices(character_from_graph_shape(shape), pose_of_graph(project, shape, k * 0.2))
        np.testing.assert_allclose(shown, expected, atol=1e-5)
    stream = project.streams["sway"]
    between = graph_pose(project, shape, 0.3)[1]
    np.testing.assert_allclose(between, (stream.positions[1] + stream.positions[2]) / 2, atol=1e-12)
    late = graph_pose(project, shape, 99.0)
    assert_alike(late[1], stream.positions[-1])
    part = shape.parts[0]
    loop = GraphPart("sway", part.nodes, offset=1.0, speed=-2.0, loop=True)
    turned = shape.with_changes(parts=(loop,))
    played = graph_pose(project, turned, 1.0 + 0.05 + stream.duration)[1]
    np.testing.assert_allclose(played, (stream.positions[-1] + stream.positions[-2]) / 2, atol=1e-9)


@laws
@given(st.floats(-0.6, 0.6), TIMES, TIMES)
def test_a_cut_moves_no_node_and_no_vertex_at_any_time(walking, x, time, later):
    project, _, _ = walking
    shape = project.graph("block")
    seen = graph_pose(project, shape, time)
    middle = int(np.abs(shape.positions[:, 0] - x).argmin())
    plane = PlaneCut(seen[1][middle] + [0.02, 0, 0], seen[0][middle] @ [1.0, 0, 0])
    edited, ids = cut_graph(project, "block", plane, time)
    whole = {tuple(v): i for i, v in enumerate(shape.mesh.vertices)}
    nodes = {tuple(p): i for i, p in enumerate(shape.positions)}
    before = vertices_at(project, "block", later)
    places = graph_pose(project, shape, later)
    count = 0
    for part in ids:
        piece = edited.graph(part)
        assert closed(piece.mesh)
        after, kept = vertices_at(edited, part, later), graph_pose(edited, piece, later)
        old = [(whole[tuple(v)], i) for i, v in enumerate(piece.mesh.vertices) if tuple(v) in whole]
        count += len(old)
        a, b = np.array(old).T
        assert_alike(after[b], before[a])
        which = [nodes[tuple(p)] for p in piece.positions]
        assert_alike(kept[0], places[0][which])
        assert_alike(kept[1], places[1][which])
        assert len(which) < len(shape.positions)
    assert count == len(shape.mesh.vertices)
    total = sum(volume(edited.graph(part).mesh) for part in ids)
    assert total == pytest.approx(volume(shape.mesh), rel=1e-9)
    assert are_identical(dict(edited.streams), dict(project.streams))


@pytest.mark.slow
@laws
@given(TIMES, st.integers(0, 2**32 - 1))
def test_a_merge_leaves_both_where_they_were_and_the_graft_rides(walking, time, seed):
    project, _, _ = walking
    random = np.random.default_rng(seed)
    project, copy = copy_character(project, "block", delay=float(random.uniform(0, 1)))
    turn = from_rotation_vector(random.normal(size=3))
    project = move_character(project, copy, [0.4, 0.3, 0.2], turn, about=[0.5, 0, 0])
    host, graft = project.graph("block"), project.graph(copy)
    merged = merge_characters(project, "block", copy, time, loose=True)
    shape = merged.graph("block")
    count = len(host.positions)
    assert copy not in merged.graphs
    here = graph_pose(merged, shape, time)
    np.testing.assert_allclose(here[1][:count], graph_pose(project, host, time)[1], atol=1e-12)
    np.testing.assert_allclose(here[1][count:], graph_pose(project, graft, time)[1], atol=1e-9)
    # At any time: the host as before, the graft as before but carried by its node since the merge.
    node = shape.parts[1].ride.node
    for later in (time, *random.uniform(-0.5, 3.0, 3)):
        ours, now = graph_pose(project, host, later), graph_pose(merged, shape, later)
        assert_alike(now[1][:count], ours[1])
        assert_alike(now[0][:count], ours[0])
        alone = graph_pose(project, graft, later)[1]
        base = np.linalg.svd(here[0][node])
        there = np.linalg.svd(now[0][node])
        carry = (there[0] @ there[2]) @ (base[0] @ base[2]).T
        expected = (alone - here[1][node]) @ carry.T + now[1][node]
        np.testing.assert_allclose(now[1][count:], expected, atol=1e-9)
    # Vertices away from the seam go along exactly.
    seen = vertices_at(project, copy, time)
    after = vertices_at(merged, "block", time)
    met = vertices_at(project, "block", time)
    far = seen[np.linalg.norm(seen[:, None] - met[None], axis=2).min(1) > 0.6]
    if len(far):
        assert np.linalg.norm(far[:, None] - after[None], axis=2).min(1).max() < 1e-6


def test_a_cut_off_half_is_put_on_elsewhere_and_cut_off_again(walking):
    project, _, _ = walking
    edited, (near, far) = cut_graph(project, "block", PlaneCut([0.25, 0, 0], [1.0, 0, 0]), 0.0)
    edited = move_character(
        edited, far, [-0.35, 0.45, 0], from_rotation_vector([0, 0, 1.2]), about=[0.2, 0, 0]
    )
    whole = merge_characters(edited, near, far, 0.4)
    assert closed(whole.graph("block").mesh)
    moved = graph_pose(whole, whole.graph("block"), 2.0)[1]
    assert np.linalg.norm(moved - graph_pose(whole, whole.graph("block"), 0.4)[1], axis=1).min() > 0.01
    # The result is merged onto a third character, so that a carried graft is carried again.
    twice, copy = copy_character(project, "block")
    twice = whole.with_characters(twice.graph(copy).with_changes(id="third"))
    twice = move_character(twice, "third", [1.0, 0.2, 0.3])
    before = graph_pose(twice, twice.graph("block"), 0.7)[1]
    both = merge_characters(twice, "third", "block", 0.7, loose=True)
    after = graph_pose(both, both.graph("third"), 0.7)[1]
    np.testing.assert_allclose(after[-len(before) :], before, atol=1e-9)
    third = both.graph("third")
    again, ids = cut_graph(both, "third", PlaneCut([0.55, 0, 0], [-1.0, 0, 0]), 0.7)
    assert [part.take for part in third.parts] == ["sway"] * 3
    for later in (0.0, 0.7, 1.9):
        places = graph_pose(both, third, later)[1]
        for part in ids:
            piece = again.graph(part)
            for p, place in zip(piece.positions, graph_pose(again, piece, later)[1], strict=True):
                k = int(np.abs(third.positions - p).sum(1).argmin())
                np.testing.assert_allclose(place, places[k], atol=1e-12)


@laws
@given(TIMES, st.integers(0, 2**32 - 1))
def test_a_scaled_and_mirrored_mesh_moves_so(walking, time, seed):
    project, _, _ = walking
    random = np.random.default_rng(seed)
    turn = from_rotation_vector(random.normal(size=3))
    project = move_character(project, "block", random.normal(size=3), turn)
    centre = project.graph("block").positions[0]
    before = vertices_at(project, "block", time)
    factor, normal = float(random.uniform(0.2, 4)), random.normal(size=3)
    larger = scale_character(project, "block", factor)
    np.testing.assert_allclose(
        vertices_at(larger, "block", time), centre + factor * (before - centre), atol=1e-6
    )
    other = mirror_character(larger, "block", normal)
    unit = normal / np.linalg.norm(normal)
    seen = centre + factor * (before - centre)
    expected = seen - 2 * ((seen - centre) @ unit)[:, None] * unit
    np.testing.assert_allclose(vertices_at(other, "block", time), expected, atol=1e-6)
    assert volume(other.graph("block").mesh) == pytest.approx(factor**3 * volume(project.graph("block").mesh))
    back = mirror_character(other, "block", normal)
    np.testing.assert_allclose(vertices_at(back, "block", time), seen, atol=1e-6)


def test_possessed_meshes_are_saved(walking, tmp_path):
    project, _, _ = walking
    edited, (near, far) = cut_graph(project, "block", PlaneCut([0.2, 0, 0], [1.0, 0, 0]), 0.0)
    edited = merge_characters(mirror_character(edited, far, [0, 1.0, 0]), near, far, 1.0, loose=True)
    write_project(tmp_path / "block.enliven", edited)
    assert are_identical(read_project(tmp_path / "block.enliven"), edited)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("share", [0.3, 0.7])
def test_after_a_cut_the_larger_side_keeps_the_name(walking, way, share):
    project, _, _ = walking
    low, high = project.graph("block").mesh.bounds
    plane = PlaneCut(low + share * (high - low), [way, 0, 0])
    edited, (kept, off) = cut_graph(project, "block", plane, 0.0)
    assert kept == "block" and volume(edited.graph(kept).mesh) > volume(edited.graph(off).mesh)


def test_undo_knows_possessed_meshes_too(walking):
    project, _, _ = walking
    history = History(project)
    edited, (near, far) = cut_graph(project, "block", PlaneCut([0.2, 0, 0], [1.0, 0, 0]), 0.0)
    history.record_edit("cut", edited)
    history.record_edit("merge", merge_characters(history.project, near, far, 1.0, loose=True))
    history.undo()
    assert are_identical(history.undo(), project)


def test_impossible_edit_is_reported(walking):
    project, character, poses = walking
    shape = project.graph("block")
    unplayed = shape.with_changes(parts=(GraphPart("nothing", shape.parts[0].nodes),))
    refused = [
        (
            lambda: cut_graph(project, "block", PlaneCut([9, 0, 0], [1.0, 0, 0]), 0.0),
            "does not cross the mesh",
        ),
        (lambda: cut_graph(project, "chair", PlaneCut([0, 0, 0], [1.0, 0, 0]), 0.0), "no possessed mesh"),
        (lambda: merge_characters(project, "block", "block", 0.0), "itself"),
        (lambda: scale_character(project, "block", 0.0), "cannot be scaled"),
        (lambda: mirror_character(project, "block", [0, 0, 0]), "direction"),
        (lambda: move_character(project, "block", [np.nan, 0, 0]), "the displacement"),
        (lambda: graph_pose(project, project.graph("block"), np.inf), "time"),
        (lambda: graph_shape_from_poses(character, poses[:1], "one"), "too few"),
        (lambda: PoseStream("s", np.zeros((2, 3, 3)), np.zeros((2, 3)), 0.1), "no frames"),
        (lambda: project.with_characters(unplayed), "no stream 'nothing'"),
    ]
    for edit, words in refused:
        with pytest.raises(InputError, match=words):
            edit()
