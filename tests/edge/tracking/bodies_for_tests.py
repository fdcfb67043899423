"""Random postures, points on their surface, and inputs of the compiled terms of the fit."""

from __future__ import annotations

import numpy as np

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.capsules import nearest_capsules
from enliven_edge.tracking.body_model.kinematics import pivots_by_length
from enliven_edge.tracking.body_model.posture import Posture, forward
from enliven_edge.tracking.fit.gauss_newton import apply_step
from enliven_edge.tracking.fit.normal_equations import add_sums, empty_sums, ends_by_length
from enliven_edge.tracking.fit.structures import CapsuleSurface, PlacedFrames

TURNS = (model.DOF_FRAME, model.DOF_AXIS)
NO_AFFINITY = np.zeros((0, 0), np.float32)


def moved_by(posture: Posture, step) -> Posture:
    return Posture(*apply_step(posture.position, posture.rotations, posture.lengths, step, *TURNS))


def random_posture(seed: int, spread: float = 0.3) -> Posture:
    """Returns a person about 2.5 m in front of the sensor with random limb rotations."""
    random = np.random.default_rng(seed)
    posture = Posture(
        np.array([0.1, 0.95, -2.5]), joint_limits.standing_pose(), model.lengths_for_height(1.7)
    )
    step = np.concatenate([random.normal(0, 0.05, 3), random.normal(0, spread, model.DOFS - 3), np.zeros(12)])
    return moved_by(posture, step)


def body_of(posture: Posture, free: int = 12):
    """Returns the inputs of the fit's terms. ``free`` is the number of variable lengths, 12 or 0."""
    world, pivots = forward(posture.position, posture.rotations, posture.lengths)
    by_length = np.empty((13, 3, free))
    pivots_by_length(by_length, world, posture.rotations, model.FRAME_PARENTS, model.PIVOTS)
    turns = (model.MOVES, *TURNS, model.FRAME_LENGTHS, model.FRAME_PARENTS)
    return PlacedFrames(world, pivots, by_length, *turns)


def surroundings(posture: Posture, free: int = 12, *, taper: bool = False):
    """Returns the posture's surface in the form that the terms use, see
    :mod:`enliven_edge.tracking.fit.terms`.

    The terms keep the axis point nearest to a sample fixed, which is exact only without taper.
    """
    ends, radii = posture.capsules()
    radii = radii if taper else np.repeat(radii[:, :1], 2, axis=1)
    by_ends = np.empty((len(ends), 2, 3, free))
    ends_by_length(by_ends, body_of(posture, free), model.CAPSULES.frame, model.CAPSULES.ends)
    girth = posture.lengths[model.GIRTH]
    return CapsuleSurface(ends, radii, model.CAPSULES.frame, by_ends, model.FRAME_LENGTHS, girth)


def gathered(term, posture: Posture, free: int = 12):
    """Returns (return value, gradient, matrix) of a term that adds to sums."""
    sums, count = empty_sums(13, free), model.DOFS + free
    returned = term(sums)
    matrix, gradient = np.zeros((count, count)), np.zeros(count)
    add_sums(matrix, gradient, sums, body_of(posture, free))
    return returned, gradient, matrix


def surface_points(posture: Posture, seed: int, count: int = 80, noise: float = 0.01):
    """Returns points on the posture's capsules, moved by noise, and their outward normals."""
    random = np.random.default_rng(seed)
    ends, radii = posture.capsules()
    which = random.integers(0, len(ends), count)
    t = random.uniform(0.1, 0.9, count)[:, None]
    axis = ends[which, 1] - ends[which, 0]
    normal = np.cross(axis, random.normal(size=(count, 3)))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    radius = radii[which, :1]
    points = (
        ends[which, 0] * (1 - t)
        + ends[which, 1] * t
        + normal * (radius + random.normal(0, noise, (count, 1)))
    )
    return points.astype(np.float32), normal.astype(np.float32)


def seen_as(points, normals):
    """Returns (6, M) points and normals as the compiled search expects them."""
    return np.ascontiguousarray(np.concatenate([points.T, normals.T]))


def foot(x, y, z, ends, radii):
    """Returns (t, signed distance): the position along a capsule's axis that is nearest to a point, and
    metres to its surface.
    """
    point, way = np.array([x, y, z]) - ends[0], ends[1] - ends[0]
    t = np.clip(point @ way / (way @ way + 1e-12), 0.0, 1.0)
    return t, np.linalg.norm(point - t * way) - radii[0] - t * (radii[1] - radii[0])


def nearest(point, normal, ends, radii, likes=np.zeros(0, np.float32)):
    """Returns (capsule, t, signed distance) from the compiled search."""
    seen, which = np.concatenate([point, normal]).astype(np.float32)[:, None], np.empty(1, np.int32)
    nearest_capsules(which, seen, likes[:, None], ends, radii, np.float32(0.04))
    c = int(which[0])
    return c, *foot(*point, ends[c], radii[c])
