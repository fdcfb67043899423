"""Random creatures, their point constraints, and fast motions: problems on which no solver was tuned.

A creature is a trunk of blended capsules with legs, a tail and antennae, some of them thin. Its bones rotate
randomly about their joints. They move points of its skin, as a performer's bones would.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from known_bodies import extract_surface_of_capsules

from enliven import rotation
from enliven.arrays import Float, Int32
from enliven.deformation.graph.connectivity import find_joining_edges, find_weak_edges
from enliven.deformation.graph.graph import DeformationGraph
from enliven.meshes import Mesh

RATE = 30.0
"""Frames a second."""


@dataclass
class Points:
    """Points in the rest pose (L, 3), the four nodes that move each (L, 4), and their weights (L, 4)."""

    points: Float
    node_indices: Int32
    node_weights: Float


@dataclass
class Bones:
    """The creature's capsules: each begins where its parent ends, or within the trunk.

    Attributes:
        parent: (B,) the bone before, -1 for the first.
        start, end: (B, 3) metres.
        radius: (B, 2) metres at both ends.
    """

    parent: list[int]
    start: list[Float]
    end: list[Float]
    radius: list[tuple[float, float]]

    def grow(self, parent: int, start: Float, way: Float, radius: tuple[float, float]) -> int:
        """Adds a bone; returns its number."""
        self.parent.append(parent)
        self.start.append(start)
        self.end.append(start + way)
        self.radius.append(radius)
        return len(self.parent) - 1


@dataclass
class Creature:
    """A problem for the solver.

    Attributes:
        targets: (F, L, 3) metres at 30 frames a second; in the first frame the points are at rest.
    """

    mesh: Mesh
    graph: DeformationGraph
    points: Points
    targets: Float


def _unit(v: Float) -> Float:
    return v / np.linalg.norm(v)


def random_bones(rng: np.random.Generator) -> Bones:
    """Returns a trunk of one to three capsules, two to five pairs of legs, and sometimes a tail and
    antennae."""
    bones = Bones([], [], [], [])
    thick = rng.uniform(0.06, 0.16)
    forward = np.array([0.0, rng.uniform(0.0, 1.0), 1.0])
    last, at = -1, np.array([0.0, 0.7, 0.0])
    for _ in range(rng.integers(1, 4)):
        way = rng.uniform(0.2, 0.45) * _unit(forward + 0.3 * rng.normal(size=3))
        last = bones.grow(last, at, way, (thick, thick * rng.uniform(0.7, 1.2)))
        at = bones.end[last]
    trunk = last + 1
    for _ in range(rng.integers(2, 6)):
        root = int(rng.integers(trunk))
        place = bones.start[root] + rng.random() * (bones.end[root] - bones.start[root])
        out = np.array([1.0, rng.uniform(-1.2, 0.6), rng.uniform(-0.6, 0.6)])
        thin, count, length = rng.uniform(0.015, 0.06), int(rng.integers(2, 4)), rng.uniform(0.18, 0.4)
        bend = rng.normal(size=3) * 0.5
        for side in (-1.0, 1.0):
            parent, at, way = root, place, out
            for _ in range(count):
                mirrored = _unit(way) * [side, 1.0, 1.0]
                parent = bones.grow(parent, at, length * mirrored, (thin, 0.8 * thin))
                at, way = bones.end[parent], _unit(way) + bend
    if rng.random() < 0.7:
        _add_chain(bones, 0, bones.start[0], -forward, rng, int(rng.integers(3, 7)), rng.uniform(0.015, 0.05))
    for side in (-1.0, 1.0) if rng.random() < 0.7 else ():
        way = forward + np.array([side * 0.5, 0.4, 0.0])
        _add_chain(bones, trunk - 1, bones.end[trunk - 1], way, rng, 3, 0.012)
    return bones


def _add_chain(
    bones: Bones, parent: int, at: Float, way: Float, rng: np.random.Generator, count: int, thin: float
) -> None:
    """Adds a tail or an antenna."""
    for _ in range(count):
        parent = bones.grow(parent, at, rng.uniform(0.1, 0.2) * _unit(way), (thin, 0.85 * thin))
        at, way = bones.end[parent], _unit(way) + 0.3 * rng.normal(size=3)


def generate_swings(
    bones: Bones, points: Float, of: Int32, rng: np.random.Generator, frames: int, pace: float
) -> Float:
    """Returns (F, L, 3) paths of points on bones ``of`` (L,). Every joint swings; the first bone also travels
    and turns.

    Args:
        pace: factor on the speed. At 1, hands move at 2 to 4 m/s, as in a dance. The motion starts from
            rest within a third of a second.
    """
    count = len(bones.parent)
    times = np.arange(frames) / RATE
    ease = np.minimum(times / 0.33, 1.0)[:, None]
    rate = rng.uniform(0.4, 1.6, (2, count, 3)) * pace
    phase = rng.uniform(0.0, 2 * np.pi, (2, count, 3))
    size = rng.uniform(0.1, 0.6, (count, 3)) / np.sqrt(3)
    out = np.empty((frames, len(points), 3))
    turns, places = np.empty((count, frames, 3, 3)), np.empty((count, frames, 3))
    for b, parent in enumerate(bones.parent):
        wave = np.sin(2 * np.pi * rate[0, b] * times[:, None] + phase[0, b]) - np.sin(phase[0, b])
        own = rotation.to_matrix(rotation.from_rotation_vector(ease * size[b] * wave))
        if parent < 0:
            travel = np.sin(2 * np.pi * 0.3 * rate[1, b] * times[:, None] + phase[1, b]) - np.sin(phase[1, b])
            turns[b], places[b] = own, bones.start[b] + ease * 0.5 * travel
        else:
            turns[b] = turns[parent] @ own
            places[b] = places[parent] + turns[parent] @ (bones.start[b] - bones.start[parent])
    for m, b in enumerate(of):
        out[:, m] = places[b] + turns[b] @ (points[m] - bones.start[b])
    return out


def bone_graph(bones: Bones, count: int, rng: np.random.Generator) -> tuple[DeformationGraph, Int32]:
    """Returns a graph of ``count`` nodes scattered on the bones' capsules, and the bone of each. It has no
    mesh."""
    start, end, radius = np.array(bones.start), np.array(bones.end), np.array(bones.radius)
    size = np.linalg.norm(end - start, axis=1) * np.sqrt(radius.mean(1))
    of = np.concatenate([np.arange(len(start)), rng.choice(len(start), count, p=size / size.sum())])[:count]
    along = rng.random(count)[:, None]
    out = rng.normal(size=(count, 3))
    out -= (out * (end - start)[of]).sum(1, keepdims=True) * _scaled_directions(end - start)[of]
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    positions = start[of] + along * (end - start)[of] + radius[of].mean(1)[:, None] * out
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    pairs = np.sort(np.stack([np.repeat(np.arange(count), 4), np.argsort(apart, 1)[:, 1:5].ravel()], 1), 1)
    edges = np.unique(np.concatenate([pairs, find_joining_edges(count, pairs, apart)]), axis=0).astype(
        np.int32
    )
    bridges, cuts, hanging = find_weak_edges(count, edges)
    return DeformationGraph(positions, out, np.zeros(count, np.int32), edges, hanging, bridges, cuts, 0.1), of


def _scaled_directions(ways: Float) -> Float:
    """Returns (B, 3) the bone vectors divided by their squared lengths."""
    return ways / (ways**2).sum(1, keepdims=True)


def random_problem(seed: int, nodes: int, frames: int, pace: float) -> Creature:
    """Returns a creature without a mesh, with random points attached to four nearby nodes each, in a random
    motion."""
    rng = np.random.default_rng(seed)
    bones = random_bones(rng)
    graph, of = bone_graph(bones, nodes, rng)
    chosen = rng.choice(nodes, nodes, replace=nodes < 8)
    apart = np.linalg.norm(graph.positions[chosen][:, None] - graph.positions[None], axis=2)
    indices = np.argsort(apart, 1)[:, :4].astype(np.int32)
    weights = 1.0 / (np.take_along_axis(apart, indices, 1) + 0.05)
    weights /= weights.sum(1, keepdims=True)
    held = (graph.positions[indices] * weights[..., None]).sum(1) + 0.01 * rng.normal(size=(nodes, 3))
    targets = generate_swings(bones, held, of[chosen], rng, frames, pace)
    targets[1:] += 0.003 * rng.normal(size=targets[1:].shape)
    return Creature(
        Mesh(graph.positions, np.empty((0, 3), np.int32)), graph, Points(held, indices, weights), targets
    )


def random_creature(seed: int, nodes: int = 128, frames: int = 60, pace: float = 1.0) -> Creature:
    """Returns the creature of a seed in a random motion, attached to points on about two thirds of its bones.

    A few bones are attached to points of another nearby bone, as happens for a performer in a mesh of other
    proportions. Targets have a tracker's noise of 3 mm.
    """
    rng = np.random.default_rng(seed)
    bones = random_bones(rng)
    capsules = [(a, b, *r) for a, b, r in zip(bones.start, bones.end, bones.radius, strict=True)]
    mesh = extract_surface_of_capsules(f"creature {seed}", capsules, cell=0.02, soft=0.006)
    graph = DeformationGraph.build(mesh, nodes=nodes)
    weights = graph.skin(mesh)
    chosen, of = [], []
    middle = (np.array(bones.start) + np.array(bones.end)) / 2
    for b in range(len(middle)):
        if rng.random() > 0.67 and b > 0:
            continue
        apart = np.linalg.norm(mesh.vertices - bones.start[b], axis=1)
        apart += np.linalg.norm(mesh.vertices - bones.end[b], axis=1)
        near = np.argsort(apart)[:60]
        taken = rng.choice(near, int(rng.integers(6, 17)), replace=False)
        chosen.append(taken)
        bone = int(np.argsort(np.linalg.norm(middle - middle[b], axis=1))[1]) if rng.random() < 0.15 else b
        of.append(np.full(len(taken), bone))
    picked, of = np.concatenate(chosen), np.concatenate(of)
    points = Points(
        mesh.vertices[picked],
        np.ascontiguousarray(weights.indices[picked], np.int32),
        np.asarray(weights.weights[picked], np.float64),
    )
    targets = generate_swings(bones, points.points, of, rng, frames, pace)
    targets[1:] += 0.003 * rng.normal(size=targets[1:].shape)
    return Creature(mesh, graph, points, targets)
