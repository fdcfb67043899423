"""Tests of the incremental surface: chunks equal the volume's surface, changes are sent, and undo works."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "scanning"))
from scenes import SETTINGS, fused_sphere, looking, prepared, sphere_depth

from enliven.meshes import Mesh
from enliven.samples.shipped import load_sample
from enliven.scanning import GroundPlane, TsdfVolume, extract_piece, extract_surface, sum_pieces
from enliven.wire import pack_stream, unpack_stream
from enliven_edge.scanning.checkpoints import Checkpoints
from enliven_edge.scanning.next_best_view import find_next_view
from enliven_edge.scanning.surface_preview import SurfacePreview, message_from_piece

RADIUS = 0.25
ALL = 10**9
"""Byte limit that sends all changes."""


@pytest.fixture(scope="module")
def sphere():
    """Returns a volume of a sphere of 25 cm, seen from all sides."""
    return fused_sphere(RADIUS)


def pieces(volume):
    sums = sum_pieces(volume)
    return [
        extract_piece(volume, tuple(map(int, sums.places[k])), sums.blocks[sums.piece == k])
        for k in range(len(sums.places))
    ]


def test_the_pieces_together_are_the_sphere_without_gaps(sphere):
    chunks = pieces(sphere)
    assert len(chunks) == 8  # chunks of 1.28 m, one for each octant
    away = np.concatenate([np.linalg.norm(chunk.vertices, axis=1) for chunk in chunks])
    assert np.abs(away - RADIUS).max() < 0.02 and abs(away.mean() - RADIUS) < 0.003
    vertices = np.concatenate([chunk.vertices for chunk in chunks])
    counts = np.cumsum([0, *(len(chunk.places) for chunk in chunks)])
    faces = np.concatenate([chunk.faces + n for chunk, n in zip(chunks, counts, strict=False)])
    merged = Mesh(vertices, faces.astype(np.int32))
    # Cells are twice as large, so that more of them touch unobserved space.
    assert 0.75 < merged.area / extract_surface(sphere, 0.05).area < 1.02
    assert (np.einsum("fi,fi->f", merged.face_normals(), merged.vertices[faces].mean(1)) > 0).mean() > 0.99
    # After welding, the seams are closed: each edge there has exactly one opposite edge.
    _, place = np.unique(np.round(vertices * 1e5).astype(int), axis=0, return_inverse=True)
    welded = place.reshape(-1)[faces]
    sides = np.concatenate([welded[:, [0, 1]], welded[:, [1, 2]], welded[:, [2, 0]]])
    key, back = sides @ [1 << 32, 1], sides @ [1, 1 << 32]
    seam = (np.abs(merged.vertices) < 1e-6)[
        np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ]
    at_seam = seam.all(1).any(1)
    assert at_seam.sum() > 50 and np.isin(key, back)[at_seam].mean() > 0.9


def test_surface_observed_more_often_has_higher_confidence():
    once, often = fused_sphere(RADIUS, 4), fused_sphere(RADIUS, 12)
    confidences = [
        np.concatenate([chunk.seen for chunk in pieces(volume)]).mean() for volume in (once, often)
    ]
    assert confidences[1] > 1.5 * confidences[0]


def test_only_changed_chunks_are_sent_within_the_budget(sphere):
    growing = SurfacePreview(3)
    first = growing.changes(sphere, 1)
    assert len(first) == 1, "one piece at least, or nothing would ever come"
    rest = growing.changes(sphere, ALL)
    assert len(rest) == 7 and not growing.changes(sphere, ALL)
    keys = {chunk.place for chunk in first + rest}
    assert len(keys) == 8 and all(chunk.number == 3 for chunk in rest)
    # A chunk that vanished, as after an undo, is sent without a surface.
    empty = fused_sphere(0.05)
    emptied = [chunk for chunk in growing.changes(empty, ALL) if not chunk.seen]
    assert not emptied  # every octant still contains a part of the small sphere at the origin
    shifted = np.eye(4)
    shifted[:3, 3] = 5.0
    assert len([chunk for chunk in growing.changes(fused_sphere(move=shifted), ALL) if not chunk.seen]) == 8


def test_a_piece_goes_over_the_wire(sphere):
    piece = pieces(sphere)[0]
    topic, back = unpack_stream(pack_stream(message_from_piece(piece, 7)))
    assert topic.name == "scan piece" and topic.key(back) == " ".join(map(str, piece.place))
    steps = np.frombuffer(back.vertices, "<u2").reshape(-1, 3)
    own = (steps + np.array(back.place) * float(back.side)) * back.step
    np.testing.assert_allclose(own, piece.vertices, atol=1e-9)
    assert np.array_equal(np.frombuffer(back.faces, "<u2").reshape(-1, 3), piece.faces)


@given(st.lists(st.floats(0.05, 3.0), min_size=1, max_size=40))
def test_checkpoints_step_back_through_distinct_earlier_states(steps):
    kept, now, states = Checkpoints(), 0, []
    for n, step in enumerate(steps):
        now += round(step * 1e9)
        kept.store_if_due([n], now, 1.0)
        states.append(now)
    before = len(steps)
    while (seconds := kept.count_restorable_seconds(now)) > 0:
        (n,) = kept.restore(now)
        assert n < before and states[n] == pytest.approx(now - seconds * 1e9, abs=2)
        before = n
    assert kept.restore(now) is None


def test_a_state_that_is_kept_does_not_change_with_the_scan_and_large_ones_are_few():
    kept, state = Checkpoints(), {"n": 1}
    kept.store_if_due(state, 0, 1.0)
    state["n"] = 2
    assert kept.restore(5_000_000_000) == {"n": 1}
    for n in range(5):
        kept.store_if_due({"n": n}, n * 3_000_000_000, 700.0)
    assert kept.restore(20_000_000_000) == {"n": 4} and kept.restore(20_000_000_000) is None
    kept.store_if_due(state, 0, 5000.0)
    assert kept.count_restorable_seconds(10**10) == 0, "a scan that fills the memory keeps no copies"


def half_seen():
    """Returns a volume of a sphere that was seen from one side, +z towards the camera."""
    volume = TsdfVolume(SETTINGS)
    for angle in (-0.4, -0.2, 0.0, 0.2, 0.4):
        pose = looking(np.pi + angle)
        volume.integrate(prepared(sphere_depth((0, 0, 0), RADIUS, pose)), pose)
    return extract_surface(volume)


def test_the_next_view_is_of_the_side_that_was_not_seen():
    floor = GroundPlane(np.array([0.0, 1.0, 0.0]), -0.5, 1.0)
    mesh = half_seen()
    assert mesh.vertices[:, 2].mean() > 0.05, "the camera stood on the side of +z"
    view = find_next_view(mesh, floor, np.zeros(3), 1.0)
    assert view.eye is not None and view.missing > 0.1
    assert np.linalg.norm(view.eye) == pytest.approx(1.0) and view.eye[2] < 0.3
    complete = find_next_view(load_sample("chair"), floor, np.zeros(3), 1.0)
    assert complete.eye is None and complete.missing == 0.0
