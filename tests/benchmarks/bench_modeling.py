"""Measures cuts, unions, skin weights and sketches, compared with the best available peer.

The measurements run after warm-up, on one thread.

- cut: a limb of a 10,000-vertex body cut across, with skin weights. Peer: manifold3d's own split by a plane,
  which does not transfer skin weights or vertex numbers, and cuts everything that the plane intersects.
- union: two overlapping spheres of 10,000 vertices each. Peer: libigl's boolean over CGAL (exact), which does
  not transfer skin weights or vertex numbers either.
- bone heat: 10,000 vertices, 30 bones. The first peer is the same heat method in plain SciPy, without
  visibility tests and with all bones kept. The second peer is libigl's biharmonic weights with a handle in
  the middle of each bone. They are neither bounded nor limited to four bones, because the bounded weights
  crash on a surface without tetrahedra.
- sketch: from a tentacle's stroke to a rigged part. There is no peer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import igl
import igl.copyleft.cgal
import manifold3d
import numpy as np
import trimesh
from figure import Figure
from scipy.sparse import diags
from scipy.sparse.linalg import splu
from strokes import tentacle
from threadpoolctl import threadpool_limits

from enliven.arrays import Float
from enliven.document.character import SkinWeights
from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.modeling.mesh.mesh_cut import cut_across_bone
from enliven.modeling.mesh.mesh_union import unite_meshes
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.modeling.skinning.heat_diffusion import bone_heat, bone_segments

BONES = 30


def figures() -> Iterator[Figure]:
    """Yields one figure for each of the four operations."""
    with threadpool_limits(1):
        yield cut_figure()
        yield union_figure()
        yield from heat_figures()
        stroke = tentacle()
        yield Figure("modeling.sketch_ms", 1e3 * time_fastest(lambda: shape_from_stroke(stroke)), "ms")


def limb(vertices: int = 10_000) -> Mesh:
    """Returns a tube with round ends along z from 0 to 2, with even triangles."""
    around = int(np.sqrt(vertices * 2 * np.pi * 0.15 / 2.0))
    rings = vertices // around
    z = np.linspace(0.02, 1.98, rings)
    radius = 0.15 * np.sqrt(np.clip(1 - np.maximum(np.abs(z - 1) - 0.85, 0) ** 2 / 0.15**2, 0, 1))
    turn = 2 * np.pi * (np.arange(around)[None] + 0.5 * (np.arange(rings)[:, None] % 2)) / around
    points = np.stack([radius[:, None] * np.cos(turn), radius[:, None] * np.sin(turn)], -1)
    points = np.concatenate([points, np.broadcast_to(z[:, None, None], (rings, around, 1))], -1)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    odd = (i % 2 == 1)[..., None]
    first = np.where(odd, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    second = np.where(odd, np.stack([a, d, c], -1), np.stack([b, d, c], -1))
    count = rings * around
    ring = np.arange(around)
    low = np.stack([np.full(around, count), (ring + 1) % around, ring], -1)
    high = np.stack(
        [np.full(around, count + 1), count - around + ring, count - around + (ring + 1) % around], -1
    )
    faces = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3), low, high])
    return Mesh(np.concatenate([points.reshape(-1, 3), [[0, 0, 0], [0, 0, 2.0]]]), faces, "limb")


def chain(bones: int = BONES) -> Skeleton:
    """Returns a row of bones along the middle of the limb."""
    places = np.zeros((bones + 1, 3))
    places[:, 2] = np.linspace(0.05, 1.95, bones + 1)
    return Skeleton(tuple(f"j{i}" for i in range(bones + 1)), np.arange(bones + 1) - 1, places)


def cut_figure() -> Figure:
    mesh, skeleton = limb(), chain()
    skin = bone_heat(mesh, skeleton)
    ours = time_fastest(lambda: cut_across_bone(mesh, skin, skeleton, 15, 0.4))
    peer = time_fastest(lambda: split_by_library(mesh))
    return Figure("modeling.cut_ms", 1e3 * ours, "ms", "manifold3d's own split, without skin", peer / ours)


def split_by_library(mesh: Mesh) -> None:
    """Converts to the library's mesh, cuts, and converts back. Returns both sides with caps, cut everywhere
    on the plane.
    """
    solid = manifold3d.Manifold(manifold3d.Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))
    for side in solid.split_by_plane((0.0, 0.0, 1.0), 0.97):
        side.to_mesh64()


def union_figure() -> Figure:
    sphere = trimesh.creation.icosphere(5)
    first = Mesh(sphere.vertices, sphere.faces, "first")
    second = Mesh(sphere.vertices * 0.8 + np.array([0.9, 0.1, 0.05]), sphere.faces, "second")
    skins = [make_one_bone(mesh) for mesh in (first, second)]
    ours = time_fastest(lambda: unite_meshes(first, skins[0], second, skins[1], 1))
    faces = sphere.faces.astype(np.int64)
    peer = time_fastest(
        lambda: igl.copyleft.cgal.mesh_boolean(first.vertices, faces, second.vertices, faces, "union"), 0.0, 2
    )
    return Figure("modeling.union_ms", 1e3 * ours, "ms", "libigl's boolean over CGAL", peer / ours)


def make_one_bone(mesh: Mesh) -> SkinWeights:
    indices, weights = (
        np.zeros((len(mesh.vertices), 4), np.uint16),
        np.zeros((len(mesh.vertices), 4), np.float32),
    )
    weights[:, 0] = 1.0
    return SkinWeights(indices, weights)


def heat_figures() -> Iterator[Figure]:
    mesh, skeleton = limb(), chain()
    ours = time_fastest(lambda: bone_heat(mesh, skeleton))
    segments, _ = bone_segments(skeleton)
    plain = time_fastest(lambda: compute_plain_heat(mesh, segments), 0.5)
    yield Figure("modeling.bone_heat_ms_10k", 1e3 * ours, "ms", "plain SciPy, without sight", plain / ours)
    handles = np.array([np.linalg.norm(mesh.vertices - s.mean(0), axis=1).argmin() for s in segments])
    faces = mesh.faces.astype(np.int64)
    peer = time_fastest(lambda: igl.harmonic(mesh.vertices, faces, handles, np.eye(len(handles)), 2), 0.5)
    yield Figure(
        "modeling.bone_heat_vs_libigl_ms_10k", 1e3 * ours, "ms", "libigl's biharmonic weights", peer / ours
    )


def compute_plain_heat(mesh: Mesh, segments: Float) -> Float:
    """Returns (V, B) bone heat in its simplest form, in which every vertex sees every bone."""
    starts, vectors = segments[:, 0], segments[:, 1] - segments[:, 0]
    away = mesh.vertices[:, None] - starts[None]
    u = np.clip((away * vectors[None]).sum(2) / (vectors**2).sum(1), 0, 1)
    distance = np.linalg.norm(away - u[..., None] * vectors[None], axis=2)
    nearest = distance.argmin(1)
    faces = mesh.faces.astype(np.int64)
    mass = igl.massmatrix(mesh.vertices, faces, igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    heat = mass / distance.min(1) ** 2
    matrix = (diags(heat) - igl.cotmatrix(mesh.vertices, faces)).tocsc()
    return splu(matrix).solve(heat[:, None] * np.eye(len(segments))[nearest])


def time_fastest(job: Callable[[], object], seconds: float = 1.0, runs: int = 3) -> float:
    """Returns the seconds of the fastest run. It repeats for ``seconds``, but at least ``runs`` times."""
    if runs > 1:
        job()
    took: list[float] = []
    while len(took) < runs or sum(took) < seconds:
        start = time.perf_counter()
        job()
        took.append(time.perf_counter() - start)
    return min(took)
