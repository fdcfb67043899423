"""Objects of known shape, for scanning: a stool, a bear of round parts, a plant with thin leaves."""

from collections.abc import Callable

import numpy as np
import trimesh

from enliven.meshes import Mesh

LEAF_POSES = 9
"""Number of leaves of the plant, each 2 mm thick."""


def _mesh(parts: list[trimesh.Trimesh], name: str) -> Mesh:
    """Returns the union of parts as one mesh without inner surfaces, upright on y = 0."""
    whole = trimesh.boolean.union(parts, engine="manifold")
    vertices = np.asarray(whole.vertices) - [0.0, whole.bounds[0][1], 0.0]
    return Mesh(vertices, np.asarray(whole.faces, np.int32), name)


def _rod(low: tuple, high: tuple, radius: float) -> trimesh.Trimesh:
    return trimesh.creation.cylinder(radius, segment=np.array([low, high], float), sections=20)


def _ball(middle: tuple, radii: tuple) -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.apply_scale(np.array(radii, float))
    ball.apply_translation(middle)
    return ball


def stool() -> Mesh:
    """Returns a round seat on three legs 3 cm thick, and a ring between them."""
    feet = [(0.2 * np.cos(a), 0.0, 0.2 * np.sin(a)) for a in 2 * np.pi * np.arange(3) / 3]
    tops = [(0.12 * np.cos(a), 0.45, 0.12 * np.sin(a)) for a in 2 * np.pi * np.arange(3) / 3]
    ring = [tuple(0.6 * np.array(foot) + 0.4 * np.array(top)) for foot, top in zip(feet, tops, strict=True)]
    legs = [_rod(foot, top, 0.015) for foot, top in zip(feet, tops, strict=True)]
    bars = [_rod(ring[k], ring[(k + 1) % 3], 0.01) for k in range(3)]
    return _mesh([*legs, *bars, _rod((0.0, 0.45, 0.0), (0.0, 0.49, 0.0), 0.17)], "stool")


def bear() -> Mesh:
    """Returns the round parts of a sitting bear: trunk, head, ears, arms and legs."""
    parts = [_ball((0.0, 0.2, 0.0), (0.15, 0.2, 0.13)), _ball((0.0, 0.47, 0.02), (0.12, 0.11, 0.11))]
    for side in (-1.0, 1.0):
        parts += [
            _ball((0.09 * side, 0.57, 0.0), (0.04, 0.045, 0.025)),
            _ball((0.18 * side, 0.27, 0.05), (0.05, 0.1, 0.05)),
            _ball((0.1 * side, 0.07, 0.16), (0.06, 0.065, 0.13)),
        ]
    return _mesh([*parts, _ball((0.0, 0.44, 0.12), (0.05, 0.04, 0.04))], "bear")


def plant() -> Mesh:
    """Returns a pot, a stem, and thin leaves around it."""
    profile = [(0.0, 0.0), (0.09, 0.0), (0.13, 0.22), (0.0, 0.22)]
    pot = trimesh.creation.revolve(np.array(profile), sections=40)
    pot.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1.0, 0.0, 0.0]))
    parts = [pot, _rod((0.0, 0.2, 0.0), (0.0, 0.6, 0.0), 0.012)]
    for k in range(LEAF_POSES):
        leaf = trimesh.creation.box((0.22, 0.002, 0.09))
        leaf.apply_translation([0.13, 0.0, 0.0])
        leaf.apply_transform(trimesh.transformations.rotation_matrix(0.5, [0.0, 0.0, 1.0]))
        leaf.apply_transform(trimesh.transformations.rotation_matrix(2 * np.pi * k * 0.382, [0.0, 1.0, 0.0]))
        leaf.apply_translation([0.0, 0.3 + 0.032 * k, 0.0])
        parts.append(leaf)
    return _mesh(parts, "plant")


SCANNED_OBJECTS: dict[str, Callable[[], Mesh]] = {"stool": stool, "bear": bear, "plant": plant}
"""The objects by name."""
