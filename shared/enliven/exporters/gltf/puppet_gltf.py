"""Baked puppets in a glTF scene: joints below a node that moves through the world, or morph targets on that
node.

A joint turns, and stretches along three axes of its own, at right angles. These axes are the same in all
frames: the joint stands in them at rest, and its inverse bind matrix takes them back.
"""

from __future__ import annotations

import numpy as np
import pygltflib

from enliven.arrays import Float
from enliven.examples.baking import BakedMorphs, BakedSurface
from enliven.exporters.gltf.keys import needed_keys
from enliven.exporters.gltf.puppet_performance import PuppetPerformance
from enliven.exporters.gltf.scene import GltfScene
from enliven.exporters.gltf.shape import listed, stretches_of
from enliven.rotation import from_matrix


def add_puppet(scene: GltfScene, performance: PuppetPerformance) -> None:
    """Adds the puppet with its mesh and its motion."""
    holder = scene.node(name=f"{performance.name} frame", children=[])
    signs = np.ones(len(performance.turns))
    signs[1:] = np.cumprod(np.sign((performance.turns[1:] * performance.turns[:-1]).sum(1) + 1e-300))
    scene.animate(performance.times, holder, "translation", performance.places)
    turns = np.roll(performance.turns * signs[:, None], -1, -1)
    scene.animate(performance.times, holder, "rotation", turns)
    surface = performance.surface
    if isinstance(surface, BakedMorphs):
        _add_morphs(scene, performance, surface, holder)
        return
    joints = _joints(scene, performance, surface, holder)
    axes = np.tile(np.eye(3), (len(joints), 1, 1)) if surface.axes is None else surface.axes
    scene.skinned(performance.name, performance.mesh, surface.skin, holder, joints, surface.pivots, axes)


def _joints(
    scene: GltfScene, performance: PuppetPerformance, surface: BakedSurface, holder: int
) -> list[int]:
    """Adds a joint for each transform, with the keys that it needs."""
    axes = np.tile(np.eye(3), (len(surface.pivots), 1, 1)) if surface.axes is None else surface.axes
    turns, scales = stretches_of(surface.linear @ axes)
    standing = from_matrix(axes)
    most, reach = performance.keys / 3.0, reaches(performance, surface)
    joints = []
    for k, at in enumerate(surface.pivots):
        rest = np.roll(standing[k], -1)
        node = scene.node(holder, name=f"joint {k}", translation=listed(at), rotation=listed(rest))
        for path, values, within in (
            ("translation", surface.places[:, k], most),
            ("rotation", np.roll(turns[:, k], -1, -1), most / reach[k]),
            ("scale", scales[:, k], most / reach[k]),
        ):
            keys = needed_keys(values, within, path == "rotation")
            scene.animate(performance.times, node, path, values, keys)
        joints.append(node)
    return joints


def reaches(performance: PuppetPerformance, surface: BakedSurface) -> Float:
    """Returns (K,) metres: the largest distance of a transform's vertices from its pivot, in any frame."""
    far = np.zeros(len(surface.pivots))
    for slot in range(4):
        node, there = surface.skin.indices[:, slot], surface.skin.weights[:, slot] > 0.0
        away = np.linalg.norm(performance.mesh.vertices - surface.pivots[node], axis=1)
        np.maximum.at(far, node[there], away[there])
    stretch = np.linalg.norm(surface.linear, axis=2).max((0, 2))
    return np.asarray(np.maximum(far * np.maximum(stretch, 1.0), 1e-9))


def _add_morphs(scene: GltfScene, performance: PuppetPerformance, surface: BakedMorphs, holder: int) -> None:
    """Adds the mesh to the holder, with a target for each shape and their weights over time."""
    document, blob = scene.document, scene.blob
    primitive = scene.primitive(performance.name, performance.mesh)
    for shape, bent in zip(surface.targets, surface.normals, strict=True):
        attributes = (blob.add(values.astype(np.float32), pygltflib.ARRAY_BUFFER) for values in (shape, bent))
        primitive.targets.append(dict(zip(("POSITION", "NORMAL"), attributes, strict=True)))
    none = [0.0] * len(surface.targets)
    document.meshes.append(pygltflib.Mesh(name=performance.name, primitives=[primitive], weights=none))
    node = scene.node(holder, name=performance.name, mesh=len(document.meshes) - 1)
    # A weight moves no vertex farther than the longest way of its target.
    far = np.linalg.norm(surface.targets, axis=2).max(1)
    keys = needed_keys(surface.weights * far, performance.keys / np.sqrt(len(far)))
    stored = surface.weights[keys].astype(np.float32)
    scene.channel(performance.times[keys], node, "weights", blob.add(stored.ravel()))
    scene.put(holder)
