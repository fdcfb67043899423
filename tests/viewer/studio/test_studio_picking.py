"""Tests that picking equals the projection exactly, and equals a brute-force search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.rigged import RiggedCharacter, character_of, still_shape
from enliven.document.skeleton import Skeleton
from enliven.motion.layers.evaluate import ShapePose, pose_from
from enliven.rotation import IDENTITY
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.studio.viewport.picking import (
    Lens,
    find_bone_at,
    find_crossings,
    find_joint_at,
    find_surface_at,
)
from enliven_viewer.studio.viewport.stage_character import StageCharacter

SIZE = (900.0, 600.0)


def standing(shape: RiggedCharacter, joints: np.ndarray) -> StageCharacter:
    """Returns a shape without bone rotations whose joints have random positions."""
    pose = pose_from(shape, ShapePose(np.tile(IDENTITY, (len(joints), 1)), joints), 0.0)
    return StageCharacter(shape, None if shape.mesh is None else character_of(shape), pose, joints)


def lens_of(azimuth: float, elevation: float) -> Lens:
    camera = OrbitCamera(math.radians(34))
    camera.frame((np.array([-1.0, 0.0, -1.0]), np.array([1.0, 2.0, 1.0])), 1.5, at_once=True)
    camera.face(azimuth, elevation)
    camera.advance(100.0)
    return Lens(camera.view(1.5), SIZE)


@st.composite
def trees(draw: st.DrawFn) -> StageCharacter:
    """Generates a random tree of joints at different positions, in front of every camera of
    :func:`lens_of`.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = int(rng.integers(2, 12))
    parents = np.array([-1, *(int(rng.integers(0, k)) for k in range(1, count))], np.int32)
    joints = rng.uniform([-1, 0, -1], [1, 2, 1], (count, 3))
    skeleton = Skeleton(tuple(f"j{k}" for k in range(count)), parents, joints)
    return standing(still_shape("tree", skeleton), joints)


lenses = st.builds(lens_of, st.floats(-3.0, 3.0), st.floats(0.05, 1.4))


@given(trees(), lenses)
@settings(max_examples=60, deadline=None)
def test_every_joint_is_picked_at_its_pixel(posed: StageCharacter, lens: Lens) -> None:
    pixels, depths = lens.project(posed.handles)
    for joint, pixel in enumerate(pixels):
        hit = find_joint_at([posed], lens, (float(pixel[0]), float(pixel[1])), 4.0)
        assert hit is not None
        near = np.linalg.norm(pixels - pixel, axis=1) <= 0.5
        assert near[hit.handle] and hit.pixels <= 0.5
        assert near.sum() > 1 or (hit.handle == joint and hit.depth == depths[joint])


@given(trees(), lenses, st.integers(0, 100), st.floats(0.02, 0.98))
@settings(max_examples=80, deadline=None)
def test_a_place_on_a_bone_is_picked_where_it_is_in_space(posed, lens, number, along) -> None:
    joint = 1 + number % (len(posed.handles) - 1)
    start, end = posed.handles[posed.character.parents[joint]], posed.handles[joint]
    pixel = lens.project((start + along * (end - start))[None])[0][0]
    hit = find_bone_at([posed], lens, (float(pixel[0]), float(pixel[1])), 2.0)
    assert hit is not None and hit.pixels < 1e-6 + 2.0
    if hit.handle == joint:
        ends = lens.project(np.stack([start, end]))[0]
        if np.linalg.norm(ends[1] - ends[0]) > 5.0:  # a bone in the viewing direction is a dot
            assert abs(hit.along - along) < 1e-6


@given(trees(), lenses, st.floats(20, 880), st.floats(20, 580))
@settings(max_examples=60, deadline=None)
def test_the_nearest_bone_is_that_of_a_thousand_samples(posed, lens, x, y) -> None:
    hit = find_bone_at([posed], lens, (x, y), 1e9)
    assert hit is not None
    share = np.linspace(0, 1, 1001)[:, None]
    parents = posed.character.parents
    nearest = []
    for joint in range(1, len(posed.handles)):
        start, end = posed.handles[parents[joint]], posed.handles[joint]
        pixels = lens.project(start + share * (end - start))[0]
        nearest.append(float(np.linalg.norm(pixels - [x, y], axis=1).min()))
    # Of two equally near to a pixel, the one in front is picked.
    assert hit.pixels <= min(nearest) + 1.0 + 1e-6
    assert nearest[hit.handle - 1] == pytest.approx(hit.pixels, abs=2.0)


@given(trees(), lenses, st.integers(0, 100), st.floats(0.05, 0.95), st.floats(0, 6.28))
@settings(max_examples=80, deadline=None)
def test_a_stroke_through_a_place_on_a_bone_crosses_it_there(posed, lens, number, along, angle) -> None:
    joint = 1 + number % (len(posed.handles) - 1)
    start, end = posed.handles[posed.character.parents[joint]], posed.handles[joint]
    ends = lens.project(np.stack([start, end]))[0]
    way = ends[1] - ends[0]
    across = np.array([math.cos(angle), math.sin(angle)])
    sine = abs(way[0] * across[1] - way[1] * across[0]) / max(float(np.linalg.norm(way)), 1e-9)
    if np.linalg.norm(way) < 10.0 or sine < 0.2:
        return
    pixel = lens.project((start + along * (end - start))[None])[0][0]
    stroke = np.stack([pixel - 30 * across, pixel + 30 * across])
    hits = {hit.handle: hit for hit in find_crossings([posed], lens, stroke)}
    assert abs(hits[joint].along - along) < 1e-6
    for other, hit in hits.items():
        a, b = posed.handles[posed.character.parents[other]], posed.handles[other]
        place = lens.project((a + hit.along * (b - a))[None])[0][0]
        offset = place - pixel
        assert abs(offset[0] * across[1] - offset[1] * across[0]) < 1e-4, "it lies on the stroke"


@given(lenses, st.floats(50, 850), st.floats(50, 550))
@settings(max_examples=60, deadline=None)
def test_a_ray_goes_through_its_pixel_and_a_plane_gives_it_back(lens: Lens, x: float, y: float) -> None:
    ahead = lens.view.eye + np.outer([0.5, 2.0, 7.0], lens.ray((x, y)))
    assert np.abs(lens.project(ahead)[0] - [x, y]).max() < 1e-6
    through = np.array([0.3, 0.8, -0.2])
    place = lens.intersect_plane((x, y), through)
    assert np.abs(lens.project(place[None])[0][0] - [x, y]).max() < 1e-6
    assert abs((place - through) @ lens.forward) < 1e-9


def test_the_nearer_of_two_surfaces_is_picked(make_limb) -> None:
    lens = lens_of(0.0, 0.1)
    limbs = [make_limb("far", at=(0.0, 0.2, -0.5)), make_limb("near", at=(0.0, 0.2, 0.5))]
    stage = [standing(s, s.skeleton.positions) for s in limbs]
    at = lens.project(np.array([[0.0, 0.7, 0.56]]))[0][0]
    hit = find_surface_at(stage, lens, (float(at[0]), float(at[1])))
    assert hit is not None and hit.character == "near" and hit.handle == -1
    corners = limbs[1].mesh.vertices[limbs[1].mesh.faces[hit.face]]
    assert (corners[:, 2] > 0.5).all() and corners[:, 1].min() <= 0.7 <= corners[:, 1].max()
    assert find_surface_at(stage, lens, (3.0, 3.0)) is None


def test_points_behind_the_camera_are_not_picked(make_limb) -> None:
    lens = lens_of(0.0, 0.1)
    shape = make_limb()
    behind = np.add(shape.skeleton.positions, [0.0, 0.0, 60.0])
    posed = standing(shape, behind)
    assert find_joint_at([posed], lens, (450.0, 300.0), 1e9) is None
    assert find_bone_at([posed], lens, (450.0, 300.0), 1e9) is None
    assert find_crossings([posed], lens, np.array([[0.0, 0.0], [900.0, 600.0]])) == []
