"""Tests of Figure 6 of AniMesh, (a) to (i), in a plane. Angles are degrees about +z from +x."""

import numpy as np
import pytest
from surgery_worlds import straight_shape

from enliven.document.clip import Clip
from enliven.document.layers import Layer, Ref, Span
from enliven.document.project import Project
from enliven.document.skeleton import Skeleton
from enliven.modeling.edits import copy_character
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.posing import turn_bone
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.rotation import from_rotation_vector

SWING = Layer("swing", "swing", (0, 1))
TIMES = [0.0, 1 / 3, 2 / 3, 1.0]


def about_z(degrees):
    return from_rotation_vector(np.radians(degrees) * np.array([0.0, 0.0, 1.0]))


def one_bone():
    """Returns (a): a bone of one metre along +x that a take rotates by 90 degrees in a second."""
    skeleton = Skeleton(("shoulder", "hand"), [-1, 0], [[0, 0, 0], [2.0, 0, 0]])
    turns = np.array([[about_z(0), about_z(90 * time)] for time in TIMES])
    swing = Clip("swing", skeleton, turns, np.zeros((4, 3)), 1 / 3)
    spans = [(Span(1.0, (Ref("swing", 0.0, 1.0),)),)]
    shape = straight_shape("a", [[0, 0, 0], [1.0, 0, 0]], spans, layers=(SWING,))
    return Project().with_takes(swing).with_characters(shape)


def degrees(project, shape_id, time):
    """Returns the direction of each bone in degrees, by the name of its joint."""
    shape, pose = project.shape(shape_id), evaluate_pose(project, shape_id, time)
    by_name = {}
    for j, parent in enumerate(shape.skeleton.parents):
        if parent >= 0:
            x, y, z = pose.joints[j] - pose.joints[parent]
            assert abs(z) < 1e-12
            by_name[shape.skeleton.names[j]] = float(np.degrees(np.arctan2(y, x)))
    return by_name


def assert_degrees(found, expected):
    assert found.keys() == expected.keys()
    for name, angle in expected.items():
        apart = (found[name] - angle + 180) % 360 - 180
        assert apart == pytest.approx(0, abs=1e-7), name


def test_figure_6_of_the_paper_is_reproduced():
    a = one_bone()
    assert_degrees(degrees(a, "a", 1.0), {"a 1": 90})

    # (b) Two nodes: the bone snaps to three bones, and the total rotation is the same.
    b, q = insert_node(a, "a", "a 1", 2 / 3, name="q")
    b, p = insert_node(b, "a", "q", 1 / 2, name="p")
    for time in TIMES:
        assert_degrees(degrees(b, "a", time), {p: 30 * time, q: 60 * time, "a 1": 90 * time})
    thirds = [np.exp(1j * np.radians(x)) / 3 for x in (30, 60, 90)]
    end = evaluate_pose(b, "a", 1.0).joints[-1]
    np.testing.assert_allclose(end, [sum(thirds).real, sum(thirds).imag, 0], atol=1e-12)

    # (c) A copy, rotated by 180 degrees.
    c, copy = copy_character(b, "a")
    c = turn_bone(c, copy, 0, about_z(180), 1.0)
    for time in TIMES:
        assert_degrees(degrees(c, "a", time), degrees(b, "a", time))
        turned = {p: 180 + 30 * time, q: 180 + 60 * time, "a 1": 180 + 90 * time}
        assert_degrees(degrees(c, copy, time), turned)

    # (d) Merged at the roots: both keep moving as before.
    d, names = merge(c, "a", "a 0", copy, 1.0)
    assert names == {"p": "p 2", "q": "q 2", "a 1": "a 1 2"}
    for time in TIMES:
        first = {p: 30 * time, q: 60 * time, "a 1": 90 * time}
        second = {"p 2": 180 + 30 * time, "q 2": 180 + 60 * time, "a 1 2": 180 + 90 * time}
        assert_degrees(degrees(d, "a", time), first | second)

    # (e), (f) Cut at t = 1 in the middle of the second bone: no bone rotates.
    f, (near, off) = cut_bone(d, "a", "q", 1 / 2, 1.0, name="cut")
    at_one = degrees(d, "a", 1.0)
    assert_degrees(degrees(f, near, 1.0), {p: 30, "cut": 60, "p 2": 210, "q 2": 240, "a 1 2": 270})
    assert_degrees(degrees(f, off, 1.0), {q: 60, "a 1": 90})
    assert at_one["q"] == pytest.approx(60)
    # Each half has half of the motion: 15 of 30 degrees, which the cut undid at t = 1.
    for time in TIMES:
        assert degrees(f, near, time)["cut"] == pytest.approx(30 * time + 15 + 15 * time, abs=1e-7)
        assert degrees(f, off, time)[q] == pytest.approx(45 + 15 * time, abs=1e-7)
        assert degrees(f, off, time)["a 1"] == pytest.approx(45 + 45 * time, abs=1e-7)

    # (g), (h) The part that was cut off is moved to the end of the other arm. No bone rotates at t = 1.
    h, names = merge(f, near, "a 1 2", off, 1.0)
    assert list(h.shapes) == ["a"]
    at_the_merge = {p: 30, "cut": 60, "p 2": 210, "q 2": 240, "a 1 2": 270, names[q]: 60, names["a 1"]: 90}
    assert_degrees(degrees(h, near, 1.0), at_the_merge)

    # (i) All motions continue: the part follows the arm (180 + 90 t) and rotates by itself (15 t, and 30 t).
    for time in TIMES:
        angles = degrees(h, near, time)
        rides = 90 * time - 90
        assert_degrees(
            angles,
            degrees(f, near, time) | {names[q]: rides + 45 + 15 * time, names["a 1"]: rides + 45 + 45 * time},
        )
    assert len(h.takes) == 1
    assert list(h.layer_names) == ["swing", "swing 2"]

    # Removing the nodes of (b) restores (a).
    back = remove_node(remove_node(b, "a", "p"), "a", "q")
    assert back.shape("a").spans == a.shape("a").spans


def test_figure_13_of_the_paper_is_reproduced():
    """The grafting node has 0.6 of one motion and 0.3 of another. After its removal, the single bone has
    both.
    """
    project = one_bone()
    other = Layer("other", "swing", (0, 1), from_rotation_vector(np.array([np.pi, 0, 0])))
    a = straight_shape(
        "a", [[0, 0, 0], [1.0, 0, 0]], [(Span(1.0, (Ref("swing", 0.2, 0.6),)),)], layers=(SWING,)
    )
    b = straight_shape(
        "b", [[0, 0, 0], [3.0, 0, 0]], [(Span(1.0, (Ref("other", 0.3, 0.9),)),)], layers=(other,)
    )
    project = project.with_characters(a, b)
    merged, _ = merge(project, "a", "a 1", "b", 0.0)
    for time in TIMES:
        # The other take is seen from behind, so it rotates in the opposite direction.
        assert_degrees(degrees(merged, "a", time), {"a 1": 36 * time, "b 1": 36 * time - 54 * time})
    removed = remove_node(merged, "a", "a 1")
    for time in TIMES:
        pose = evaluate_pose(removed, "a", time)
        np.testing.assert_allclose(pose.turns[1], evaluate_pose(merged, "a", time).turns[2], atol=1e-12)
    (first, second) = removed.shape("a").spans[1]
    assert (first.share, first.refs) == (0.25, (Ref("swing", 0.2, 0.6),))
    assert (second.share, second.refs) == (0.75, (Ref("other", 0.3, 0.9),))
    # A node at another position splits the motion of its own bone only.
    inserted, _ = insert_node(removed, "a", "b 1", 0.5)
    upper, lower = inserted.shape("a").spans[1:]
    assert upper[0].refs == (Ref("swing", 0.2, 0.6),)
    assert [ref.layer for span in lower for ref in span.refs] == ["other"]
    assert upper[1].refs[0].end == lower[0].refs[0].start == pytest.approx(0.5)
