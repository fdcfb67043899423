"""Meshes, skin weights and measures for the tests of cuts, unions and weights."""

import numpy as np
import trimesh

from enliven.document.character import SkinWeights
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh, weld


def ball(radius=0.1, middle=(0.0, 0.0, 0.0), detail=3, name="ball"):
    sphere = trimesh.creation.icosphere(detail)
    return Mesh(sphere.vertices * radius + np.array(middle), sphere.faces, name)


def tube(radius=0.2, length=2.0, around=12, step=0.125, name="tube"):
    """Returns a closed tube along z from the origin."""
    rings = int(length / step) + 1
    turn = 2 * np.pi * np.arange(around) / around
    ring = radius * np.stack([np.cos(turn), np.sin(turn)], 1)
    points = [[*xy, z] for z in np.linspace(0, length, rings) for xy in ring]
    points += [[0.0, 0.0, 0.0], [0.0, 0.0, length]]
    faces = []
    for i in range(rings - 1):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            faces += [[a, b, b + around], [a, b + around, a + around]]
    last = (rings - 1) * around
    for j in range(around):
        k = (j + 1) % around
        faces += [[len(points) - 2, k, j], [len(points) - 1, last + j, last + k]]
    return Mesh(np.array(points), np.array(faces), name)


def flat_shaded(mesh):
    """Returns the same mesh with three separate vertices for every face."""
    colours = None if mesh.colours is None else mesh.colours[mesh.faces.ravel()]
    numbers = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    return Mesh(mesh.vertices[mesh.faces.ravel()], numbers, mesh.name, colours)


def line(points, names=None):
    """Returns a skeleton along points. Each joint is the parent of the next."""
    points = np.asarray(points, float)
    names = names or tuple(f"j{i}" for i in range(len(points)))
    return Skeleton(names, np.arange(len(points)) - 1, points)


def random_skin(count, bones, seed=0):
    rng = np.random.default_rng(seed)
    indices = np.argsort(rng.random((count, max(bones, 4))), 1)[:, :4] % bones
    weights = rng.random((count, 4)).astype(np.float32)
    if bones < 4:
        indices[:, 1:], weights[:, 1:] = 0, 0.0
    return SkinWeights(indices.astype(np.uint16), weights / weights.sum(1, keepdims=True))


def on_bone(mesh, bone):
    """Returns skin weights that follow one bone entirely."""
    indices, weights = np.zeros((len(mesh.vertices), 4)), np.zeros((len(mesh.vertices), 4))
    indices[:, 0], weights[:, 0] = bone, 1.0
    return SkinWeights(indices.astype(np.uint16), weights.astype(np.float32))


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def watertight(mesh):
    """Returns True if every edge, by position, occurs exactly once in each direction."""
    faces = weld(mesh)[0].faces
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ahead, counts = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0)
    return bool((counts == 1).all() and len(ahead) == len(back) and (ahead == back).all())


def partition_of_unity(skin):
    return bool(
        np.allclose(skin.weights.sum(1), 1, atol=1e-6)
        and skin.weights.min() >= 0
        and skin.weights.max() <= 1 + 1e-6
    )


def same_bits(a, b):
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()
