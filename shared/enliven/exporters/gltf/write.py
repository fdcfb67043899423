"""Writes characters and their motion as a GLB for any program: skinned meshes, joints and one animation.

A bone rotates about its upper end, and a glTF joint rotates about its own position. So bone j becomes a joint
at the bone's upper end, with the rotation of bone j. This joint is a child of the parent bone's joint, at the
constant offset along the parent bone. If no bone is stretched, only rotations and the root's position are
animated. Then bones keep their lengths in every program, also between the frames. Bones that are moved or
stretched have tracks of position and scale. Bones that start at the same joint become glTF joints at the same
position. The joint with the bone that is the straightest continuation keeps the joint's name, and the names
of the others contain their target ("Hips to LeftUpLeg"). The end of a limb becomes a joint without vertices,
so that an editor shows the last bone with its length. Reading the file gives the same skeleton again.

Transforms without a skeleton become sibling joints below a node that moves through the world. Such a joint
rotates, and stretches along three orthogonal axes, which are constant over time. The joint's rest orientation
contains these axes, and its inverse bind matrix cancels them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.examples.baking.morphs import BakedMorphs
from enliven.exporters.gltf.keys import reduce_keys
from enliven.exporters.gltf.scene import GltfScene
from enliven.exporters.joints import joint_tracks, json_numbers
from enliven.exporters.performance import Performance, split_stretch
from enliven.exporters.registry import Exporter
from enliven.files import write_file
from enliven.meshes import Mesh
from enliven.rotation import from_matrix, remove_sign_jumps

_MAX_UPRIGHT_DIFFERENCE = 1e-9
"""Maximum difference between the entries of a node's axes and of the world axes at which cubic curves are
kept. The curves are in world axes."""


def write_gltf(
    path: Path | str, performances: Sequence[Performance], name: str = "enliven", morphs: bool = False
) -> None:
    """Writes characters with their motion into one GLB with one animation.

    Args:
        morphs: True if puppets were baked to morph targets, which only this file format supports. It is
            ignored.

    Raises:
        InputError: if there is no character, or a character has no mesh.
        ResourceError: if the file cannot be written.
    """
    write_file(Path(path), build_glb(performances, name), "Choose another output file.")


GLB = Exporter(write_gltf, keyed=True)


def build_glb(performances: Sequence[Performance], name: str = "enliven") -> bytes:
    """Returns the bytes of the file. See :func:`write_gltf`."""
    if not performances:
        raise InputError("no character was selected", where="glTF", remedy="Select at least one character.")
    scene = GltfScene(name)
    for performance in performances:
        if performance.skeleton is not None:
            _add_skeleton(scene, performance, performance.skeleton)
        elif performance.morphs is not None:
            _add_morphs(scene, performance, performance.morphs)
        else:
            _add_joints(scene, performance)
    return scene.bytes()


def _add_skeleton(scene: GltfScene, performance: Performance, skeleton: Skeleton) -> None:
    """Adds the mesh, the joints of bones and limb ends, and their animation."""
    mesh, skin = performance.surface
    tracks = joint_tracks(performance, skeleton)
    is_turned = np.abs(tracks.axes - np.eye(3)).max() > _MAX_UPRIGHT_DIFFERENCE
    curves = {} if is_turned else {(curve.bone, curve.turns): curve for curve in performance.cubic}
    times, nodes = performance.times, list[int]()
    for j, (name, parent) in enumerate(zip(tracks.names, tracks.parents, strict=True)):
        rest_pose = {"translation": json_numbers(tracks.offsets[j])}
        is_bone = j < tracks.bones
        if is_bone:
            rest_pose["children"] = []
        if is_bone and tracks.stretches:
            rest_pose["rotation"] = json_numbers(np.roll(tracks.rest[j], -1))
        node = scene.node(nodes[parent] if j else None, name=name, **rest_pose)
        nodes.append(node)
        if (j, True) in curves:
            scene.add_curve(node, "rotation", curves[j, True])
        elif is_bone:
            scene.animate(times, node, "rotation", np.roll(tracks.turns[:, j], -1, -1))
        if is_bone and tracks.stretches:
            scene.animate(times, node, "scale", tracks.scales[:, j])
        if j and tracks.stretches:
            scene.animate(times, node, "translation", tracks.places[:, j])
    if (0, False) in curves:
        scene.add_curve(nodes[0], "translation", curves[0, False])
    else:
        scene.animate(times, nodes[0], "translation", tracks.places[:, 0])
    axes = tracks.axes if tracks.stretches else None
    scene.add_skinned(performance.name, mesh, skin, nodes[0], nodes, tracks.pivots, axes)


def _add_joints(scene: GltfScene, performance: Performance) -> None:
    """Adds the mesh, and an animated joint for each transform. Keys are reduced."""
    mesh, skin = performance.surface
    holder, pivots = _add_holder_node(scene, performance), performance.pivots
    axes = np.tile(np.eye(3), (len(pivots), 1, 1)) if performance.axes is None else performance.axes
    rotations, scales = split_stretch(performance.linear @ axes)
    standing = from_matrix(axes)
    tolerance, reach = performance.keys / 3.0, compute_largest_reaches(performance)
    joints = []
    for k, pivot in enumerate(pivots):
        rest_rotation = np.roll(standing[k], -1)
        node = scene.node(
            holder, name=f"joint {k}", translation=json_numbers(pivot), rotation=json_numbers(rest_rotation)
        )
        for path, values, channel_tolerance in (
            ("translation", performance.positions[:, k], tolerance),
            ("rotation", np.roll(rotations[:, k], -1, -1), tolerance / reach[k]),
            ("scale", scales[:, k], tolerance / reach[k]),
        ):
            keys = reduce_keys(values, channel_tolerance, path == "rotation", performance.times)
            scene.animate(performance.times, node, path, values, keys)
        joints.append(node)
    scene.add_skinned(performance.name, mesh, skin, holder, joints, pivots, axes)


def _add_holder_node(scene: GltfScene, performance: Performance) -> int:
    """Adds a node with the motion of the performance's coordinate frame in the world. Returns its number."""
    holder = scene.node(name=f"{performance.name} frame", children=[])
    if performance.turns is not None and performance.places is not None:
        rotations = remove_sign_jumps(performance.turns[:, None])[:, 0]
        scene.animate(performance.times, holder, "translation", performance.places)
        scene.animate(performance.times, holder, "rotation", np.roll(rotations, -1, -1))
    return holder


def compute_largest_reaches(performance: Performance) -> Float:
    """Returns the largest distance (J,) in metres of each transform's vertices from its pivot, over all
    frames.
    """
    mesh, skin = performance.surface
    reach = np.zeros(len(performance.pivots))
    for slot in range(4):
        node, is_moved = skin.indices[:, slot], skin.weights[:, slot] > 0.0
        distances = np.linalg.norm(mesh.vertices - performance.pivots[node], axis=1)
        np.maximum.at(reach, node[is_moved], distances[is_moved])
    stretch = np.linalg.norm(performance.linear, axis=2).max((0, 2))
    return np.asarray(np.maximum(reach * np.maximum(stretch, 1.0), 1e-9))


def _add_morphs(scene: GltfScene, performance: Performance, morphs: BakedMorphs) -> None:
    """Adds the mesh below a holder node, with a morph target for each shape and their weights over time."""
    mesh: Mesh = performance.surface[0]
    document, blob, holder = scene.document, scene.blob, _add_holder_node(scene, performance)
    primitives, array = [], pygltflib.ARRAY_BUFFER
    for primitive, vertices in scene.add_primitives(performance.name, mesh):
        for shape, normals in zip(morphs.targets, morphs.normals, strict=True):
            added = (blob.add(values[vertices].astype(np.float32), array) for values in (shape, normals))
            primitive.targets.append(dict(zip(("POSITION", "NORMAL"), added, strict=True)))
        primitives.append(primitive)
    no_weights = [0.0] * len(morphs.targets)
    document.meshes.append(pygltflib.Mesh(name=performance.name, primitives=primitives, weights=no_weights))
    node = scene.node(holder, name=performance.name, mesh=len(document.meshes) - 1)
    # The product of a weight and the largest displacement of its target bounds the motion of any vertex. So
    # the tolerance for dropping keys can be given in metres.
    reach = np.linalg.norm(morphs.targets, axis=2).max(1)
    within = performance.keys / np.sqrt(len(reach))
    keys = reduce_keys(morphs.weights * reach, within, times=performance.times)
    stored_weights = morphs.weights[keys].astype(np.float32)
    scene.add_channel(performance.times[keys], node, "weights", blob.add(stored_weights.ravel()))
    scene.add_roots(holder)
