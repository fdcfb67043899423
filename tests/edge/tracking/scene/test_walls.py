"""Tests of removing walls from a pixel group."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.scene.walls import find_best_line, remove_walls

CAMERA = WorkingCamera(Intrinsics(160, 120, 130, 130, 79.5, 59.5), 160)
MOUNT = world_from_level_camera(1.2)


def standing(*places, wall=3.4):
    """Returns a view of upright half cylinders (x, z, radius) in front of a wall, and each pixel's
    cylinder.
    """
    z = np.full((120, 160), wall)
    x, y = CAMERA.ray[..., 0], 1.2 - CAMERA.ray[..., 1] * wall
    for at, depth, radius in places:
        off = x * depth - at
        inside = (np.abs(off) < radius) & (y < 1.75)
        z[inside] = depth - np.sqrt(radius**2 - off[inside] ** 2)
    noise = 0.004 * np.random.default_rng(0).standard_normal(z.shape) * z
    return FrameView(0, z + noise, world_points(z + noise, CAMERA.ray, MOUNT), CAMERA, MOUNT), z < wall


def test_wall_is_removed_and_people_before_it_are_kept():
    view, people = standing((-0.6, 3.0, 0.2), (0.5, 3.1, 0.2))
    rest = remove_walls(view, np.ones(people.shape, bool))
    assert rest[people].mean() > 0.9
    assert rest[~people].mean() < 0.03


def test_two_who_stand_apart_are_no_wall():
    view, people = standing((-0.7, 2.2, 0.25), (0.6, 2.2, 0.25))
    assert (remove_walls(view, people) == people).all()


def obvious_rest(view, mask):
    """Returns the result of :func:`without_walls`, computed with arrays of all pixels."""
    rest, pixel, random = mask.copy(), 1 / 130**2, np.random.default_rng(0)
    for _ in range(4):
        flat, z = view.points[rest][:, [0, 2]], view.z[rest]
        if (z**2).sum() * pixel < 0.9:
            break
        step = max(1, len(z) // 1500)
        some, deep = flat[::step].copy(), z[::step].copy()
        pairs = random.integers(0, len(some), (150, 2))
        line = find_best_line(some, 0.03 + 0.006 * deep**2, deep**2 * pixel * step, pairs)
        on = np.abs(flat @ line[:2] + line[2]) < 0.03 + 0.006 * z**2
        along = flat[on] @ np.array([-line[1], line[0]])
        low, high = np.percentile(along, [2, 98]) if on.any() else (0.0, 0.0)
        if (z[on] ** 2).sum() * pixel < 0.9 or high - low < 0.9:
            break
        counts, _ = np.histogram(along, np.arange(low, high + 0.15, 0.15))
        if np.mean(counts > 0.25 * counts.mean()) <= 0.8:
            break
        rest[tuple(np.argwhere(rest)[on].T)] = False
    return rest


@given(st.floats(-1.0, 1.0), st.floats(2.2, 3.0), st.floats(3.1, 4.0), st.floats(0.3, 1.0))
@settings(max_examples=15, deadline=None)
def test_the_walls_are_those_of_the_obvious_search(at, near, wall, share):
    view, _ = standing((at, near, 0.2), (at + 0.8, near + 0.1, 0.2), wall=wall)
    mask = np.random.default_rng(0).uniform(size=view.z.shape) < share
    # A point on the border of a wall may fall to either side of it.
    assert (remove_walls(view, mask) != obvious_rest(view, mask)).sum() <= 2


def test_the_best_line_is_the_best_of_all_pairs():
    """Compared with exhaustive counting."""
    random = np.random.default_rng(1)
    points, weight = random.uniform(-1, 1, (60, 2)), random.uniform(0.5, 1, 60)
    points[:25, 1] = 0.3 * points[:25, 0] + 0.1
    thickness = np.full(60, 0.03)
    pairs = random.integers(0, 60, (80, 2))

    def worth(line):
        return weight[np.abs(points @ line[:2] + line[2]) < thickness].sum()

    lines = []
    for p, q in points[pairs]:
        along = q - p
        if np.linalg.norm(along) >= 0.3:
            normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            lines.append(np.append(normal, -normal @ p))
    assert np.isclose(worth(find_best_line(points, thickness, weight, pairs)), max(map(worth, lines)))
