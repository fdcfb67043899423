"""Implements the edits of whole characters for skeletons with skin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    GraphCharacter,
    GraphPart,
    Layer,
    MotionKey,
    PoseStream,
    Project,
    Ref,
    RiggedCharacter,
    character_of,
    clip_from_keys,
    unused,
)
from enliven.modeling.mesh.meshes import compute_posed_vertices
from enliven.modeling.rig import CharacterState, Merge, Player, RigEdits
from enliven.modeling.rigged.axes import Axes, convert_mesh_axes
from enliven.modeling.rigged.bones import bone_number, list_bones, rebuild_shape
from enliven.modeling.rigged.merging import merge as merge_shapes
from enliven.modeling.rigged.posed import compute_pose, pose_with_stretch, with_travel_kept
from enliven.modeling.rigged.posing import drag_joint
from enliven.modeling.rigged.stroke_cut import cut_shape_along_stroke
from enliven.motion.layers.evaluate import Player as ShapePlayer
from enliven.motion.layers.evaluate import pose_from
from enliven.rotation import IDENTITY, multiply, normalized, rotate


class ShapeRig(RigEdits):
    """Implements the edits of whole characters for skeletons with skin."""

    make_drawing = staticmethod(character_of)
    cut = staticmethod(cut_shape_along_stroke)

    def centre(self, shape: RiggedCharacter) -> Float:
        """Returns the position (3,) of the root in the rest pose, in metres."""
        return np.asarray(shape.skeleton.positions[0] + shape.place)

    def rest(self, shape: RiggedCharacter) -> Float:
        """Returns the vertices at rest, (V, 3) metres. For a skeleton without a mesh, returns its joints."""
        return shape.skeleton.positions if shape.mesh is None else shape.mesh.vertices

    def compute_vertices(self, project: Project, shape: RiggedCharacter, time: float) -> Float:
        """Returns the vertices at a time, (V, 3) metres. For a shape without a mesh, returns its joints."""
        pose = pose_with_stretch(project, shape, time)
        return pose.joints if shape.mesh is None else compute_posed_vertices(shape, pose.linear, pose.joints)

    def create_surface_player(self, project: Project, shape: RiggedCharacter) -> Callable[[float], Float]:
        """Returns a function from a time to the vertices (V, 3) in metres. For a shape without a mesh, it
        returns the joints."""
        if shape.mesh is not None:
            return super().create_surface_player(project, shape)
        prepared = ShapePlayer(project, shape.id)
        return lambda time: prepared.compute_pose(time).joints

    def create_player(self, project: Project, shape: RiggedCharacter) -> Player:
        """Returns a function that evaluates the compiled layers. The handles are the joints."""
        prepared = ShapePlayer(project, shape.id)

        def at(time: float) -> CharacterState:
            moment = prepared.compute_pose(time)
            return CharacterState(pose_from(shape, moment, time), moment.joints)

        return at

    def drag_handle(
        self, project: Project, shape: RiggedCharacter, handle: int, place: Float, time: float
    ) -> Project:
        """Points the bone of the joint at ``place``. If the joint is the root, the shape is moved there."""
        return drag_joint(project, shape.id, handle, place, time)

    def key_layer(self, project: Project, shape: RiggedCharacter, handle: int) -> int | None:
        """Returns the number of the first layer of keys that moves the bone, or None."""
        laid = {ref.layer for span in shape.spans[handle] for ref in span.refs}
        numbers = (
            k for k, layer in enumerate(shape.layers) if layer.id in laid and project.takes[layer.take].keys
        )
        return next(numbers, None)

    def find_keyable(self, shape: RiggedCharacter, handle: int | str) -> int:
        """Returns the number of a bone."""
        return bone_number(shape, handle)

    def with_key_layer(
        self, project: Project, shape: RiggedCharacter, handle: int, key: MotionKey
    ) -> Project:
        """Adds a layer of rotations as the innermost layer of the bone's last span."""
        bone = shape.skeleton.names[handle]
        clip = clip_from_keys(unused(f"{bone} keys", project.takes), bone, [key])
        name = unused(f"{bone} keys", project.layer_names)
        *others, last = shape.spans[handle]
        spans = list(shape.spans)
        spans[handle] = (*others, replace(last, refs=(*last.refs, Ref(name, 0.0, 1.0))))
        layers = (*shape.layers, Layer(name, clip.id, (0,)))
        shape = shape.with_changes(spans=tuple(spans), layers=layers)
        return project.with_takes(clip).with_characters(shape)

    def move(self, shape: RiggedCharacter, offset: Float, turn: Float, about: Float) -> RiggedCharacter:
        """Moves the shape by changing the root's modeling rotation and position, and the basis of its
        travel."""
        place = rotate(turn, self.centre(shape) - about) + about + offset - shape.skeleton.positions[0]
        if np.array_equal(turn, IDENTITY):
            return shape.with_changes(place=shape.place + offset)
        modeling = np.array(shape.modeling)
        modeling[0] = normalized(multiply(turn, modeling[0]))
        layers, travel = _turn_travel(shape, turn)
        return shape.with_changes(place=place, modeling=modeling, layers=layers, travel=travel)

    def scale(self, shape: RiggedCharacter, factor: float) -> RiggedCharacter:
        """Scales the rest pose and the strides. Rotations do not change."""
        centre = shape.skeleton.positions[0]
        bones = [bone._replace(rest=centre + factor * (bone.rest - centre)) for bone in list_bones(shape)]
        mesh = shape.mesh
        if mesh is not None:
            mesh = replace(mesh, vertices=centre + factor * (mesh.vertices - centre))
        stride = None if shape.travel_scale is None else shape.travel_scale * factor
        return rebuild_shape(shape, bones, mesh=mesh, travel_scale=stride)

    def mirror(self, project: Project, shape: RiggedCharacter, axes: Axes) -> RiggedCharacter:
        """Reflects the rest pose and the mesh. Modeling rotations and layers are conjugated by the reflection
        (M D M)."""
        centre = shape.skeleton.positions[0]
        bones = [
            bone._replace(
                rest=centre + axes.vectors(bone.rest - centre) if bone.parent else bone.rest,
                modeling=normalized(axes.rotations(bone.modeling)),
                spans=axes.spans(bone.spans),
            )
            for bone in list_bones(shape)
        ]
        mesh = None if shape.mesh is None else convert_mesh_axes(shape.mesh, centre, axes, centre)
        layers = tuple(axes.layer(layer) for layer in shape.layers)
        return with_travel_kept(project, shape, rebuild_shape(shape, bones, mesh=mesh, layers=layers))

    def convert_to_graph_shape(
        self, project: Project, shape: RiggedCharacter, times: Float, stream_id: str
    ) -> tuple[GraphCharacter, PoseStream, str]:
        """Converts each bone to a node at its start. Skin and pose do not change, and the result is exact at
        the given times."""
        drawn, mesh = character_of(shape), shape.mesh
        assert mesh is not None
        prepared = ShapePlayer(project, shape.id)
        turns, joints = prepared.sample(times)
        above, linear = np.maximum(shape.skeleton.parents, 0), prepared.compute_linear_maps(times, turns)
        stream = PoseStream(stream_id, linear, joints[:, above], float(times[1] - times[0]))
        part = GraphPart(stream_id, np.arange(len(above)), offset=float(times[0]))
        pivots = shape.skeleton.positions[above]
        return GraphCharacter(shape.id, pivots, drawn.edges, mesh, drawn.skin, (part,)), stream, ""

    def merge(self, project: Project, merge: Merge) -> Project:
        """Attaches the graft's root to the node, or by default to the nearest joint."""
        node, host, graft = merge.node, project.shape(merge.host), project.shape(merge.graft)
        if node is None:
            joints, root = (
                compute_pose(project, host, merge.time)[1],
                compute_pose(project, graft, merge.time)[1][0],
            )
            node = int(np.linalg.norm(joints - root, axis=1).argmin())
        options = {"at": merge.at, "loose": merge.loose, "seam": merge.seam, "notes": merge.notes}
        return merge_shapes(project, host.id, node, graft.id, merge.time, **options)[0]


def _turn_travel(shape: RiggedCharacter, turn: Float) -> tuple[tuple[Layer, ...], str | None]:
    """Returns the layers with the root's path rotated, and the id of the travel layer. If the old travel
    layer also rotates bones, a new travel layer is added."""
    if shape.travel is None:
        return shape.layers, None
    travel = shape.layer(shape.travel)
    turned = replace(travel, basis=normalized(multiply(turn, travel.basis)))
    if any(ref.layer == travel.id for spans in shape.spans for span in spans for ref in span.refs):
        turned = replace(
            turned, id=unused(f"{travel.id} way", dict.fromkeys(layer.id for layer in shape.layers))
        )
        return (*shape.layers, turned), turned.id
    return tuple(turned if layer is travel else layer for layer in shape.layers), travel.id
