"""Tests that tiled, pruned, vectorised ray marching draws the surface of the whole body."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, pixel_rays, project, world_from_level_camera
from enliven.person.joints import BONES, Joint
from enliven_synthesis.body.body_sdf import (
    BLEND_BETWEEN_GROUPS_M,
    DARK,
    GROUP_BLEND_WIDTHS_M,
    PIECES,
    TAPER,
    BodyAnatomy,
    BodySdf,
)
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.scene import MIRROR, Box, cast_room

CAMERA = Intrinsics(162, 122, 145.0, 145.0, 80.0, 60.0)  # not a multiple of the tile size
WORLD_FROM_CAMERA = world_from_level_camera(1.15, np.radians(5.0))
CAMERA_FROM_WORLD = np.linalg.inv(WORLD_FROM_CAMERA)


def _united(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k / 4


def slow_field(sdf: BodySdf, points: np.ndarray) -> np.ndarray:
    """Returns (N,) distances of (N, 3) points to the whole body, without tiles or pruning."""
    whole = np.full(len(points), 1e9)
    for group in range(len(GROUP_BLEND_WIDTHS_M)):
        part = np.full(len(points), 1e9)
        for i in np.flatnonzero(sdf.group == group):
            s = sdf.shape[i]
            if sdf.kind[i] == TAPER:
                t = np.clip((points - s[:3]) @ s[3:6] * s[6], 0, 1)
                radius = s[7] + t * s[8] + 4 * t * (1 - t) * s[9]
                d = np.linalg.norm(points - s[:3] - t[:, None] * s[3:6], axis=-1) - radius
            else:
                q = (points - s[:3]) @ s[3:12].reshape(3, 3).T
                k0 = np.linalg.norm(q, axis=-1)
                d = k0 * (k0 - 1) / (np.linalg.norm(q * s[12:15], axis=-1) + 1e-12)
            part = _united(part, d, GROUP_BLEND_WIDTHS_M[group])
        whole = _united(whole, part, BLEND_BETWEEN_GROUPS_M)
    return whole


def _drawn(
    name: str, time: float, build: Proportions | None = None
) -> tuple[BodySdf, np.ndarray, np.ndarray, np.ndarray]:
    performer = Performer(build)
    figure = performer.pose(get_choreography(name).posture(time))
    sdf = BodyAnatomy(performer).place(figure, CAMERA_FROM_WORLD)
    depth, material = np.full((122, 162), np.inf), np.zeros((122, 162), np.uint8)
    DepthRenderer(CAMERA).draw(sdf, depth, material)
    return sdf, depth, material, figure.joints


@pytest.mark.parametrize(
    ("name", "time", "build"),
    [
        ("chair", 0.5, None),
        ("chair", 2.1, None),
        ("chair", 3.05, Proportions(height=1.4, girth=1.3)),
        ("chair", 6.0, None),
        ("wave", 2.0, Proportions(height=1.9, girth=0.8)),
    ],
)
def test_picture_matches_the_surface(name: str, time: float, build: Proportions | None) -> None:
    sdf, depth, _, _ = _drawn(name, time, build)
    ray = np.concatenate([pixel_rays(CAMERA), np.ones((122, 162, 1))], -1)
    hit = np.isfinite(depth)
    assert 500 < hit.sum() < 0.4 * hit.size
    assert np.abs(slow_field(sdf, ray[hit] * depth[hit][:, None])).max() < 1.5e-3
    # No part of the body is in front of the drawn surface, or on a ray without a hit.
    rng = np.random.default_rng(3)
    v, u = np.nonzero(hit | np.roll(hit, 3, 1) | np.roll(hit, -3, 0))
    for n in rng.choice(len(v), 60, replace=False):
        z = np.arange(1.5, min(depth[v[n], u[n]] - 0.01, 3.6), 0.004)
        assert slow_field(sdf, ray[v[n], u[n]] * z[:, None]).min() > -2e-3


def test_the_flesh_is_around_the_bones() -> None:
    sdf, _, _, joints = _drawn("chair", 0.5)
    inside = joints @ CAMERA_FROM_WORLD[:3, :3].T + CAMERA_FROM_WORLD[:3, 3]
    assert slow_field(sdf, inside).max() < -0.015
    for a, b in BONES:
        middle = (inside[a] + inside[b])[None] / 2
        assert slow_field(sdf, middle)[0] < -0.01


@pytest.mark.parametrize("time", [0.5, 3.05, 6.0, 8.4])
def test_joints_are_just_behind_the_surface(time: float) -> None:
    _, depth, _, joints = _drawn("chair", time)
    camera = joints @ CAMERA_FROM_WORLD[:3, :3].T + CAMERA_FROM_WORLD[:3, 3]
    pixels = np.rint(project(camera, CAMERA)).astype(int)
    behind = camera[:, 2] - depth[pixels[:, 1], pixels[:, 0]]
    assert np.isfinite(behind).all()
    assert behind.min() > 0.0
    assert np.median(behind) < 0.13  # A limb occludes the other joints.


def test_hair_and_shoes_are_dark() -> None:
    _, depth, material, _ = _drawn("chair", 8.7)  # bending forward: the top of the head is visible
    v, _ = np.nonzero((material == DARK) & np.isfinite(depth))
    assert (v < 50).any() and (v > 90).any()
    assert not material[~np.isfinite(depth)].any()


def test_both_sides_have_the_same_pieces() -> None:
    left = [p for p in PIECES if p.limb.name.endswith("LEFT")]
    right = [p for p in PIECES if p.limb.name.endswith("RIGHT")]
    assert len(left) == len(right) > 15


def test_a_still_room_hides_the_performer() -> None:
    performer = Performer()
    figure = performer.pose(get_choreography("idle").posture(0.0))
    sdf = BodyAnatomy(performer).place(figure, CAMERA_FROM_WORLD)
    depth, material = np.full((122, 162), 1.5), np.zeros((122, 162), np.uint8)
    DepthRenderer(CAMERA).draw(sdf, depth, material)
    assert (depth == 1.5).all() and not material.any()


def test_room_is_at_its_position() -> None:
    depth, material = cast_room(CAMERA, WORLD_FROM_CAMERA)
    points = np.concatenate([pixel_rays(CAMERA), np.ones((122, 162, 1))], -1) * depth[..., None]
    world = points @ WORLD_FROM_CAMERA[:3, :3].T + WORLD_FROM_CAMERA[:3, 3]
    assert np.isfinite(depth).all()
    assert np.allclose(world[-1, 60:100, 1], 0.0, atol=1e-9)  # the floor at the bottom of the image
    assert world[..., 1].min() > -1e-9
    assert np.isclose(world[10, 70, 2], -3.88)
    assert (material == MIRROR).sum() > 50


def slow_entry(origin: np.ndarray, direction: np.ndarray, box: Box) -> np.ndarray:
    """Returns (H, W) the multiple of ``direction`` (H, W, 3) at which it enters a box, inf if it misses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = ((np.array(side) - origin) / direction for side in (box.low, box.high))
    # A ray in the plane of a face gives NaN, and this face does not count.
    enter = np.fmax.reduce(np.minimum(low, high), axis=2)
    leave = np.fmin.reduce(np.maximum(low, high), axis=2)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


_corner = st.tuples(*[st.sampled_from([-1.0, 0.0, 0.5]) | st.floats(-3, 3)] * 3)
_size = st.tuples(*[st.sampled_from([0.5, 1.0]) | st.floats(0.05, 2)] * 3)


@settings(deadline=None, max_examples=30)
@given(
    st.lists(st.tuples(_corner, _size), min_size=1, max_size=5), _corner, st.sampled_from([0.0, 0.4, -1.9])
)
def test_room_matches_the_slow_reference(boxes: list, at: tuple, yaw: float) -> None:
    """Corners, cameras and rays are often coplanar: axis-aligned parts are cast without a rotation."""
    camera = Intrinsics(24, 18, 20.0, 20.0, 12.0, 9.0)
    room = tuple(Box(low, tuple(np.add(low, size)), i % 3) for i, (low, size) in enumerate(boxes))
    mount = world_from_level_camera(1.0, 0.3 * yaw, yaw) if yaw else np.eye(4)
    mount[:3, 3] = at
    depth, material = cast_room(camera, mount, room)
    ray = np.concatenate([pixel_rays(camera), np.ones((18, 24, 1))], 2)
    hits = np.stack(
        [slow_entry(mount[:3, 3], (ray[..., None, :] * mount[:3, :3]).sum(-1), box) for box in room]
    )
    # A ray through the edge of a box, or into two boxes at once, may give either result.
    assert np.isclose(depth, hits.min(0), rtol=1e-9).mean() > 0.97
    stuff = np.array([box.material for box in room])
    is_hit = np.isfinite(depth)
    chosen = np.isclose(hits, depth, rtol=1e-9) & (stuff[:, None, None] == material)
    assert chosen.any(0)[is_hit].mean() > 0.97 if is_hit.any() else not material.any()


_whole = st.tuples(*[st.integers(-4, 4)] * 3)
_turns = st.tuples(st.permutations(range(3)), st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3))


@settings(deadline=None)
@given(st.lists(st.tuples(_whole, _whole), min_size=1, max_size=4), _whole, _turns)
@example([((0, 0, 2), (1, 1, 1))], (0, 0, 0), ((0, 1, 2), (1.0, 1.0, 1.0)))
@example([((0, 0, 2), (1, 1, 1))], (1, 1, 0), ((0, 1, 2), (-1.0, -1.0, 1.0)))
def test_a_ray_that_lies_in_a_side_of_a_box_meets_it(boxes: list, at: tuple, turn: tuple) -> None:
    """All coordinates are whole metres, so rays lie exactly in a face and enter after a whole number of
    steps.
    """
    order, signs = turn
    mount = np.eye(4)
    mount[:3, :3] = np.eye(3)[list(order)] * signs
    mount[:3, 3] = at
    room = tuple(Box(low, tuple(np.add(low, np.abs(size) + 1)), i % 3) for i, (low, size) in enumerate(boxes))
    depth, material = cast_room(Intrinsics(3, 3, 1.0, 1.0, 1.0, 1.0), mount, room)
    steps = np.arange(-30, 31)
    for v, u in np.ndindex(3, 3):
        along = mount[:3, :3] @ (u - 1, v - 1, 1)
        places = at + steps[:, None] * along
        entered = []
        for box in room:
            within = steps[((places >= box.low) & (places <= box.high)).all(1)]
            entered.append(float(within[0]) if len(within) and within[0] > 0 else np.inf)
        assert depth[v, u] == min(entered)
        assert material[v, u] == (room[int(np.argmin(entered))].material if min(entered) < np.inf else 0)


def test_a_box_is_cut_by_the_ray_where_geometry_says() -> None:
    depth, _ = cast_room(CAMERA, np.eye(4), (Box((-1, -1, 2.0), (1, 1, 3.0)),))
    ray = pixel_rays(CAMERA)
    inside = (np.abs(ray) * 2.0 < 1).all(-1)
    assert (depth[inside] == 2.0).all()
    assert np.isinf(depth[(np.abs(ray) * 2.0 > 1.001).any(-1)]).all()


def test_the_ankle_is_above_the_sole() -> None:
    sdf, _, _, joints = _drawn("idle", 0.0)
    for ankle in (Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT):
        heights = np.linspace(-0.03, 0.05, 81)
        below = np.stack([np.full(81, joints[ankle, 0]), heights, np.full(81, joints[ankle, 2])], -1)
        camera = below @ CAMERA_FROM_WORLD[:3, :3].T + CAMERA_FROM_WORLD[:3, 3]
        sole = heights[np.flatnonzero(slow_field(sdf, camera) < 0)[0]]
        assert abs(sole) < 0.02
