"""Tests of merging characters of two rigs: nothing jumps at the time of the merge, and both motions
continue.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from surgery_worlds import random_turns
from test_character_laws import WORLDS

from enliven.document import GraphCharacter
from enliven.document.project import Project
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    cut_character,
    get_rig_edits,
    merge_characters,
    mirror_character,
    move_character,
    paste_character,
    pose_of_character,
    scale_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.rotation import rotate

BAKED = 0.02
"""Maximum error of a baked puppet relative to its size (BakeSettings), as stated in the note."""
ROUNDED = 2e-3
"""Metres between two frames of a recorded skeleton, because rotations are interpolated linearly there."""
FRAME = 1.0 / 60.0
KINDS = ("bones", "graph", "points")
GRAPHS = ("graph", "possessed")
"""Test projects with deformation graphs: one with only a stream, and one that also has its performers."""
UNLIKE = [(a, b) for a in KINDS for b in KINDS if a != b]
pairs = pytest.mark.parametrize(("host", "graft"), [*UNLIKE, ("bones", "possessed"), ("possessed", "graph")])


def beside(host, graft, time):
    """Returns both characters in one project. The graft is so far to the right that it does not touch the
    host.
    """
    project, ours = paste_character(Project(), *WORLDS[host])
    project, theirs = paste_character(project, *WORLDS[graft])
    host_places, graft_places = (compute_vertices(project, name, time) for name in (ours, theirs))
    away = host_places[:, 0].max() - graft_places[:, 0].min() + 0.2
    return move_character(project, theirs, [away, 0.0, 0.0]), ours, theirs


def off(found, expected):
    """Returns the largest distance in metres from an expected vertex to the nearest found one."""
    return float(cKDTree(found).query(expected)[0].max())


def within(rig, points):
    return BAKED * float(np.linalg.norm(np.ptp(points, axis=0))) if rig == "points" else ROUNDED


@pytest.mark.slow
@pairs
@settings(deadline=None, max_examples=1)
@given(time=st.floats(0.2, 1.2), later=st.integers(-6, 40))
def test_at_the_merge_nothing_jumps_the_host_goes_on_and_the_graft_rides(host, graft, time, later):
    project, ours, theirs = beside(host, graft, time)
    notes = []
    merged = merge_characters(project, ours, theirs, time, loose=True, notes=notes)
    assert list(merged.characters) == [ours] and isinstance(merged.characters[ours], GraphCharacter)
    assert sum("was baked" in note for note in notes) == 2 - (host in GRAPHS) - (graft in GRAPHS)
    assert ("mm" in " ".join(notes)) == ("points" in (host, graft)), "the error of a baked puppet is said"
    now, then = compute_vertices(merged, ours, time), compute_vertices(merged, ours, time + later * FRAME)
    for name, rig in ((ours, host), (theirs, graft)):
        seen = compute_vertices(project, name, time)
        assert off(now, seen) < (within(rig, seen) if rig == "points" else 1e-6)
    seen = compute_vertices(project, ours, time + later * FRAME)
    assert off(then, seen) < within(host, seen)
    # On a host that stands still, the graft does what it did alone.
    count = len(project.characters[ours].playing)
    still = change_layers(project, ours, range(count), muted=True)
    merged = merge_characters(still, ours, theirs, time, loose=True)
    seen = compute_vertices(project, theirs, time + later * FRAME)
    assert off(compute_vertices(merged, ours, time + later * FRAME), seen) < within(graft, seen)


def test_a_possessed_leg_grows_out_of_a_rigged_body():
    """Intersecting surfaces become one. The result is cut, mirrored, scaled and stored like any other
    graph.
    """
    project, ours, theirs = beside("bones", "graph", 0.5)
    project = scale_character(project, theirs, 0.5)
    tip = pose_of_character(project, ours, 0.5).positions[-1]
    leg = compute_vertices(project, theirs, 0.5)
    nearest = leg[np.abs(leg[:, 0] - leg[:, 0].min()).argmin()]
    project = move_character(project, theirs, tip - nearest - [0.12, 0.0, 0.0])
    separate = [compute_vertices(project, name, 0.5) for name in (ours, theirs)]
    merged = merge_characters(project, ours, theirs, 0.5, node="arm 2", loose=True)
    together = compute_vertices(merged, ours, 0.5)
    # Vertices inside the other mesh are removed, and those near the seam are smoothed. All others are
    # unchanged.
    assert off(np.concatenate(separate), together) < 0.1
    assert merged.graph(ours).parts[1].ride.node == 2
    low, high = together.min(0), together.max(0)
    cut, parts = cut_character(merged, ours, PlaneCut((low + high) / 2, [1.0, 0, 0]), 0.5)
    assert len(parts) == 2 and len(cut.characters) == 2
    reread = parse_project(project_bytes(merged))
    np.testing.assert_array_equal(compute_vertices(reread, ours, 0.9), compute_vertices(merged, ours, 0.9))


@settings(deadline=None, max_examples=8)
@given(factor=st.floats(0.4, 2.5), time=st.floats(-0.5, 2.0), seed=st.integers(0, 99))
def test_graft_follows_scaling_mirroring_and_moving_of_host(factor, time, seed):
    project, ours, theirs = beside("bones", "graph", 0.5)
    merged = merge_characters(project, ours, theirs, 0.5, loose=True)
    seen, random = compute_vertices(merged, ours, time), np.random.default_rng(seed)
    centre = get_rig_edits(merged.characters[ours]).centre(merged.characters[ours])
    scaled = compute_vertices(scale_character(merged, ours, factor), ours, time)
    np.testing.assert_allclose(scaled, centre + factor * (seen - centre), atol=1e-6)
    normal = random.normal(size=3)
    normal /= np.linalg.norm(normal)
    mirrored = compute_vertices(mirror_character(merged, ours, normal), ours, time)
    np.testing.assert_allclose(mirrored, seen - 2 * ((seen - centre) @ normal)[:, None] * normal, atol=1e-6)
    turn, offset = random_turns(random), random.normal(size=3)
    moved = compute_vertices(move_character(merged, ours, offset, turn), ours, time)
    np.testing.assert_allclose(moved, rotate(turn, seen) + offset, atol=1e-6)


def test_a_loop_goes_on_for_ever():
    source, name = WORLDS["bones"]
    loop = source.shape(name).with_changes(travel=None)
    project, ours = paste_character(source.with_characters(loop), *WORLDS["graph"])
    project = change_layers(project, name, [0], loop=True, speed=2.0)
    project = move_character(project, name, [9.0, 0.0, 0.0])
    merged = merge_characters(project, name, ours, 0.3, loose=True)
    (length,) = {
        layer.compute_loop_duration(project.length_of(layer)) for layer in project.shape(name).layers
    }
    assert merged.graph(name).parts[0].loop
    for rounds in (-3, 5, 400):
        at = 0.3 + 0.2 + rounds * length
        assert off(compute_vertices(merged, name, at), compute_vertices(project, name, at)) < ROUNDED


@pytest.mark.slow
def test_impossible_merge_is_reported():
    project, ours, theirs = beside("bones", "points", 0.2)
    bare = project.with_characters(project.shape(ours).with_changes(mesh=None, skin=None))
    with pytest.raises(InputError, match="no mesh"):
        merge_characters(bare, ours, theirs, 0.2, loose=True)
    with pytest.raises(InputError, match="no handle 'tail'"):
        merge_characters(project, ours, theirs, 0.2, node="tail", loose=True)
    with pytest.raises(InputError, match="node 99 does not exist"):
        merge_characters(project, ours, theirs, 0.2, node=99, loose=True)
