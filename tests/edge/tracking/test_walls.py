"""Walls taken out of a group of pixels."""

import numpy as np

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.frame.observation import WorkingCamera, world_points
from enliven_edge.tracking.frame.view import View
from enliven_edge.tracking.scene.walls import _best_line, without_walls

CAMERA = WorkingCamera(Intrinsics(160, 120, 130, 130, 79.5, 59.5), 160)
MOUNT = world_from_level_camera(1.2)


def standing(*places, wall=3.4):
    """A view of upright half cylinders (x, z, radius), as people are, before a wall; and who they are."""
    z = np.full((120, 160), wall)
    x, y = CAMERA.ray[..., 0], 1.2 - CAMERA.ray[..., 1] * wall
    for at, depth, radius in places:
        off = x * depth - at
        inside = (np.abs(off) < radius) & (y < 1.75)
        z[inside] = depth - np.sqrt(radius**2 - off[inside] ** 2)
    noise = 0.004 * np.random.default_rng(0).standard_normal(z.shape) * z
    return View(0, z + noise, world_points(z + noise, CAMERA.ray, MOUNT), CAMERA, MOUNT), z < wall


def test_who_stands_before_a_wall_is_left_and_the_wall_is_not():
    view, people = standing((-0.6, 3.0, 0.2), (0.5, 3.1, 0.2))
    rest = without_walls(view, np.ones(people.shape, bool))
    assert rest[people].mean() > 0.9
    assert rest[~people].mean() < 0.03


def test_two_who_stand_apart_are_no_wall():
    view, people = standing((-0.7, 2.2, 0.25), (0.6, 2.2, 0.25))
    assert (without_walls(view, people) == people).all()


def test_the_best_line_is_the_best_of_all_pairs():
    """Against the obvious count."""
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
    assert np.isclose(worth(_best_line(points, thickness, weight, pairs)), max(map(worth, lines)))
