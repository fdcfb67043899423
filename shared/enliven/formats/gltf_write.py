"""Shapes and their motion as a GLB that any program plays: skinned meshes, joints and one animation.

A bone turns about its upper end, a glTF joint about itself. So bone j becomes a joint at its parent's place,
with the turn of bone j; it hangs on the joint of the bone before it, at the constant offset along that bone.
Only turns are animated (and the root's place), so links keep their lengths in every program, between the
frames too. Bones that begin at one place become joints at one place: the first that goes straight on has the
name of the place, the others say where they lead ("Hips to LeftUpLeg"). The end of a limb becomes a joint
that moves nothing, so that an editor shows the last bone in its length. Reading the file gives the same
skeleton again.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pygltflib

from enliven import __version__
from enliven.arrays import Float
from enliven.character import SkinWeights
from enliven.errors import InputError, ResourceError
from enliven.formats.gltf_blob import Blob
from enliven.formats.gltf_shape import (
    bone_names,
    clean_skin,
    linear16,
    listed,
    local_offsets,
    local_turns,
    pivots_of,
    stretches_of,
    unit32,
    unit_normals,
)
from enliven.graph_shape import GraphShape
from enliven.mesh import Mesh
from enliven.modeling.graph_pose import graph_pose
from enliven.motion.evaluate import Player
from enliven.project import Project
from enliven.rotation import IDENTITY, to_matrix
from enliven.shape import Shape

_STILL = 1e-7
"""How far a quaternion or a place (metres) may stray in all its frames and count as still."""


@dataclass(frozen=True, eq=False)
class Performance:
    """What a shape does.

    Attributes:
        shape: with its mesh.
        times: (T,) seconds, rising, from 0.
        turns: (T, N, 4) unit quaternions D_j of its bones.
        root: (T, 3) metres, where its root is.
    """

    shape: Shape
    times: Float
    turns: Float
    root: Float


@dataclass(frozen=True, eq=False)
class GraphPerformance:
    """What a possessed mesh does.

    Attributes:
        shape: the mesh and its nodes.
        times: (T,) seconds, rising, from 0.
        linear: (T, N, 3, 3) of its nodes, nearly rotations.
        positions: (T, N, 3) metres, where they are.
    """

    shape: GraphShape
    times: Float
    linear: Float
    positions: Float

    @property
    def lost(self) -> float:
        """The largest part of a node's map that a joint cannot say: the shear that is left of its stretch."""
        turns, scales = stretches_of(self.linear)
        return float(np.abs(to_matrix(turns) * scales[..., None, :] - self.linear).max())


def graph_performance_of(
    project: Project, shape_id: str, start: float = 0.0, end: float | None = None, rate: float = 30.0
) -> GraphPerformance:
    """A possessed mesh of a project from ``start`` to ``end`` seconds; as :func:`performance_of`."""
    shape = project.graph(shape_id)
    ends = [p.offset + project.streams[p.stream].duration / abs(p.speed) for p in shape.parts]
    times = _times(start, max(ends, default=0.0) if end is None else end, rate, shape_id)
    poses = [graph_pose(project, shape, float(time)) for time in times]
    linear, positions = np.stack([p[0] for p in poses]), np.stack([p[1] for p in poses])
    return GraphPerformance(shape, times - start, linear, positions)


def performance_of(
    project: Project, shape_id: str, start: float = 0.0, end: float | None = None, rate: float = 30.0
) -> Performance:
    """A shape of a project from ``start`` to ``end`` seconds, at ``rate`` frames a second.

    Args:
        end: None takes the end of the last layer that moves the shape.

    Raises:
        InputError: where there is no such shape, or the times make no sense.
    """
    shape = project.shape(shape_id)
    times = _times(start, end_of(project, shape) if end is None else end, rate, shape_id)
    turns, joints = Player(project, shape_id).sample(times)
    return Performance(shape, times - start, turns, joints[:, 0])


def _times(start: float, end: float, rate: float, shape_id: str) -> Float:
    """(T,) seconds from start to end."""
    if not (np.isfinite([start, end, rate]).all() and end >= start and 0 < rate <= 1000):
        what = f"from {start} s to {end} s at {rate} frames a second is no time"
        raise InputError(what, where=f"shape {shape_id!r}", mend="Give an end after the start.")
    return np.asarray(start + np.arange(round((end - start) * rate) + 1) / rate)


def end_of(project: Project, shape: Shape) -> float:
    """Seconds at which the last take that moves a shape ends; 0 where none does."""
    named = {ref.layer for spans in shape.spans for span in spans for ref in span.refs}
    named |= {shape.travel} if shape.travel else set()
    layers = [project.layers[name] for name in named if not project.layers[name].muted]
    ends = [layer.offset + project.takes[layer.take].duration / abs(layer.speed) for layer in layers]
    return max(ends, default=0.0)


def write_gltf(
    path: Path | str, performances: Sequence[Performance | GraphPerformance], name: str = "enliven"
) -> None:
    """Write shapes, each moving as it does, into one GLB with one animation.

    Raises:
        InputError: where there is none, or one has no mesh.
        ResourceError: where the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise InputError("shapes are written as .glb", where=str(path), mend="End the name in .glb.")
    data = glb_of(performances, name)
    beside = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(data)
        os.replace(beside, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        raise ResourceError(
            f"cannot be written ({error.strerror})", where=str(path), mend="Choose another place."
        ) from None


def glb_of(performances: Sequence[Performance | GraphPerformance], name: str = "enliven") -> bytes:
    """The bytes of the file; see :func:`write_gltf`."""
    if not performances:
        raise InputError("there is nothing to write", where="glTF", mend="Give a shape.")
    document, blob = pygltflib.GLTF2(), Blob()
    document.asset = pygltflib.Asset(version="2.0", generator=f"enliven {__version__}")
    document.scenes, document.scene = [pygltflib.Scene(name=name, nodes=[])], 0
    animation = pygltflib.Animation(name=name, channels=[], samplers=[])
    for performance in performances:
        _Writer(document, blob, animation).add(performance)
    if animation.channels:
        document.animations = [animation]
    document.bufferViews, document.accessors = blob.views, blob.accessors
    data = blob.bytes()
    document.buffers = [pygltflib.Buffer(byteLength=len(data))]
    document.set_binary_blob(data)
    return b"".join(document.save_to_bytes())


class _Writer:
    """Adds one shape to a document."""

    def __init__(self, document: pygltflib.GLTF2, blob: Blob, animation: pygltflib.Animation) -> None:
        self._document, self._blob, self._animation = document, blob, animation

    def add(self, performance: Performance | GraphPerformance) -> None:
        """The shape with its mesh, its joints and their animation."""
        if isinstance(performance, GraphPerformance):
            graph = performance.shape
            holder, nodes = self._nodes(performance)
            self._skinned(graph.id, graph.mesh, graph.skin, [holder, *nodes], nodes, graph.positions)
            return
        shape = performance.shape
        if shape.mesh is None or shape.skin is None or not len(shape.mesh.faces):
            raise InputError(
                "it has no mesh", where=f"shape {shape.id!r}", mend="Give it one, or leave it out."
            )
        bones, skeleton = self._skeleton(performance), shape.skeleton
        ends = [j for j in range(1, len(skeleton)) if not skeleton.children[j]]
        pivots = np.concatenate([pivots_of(skeleton), skeleton.positions[ends]])
        self._skinned(shape.id, shape.mesh, shape.skin, bones, bones, pivots)

    def _skinned(
        self, name: str, mesh: Mesh, skin: SkinWeights, tree: list[int], joints: list[int], pivots: Float
    ) -> None:
        """A mesh that follows joints; ``tree`` begins with the node that all of them hang on."""
        document = self._document
        inverse = np.tile(np.eye(4, dtype=np.float32), (len(joints), 1, 1))
        # Column after column, as the format has matrices: the translation is the last row here.
        inverse[:, 3, :3] = -pivots
        made = pygltflib.Skin(
            name=name,
            joints=joints,
            skeleton=tree[0],
            inverseBindMatrices=self._blob.add(inverse.reshape(-1, 16)),
        )
        document.skins.append(made)
        primitive = self._primitive(name, mesh, skin, len(joints))
        document.meshes.append(pygltflib.Mesh(name=name, primitives=[primitive]))
        node = pygltflib.Node(name=name, mesh=len(document.meshes) - 1, skin=len(document.skins) - 1)
        document.scenes[0].nodes += [tree[0], self._node(node)]

    def _nodes(self, performance: GraphPerformance) -> tuple[int, list[int]]:
        """A joint for each node of a deformation graph, side by side under one that holds them."""
        rest = performance.shape.positions
        holder = self._node(pygltflib.Node(name=f"{performance.shape.id} nodes", children=[]))
        turns, scales = stretches_of(performance.linear)
        made = []
        for k, at in enumerate(rest):
            node = self._node(pygltflib.Node(name=f"node {k}", translation=listed(at)))
            self._document.nodes[holder].children.append(node)
            self._animate(performance.times, node, "translation", performance.positions[:, k])
            self._animate(performance.times, node, "rotation", np.roll(turns[:, k], -1, -1))
            self._animate(performance.times, node, "scale", scales[:, k])
            made.append(node)
        return holder, made

    def _node(self, node: pygltflib.Node) -> int:
        self._document.nodes.append(node)
        return len(self._document.nodes) - 1

    def _skeleton(self, performance: Performance) -> list[int]:
        """The nodes of the bones, then of the ends of limbs; their animation on the way."""
        skeleton = performance.shape.skeleton
        names, local = bone_names(skeleton), local_turns(skeleton, performance.turns)
        offsets = local_offsets(skeleton)
        bones: list[int] = []
        for j, parent in enumerate(skeleton.parents):
            offset = skeleton.positions[0] if j == 0 else offsets[j]
            node = self._node(pygltflib.Node(name=names[j], translation=listed(offset), children=[]))
            bones.append(node)
            if j:
                self._document.nodes[bones[parent]].children.append(node)
            self._animate(performance.times, node, "rotation", np.roll(local[:, j], -1, -1))
        self._animate(performance.times, bones[0], "translation", performance.root)
        for j in range(1, len(skeleton)):
            if not skeleton.children[j]:
                end = pygltflib.Node(name=skeleton.names[j], translation=listed(skeleton.vectors[j]))
                bones.append(self._node(end))
                self._document.nodes[bones[j]].children.append(bones[-1])
        return bones

    def _animate(self, times: Float, node: int, path: str, values: Float) -> None:
        """A channel for what moves; what is still is written at the node, or with two keys if it must be."""
        still = np.abs(values - values[0]).max() <= _STILL
        if still and (len(times) == 1 or _is_rest(self._document.nodes[node], path, values[0])):
            stored = unit32(values[:1])[0] if path == "rotation" else values[0]
            setattr(self._document.nodes[node], path, listed(stored))
            return
        kept = np.array([0, len(times) - 1]) if still else np.arange(len(times))
        stored = unit32(values[kept]) if path == "rotation" else values[kept].astype(np.float32)
        sampler = pygltflib.AnimationSampler(
            input=self._times(times[kept]), output=self._blob.add(stored), interpolation="LINEAR"
        )
        self._animation.samplers.append(sampler)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        channel = pygltflib.AnimationChannel(sampler=len(self._animation.samplers) - 1, target=target)
        self._animation.channels.append(channel)

    def _times(self, times: Float) -> int:
        """The accessor of key times; the same times are stored once."""
        stored = times.astype(np.float32)
        known = self.__dict__.setdefault("_known", {})
        key = stored.tobytes()
        if key not in known:
            known[key] = self._blob.add(stored)
        return int(known[key])

    def _primitive(self, name: str, mesh: Mesh, skin: SkinWeights, count: int) -> pygltflib.Primitive:
        blob = self._blob
        joints, weights = clean_skin(skin.indices, skin.weights)
        faces = mesh.faces.astype(np.uint16 if len(mesh.vertices) < 65535 else np.uint32)
        array, elements = pygltflib.ARRAY_BUFFER, pygltflib.ELEMENT_ARRAY_BUFFER
        small = joints.astype(np.uint8) if count <= 256 else joints
        attributes = pygltflib.Attributes(
            POSITION=blob.add(mesh.vertices.astype(np.float32), array),
            NORMAL=blob.add(unit_normals(mesh.vertex_normals()), array),
            JOINTS_0=blob.add(small, array),
            WEIGHTS_0=blob.add(weights, array),
        )
        if mesh.colours is not None:
            attributes.COLOR_0 = blob.add(linear16(mesh.colours), array, normalised=True)
        plain = pygltflib.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=0.9)
        self._document.materials.append(
            pygltflib.Material(name=name, pbrMetallicRoughness=plain, doubleSided=True)
        )
        return pygltflib.Primitive(
            attributes=attributes,
            indices=blob.add(faces.reshape(-1), elements),
            material=len(self._document.materials) - 1,
            mode=pygltflib.TRIANGLES,
        )


def _is_rest(node: pygltflib.Node, path: str, value: Float) -> bool:
    if path == "translation":
        rest = np.array(node.translation)
    else:
        rest = np.roll(IDENTITY, -1) if path == "rotation" else np.ones(3)
    return bool(np.abs(value - rest).max() <= _STILL)
