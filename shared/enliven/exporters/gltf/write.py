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

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphShape, Project, Shape
from enliven.errors import InputError
from enliven.examples.baking import stretch_axes
from enliven.exporters.gltf.puppet_gltf import add_puppet
from enliven.exporters.gltf.puppet_performance import PuppetPerformance
from enliven.exporters.gltf.scene import GltfScene
from enliven.exporters.gltf.shape import (
    bone_names,
    listed,
    local_offsets,
    local_turns,
    pivots_of,
    stretches_of,
)
from enliven.files import write_file
from enliven.modeling.possessed import graph_pose
from enliven.modeling.puppet import frame_times
from enliven.motion.layers import Player
from enliven.rotation import from_matrix, to_matrix


@dataclass(frozen=True, eq=False)
class Performance:
    """A skinned shape with its motion.

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
    """A possessed mesh with the motion of its deformation graph.

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
        """The largest part of a node's map that a joint cannot express: stretch along axes that change."""
        axes = self.axes
        turns, scales = stretches_of(self.linear @ axes)
        said = to_matrix(turns) * scales[..., None, :] @ axes.transpose(0, 2, 1)
        return float(np.abs(said - self.linear).max())

    @property
    def axes(self) -> Float:
        """(N, 3, 3) rotations: the axes along which each node stretches."""
        return stretch_axes(self.linear)


AnyPerformance = Performance | GraphPerformance | PuppetPerformance


def graph_performance_of(
    project: Project, shape_id: str, start: float = 0.0, end: float | None = None, rate: float = 30.0
) -> GraphPerformance:
    """Samples a possessed mesh of a project from ``start`` to ``end`` seconds; see :func:`performance_of`."""
    shape = project.graph(shape_id)
    times = frame_times(start, project.end_of(shape) if end is None else end, rate, shape_id)
    poses = [graph_pose(project, shape, float(time)) for time in times]
    linear, positions = np.stack([p[0] for p in poses]), np.stack([p[1] for p in poses])
    return GraphPerformance(shape, times - start, linear, positions)


def performance_of(
    project: Project, shape_id: str, start: float = 0.0, end: float | None = None, rate: float = 30.0
) -> Performance:
    """Samples a shape of a project from ``start`` to ``end`` seconds, at ``rate`` frames a second.

    Args:
        end: None takes the end of the last layer that moves the shape.

    Raises:
        InputError: where there is no such shape, or the times make no sense.
    """
    shape = project.shape(shape_id)
    times = frame_times(start, project.end_of(shape) if end is None else end, rate, shape_id)
    turns, joints = Player(project, shape_id).sample(times)
    return Performance(shape, times - start, turns, joints[:, 0])


def write_gltf(path: Path | str, performances: Sequence[AnyPerformance], name: str = "enliven") -> None:
    """Writes shapes with their motion into one GLB with one animation.

    Raises:
        InputError: where there is none, or one has no mesh.
        ResourceError: where the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise InputError("shapes are written as .glb", where=str(path), mend="End the name in .glb.")
    write_file(path, glb_of(performances, name), "Choose another place.")


def glb_of(performances: Sequence[AnyPerformance], name: str = "enliven") -> bytes:
    """Returns the bytes of the file; see :func:`write_gltf`."""
    if not performances:
        raise InputError("there is nothing to write", where="glTF", mend="Give a shape.")
    scene = GltfScene(name)
    for performance in performances:
        if isinstance(performance, PuppetPerformance):
            add_puppet(scene, performance)
        elif isinstance(performance, GraphPerformance):
            _add_graph(scene, performance)
        else:
            _add_shape(scene, performance)
    return scene.bytes()


def _add_shape(scene: GltfScene, performance: Performance) -> None:
    """Adds the shape with its mesh, its joints and their animation."""
    shape = performance.shape
    if shape.mesh is None or shape.skin is None or not len(shape.mesh.faces):
        raise InputError("it has no mesh", where=f"shape {shape.id!r}", mend="Give it one, or leave it out.")
    bones, skeleton = _skeleton(scene, performance), shape.skeleton
    ends = [j for j in range(1, len(skeleton)) if not skeleton.children[j]]
    pivots = np.concatenate([pivots_of(skeleton), skeleton.positions[ends]])
    scene.skinned(shape.id, shape.mesh, shape.skin, bones[0], bones, pivots)


def _skeleton(scene: GltfScene, performance: Performance) -> list[int]:
    """Adds the nodes of the bones, then of the ends of limbs, and animates them."""
    skeleton = performance.shape.skeleton
    names, local = bone_names(skeleton), local_turns(skeleton, performance.turns)
    offsets = local_offsets(skeleton)
    bones: list[int] = []
    for j, parent in enumerate(skeleton.parents):
        offset = skeleton.positions[0] if j == 0 else offsets[j]
        above = bones[parent] if j else None
        node = scene.node(above, name=names[j], translation=listed(offset), children=[])
        bones.append(node)
        scene.animate(performance.times, node, "rotation", np.roll(local[:, j], -1, -1))
    scene.animate(performance.times, bones[0], "translation", performance.root)
    for j in range(1, len(skeleton)):
        if not skeleton.children[j]:
            bones.append(
                scene.node(bones[j], name=skeleton.names[j], translation=listed(skeleton.vectors[j]))
            )
    return bones


def _add_graph(scene: GltfScene, performance: GraphPerformance) -> None:
    """Adds the mesh, and a joint for each node of its graph, side by side below one holder."""
    graph, times = performance.shape, performance.times
    holder = scene.node(name=f"{graph.id} nodes", children=[])
    axes = performance.axes
    turns, scales = stretches_of(performance.linear @ axes)
    standing = from_matrix(axes)
    made = []
    for k, at in enumerate(graph.positions):
        rest = listed(np.roll(standing[k], -1))
        node = scene.node(holder, name=f"node {k}", translation=listed(at), rotation=rest)
        scene.animate(times, node, "translation", performance.positions[:, k])
        scene.animate(times, node, "rotation", np.roll(turns[:, k], -1, -1))
        scene.animate(times, node, "scale", scales[:, k])
        made.append(node)
    scene.skinned(graph.id, graph.mesh, graph.skin, holder, made, graph.positions, axes)
