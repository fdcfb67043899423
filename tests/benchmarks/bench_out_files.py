"""Measures the export of a character with 10,000 vertices and 24 bones: written frames per second, by format.

A figure includes everything after sampling: conversion, formatting and writing the file. The points of USD
are those of the same character without its skeleton.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from figure import Figure

from enliven.document import Skeleton, SkinWeights
from enliven.exporters import Performance, exporter_of
from enliven.meshes import Mesh
from enliven.rotation import from_rotation_vector, multiply, rotate, to_matrix

VERTICES, BONES, FRAMES, RATE = 10_000, 24, 300, 30.0
_ROUNDS = 3
"""Number of exports of each format. The fastest counts."""


def figures() -> Iterator[Figure]:
    """Yields the frames per second of each format."""
    performance = bending_chain()
    formats = [("glb", "out.glb", performance), ("bvh", "out.bvh", performance)]
    if find_spec("pxr") is not None:
        points = replace(performance, skeleton=None, joints=None)
        formats += [("usd", "out.usdc", performance), ("usd_points", "out.usdc", points)]
    for name, file, exported in formats:
        yield Figure(f"out.export_fps_{name}", FRAMES / _time_fastest(file, exported), "frames/s")


def _time_fastest(file: str, performance: Performance) -> float:
    """Returns the shortest time of an export in seconds."""
    least = np.inf
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / file
        exporter = exporter_of(path)
        for _ in range(_ROUNDS):
            begin = time.perf_counter()
            exporter.save(path, [performance], "bench")
            least = min(least, time.perf_counter() - begin)
    return float(least)


def bending_chain() -> Performance:
    """Returns an upright tube on a chain of bones that swing independently."""
    height = np.linspace(0.0, 2.0, BONES + 1)
    positions = np.stack([0 * height, height, 0 * height], 1)
    names = tuple(f"joint {j}" for j in range(BONES + 1))
    skeleton = Skeleton(names, np.arange(-1, BONES), positions)
    times = np.arange(FRAMES) / RATE
    random = np.random.default_rng(0)
    swings = 0.1 * np.sin(times[:, None, None] * random.uniform(1, 4, (1, BONES + 1, 3)))
    turns, joints = from_rotation_vector(swings), np.zeros((FRAMES, BONES + 1, 3))
    for j in range(1, BONES + 1):
        turns[:, j] = multiply(turns[:, j - 1], turns[:, j])
        joints[:, j] = joints[:, j - 1] + rotate(turns[:, j], skeleton.vectors[j])
    above = np.maximum(skeleton.parents, 0)
    mesh, skin = _tube(skeleton)
    return Performance(
        "chain",
        times,
        positions[above],
        to_matrix(turns),
        joints[:, above],
        mesh,
        skin,
        skeleton=skeleton,
        joints=joints,
    )


def _tube(skeleton: Skeleton) -> tuple[Mesh, SkinWeights]:
    """Returns an open tube around the chain, and its skin weights."""
    rings, around = VERTICES // 50, 50
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    heights = np.repeat(np.linspace(0.0, 2.0, rings), around)
    vertices = np.stack(
        [0.1 * np.tile(np.cos(angle), rings), heights, 0.1 * np.tile(np.sin(angle), rings)], 1
    )
    at = np.arange((rings - 1) * around)
    right = at // around * around + (at + 1) % around
    faces = np.concatenate(
        [np.stack([at, at + around, right], 1), np.stack([right, at + around, right + around], 1)]
    )
    place = np.clip(heights / 2.0 * BONES, 0.0, BONES - 1e-6)
    bone = np.floor(place).astype(int) + 1
    indices, weights = np.zeros((len(vertices), 4), np.uint16), np.zeros((len(vertices), 4), np.float32)
    indices[:, 0], indices[:, 1] = bone, np.minimum(bone + 1, BONES)
    weights[:, 1] = (place % 1.0) * (bone < BONES)
    weights[:, 0] = 1.0 - weights[:, 1]
    return Mesh(vertices, faces.astype(np.int32)), SkinWeights(indices, weights)
