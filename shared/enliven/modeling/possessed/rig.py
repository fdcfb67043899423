"""Implements the edits of whole characters for deformation graphs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    GraphCharacter,
    GraphLayer,
    GraphPart,
    MotionKey,
    PoseStream,
    Project,
    Ride,
    character_from_graph_shape,
    make_keyed_stream,
    unused,
)
from enliven.modeling.possessed.following import find_followers
from enliven.modeling.possessed.pose import graph_pose, graph_vertices, pose_of_graph
from enliven.modeling.possessed.surgery import cut_graph, merge_graphs
from enliven.modeling.rig import CharacterState, HandleMotion, Player, RigEdits
from enliven.modeling.rigged.axes import Axes, convert_mesh_axes
from enliven.person import MIRROR
from enliven.rotation import IDENTITY, from_matrix, multiply, nearest_rotation, normalized, rotate

_MIRRORED_ENDS = [0, 2, 1, 4, 3]
"""The order of the five ends of a mesh in its mirror image: left and right are swapped."""


class GraphRig(RigEdits):
    """Implements the edits of whole characters for deformation graphs that play recorded motion."""

    make_drawing = staticmethod(character_from_graph_shape)
    cut = staticmethod(cut_graph)
    merge = staticmethod(merge_graphs)

    def centre(self, shape: GraphCharacter) -> Float:
        """Returns the position (3,) of node 0 at rest, in metres."""
        return np.asarray(shape.positions[0])

    def compute_vertices(self, project: Project, shape: GraphCharacter, time: float) -> Float:
        """Returns the vertices (V, 3) in metres at a time of the project."""
        return graph_vertices(shape, *graph_pose(project, shape, time))

    def create_player(self, project: Project, shape: GraphCharacter) -> Player:
        """Returns a function from a time to the pose. It has no handles, because nodes play recorded
        motion."""
        return lambda time: CharacterState(pose_of_graph(project, shape, time), np.zeros((0, 3)))

    def handle_motion(
        self, shape: GraphCharacter, player: Player, handle: int | None, layer: int | None
    ) -> HandleMotion:
        """Returns the motion of a node, or the mean motion of the nodes of a part."""
        if handle is not None:
            nodes = slice(handle, handle + 1)
        else:
            number = min(layer or 0, len(shape.parts) - 1)
            nodes = slice(shape.starts[number], shape.starts[number + 1])

        def at(time: float) -> tuple[Float, Float]:
            pose = player(time).pose
            mean = np.asarray(pose.linear[nodes], np.float64).mean(0)
            return from_matrix(nearest_rotation(mean)), np.asarray(pose.positions[nodes], np.float64).mean(0)

        return at

    def key_layer(self, project: Project, shape: GraphCharacter, handle: int) -> int | None:
        """Returns the number of the first layer with keys of the node, or None."""
        for number, layer in enumerate(shape.over):
            keyed = project.streams[layer.take].keyed
            if keyed >= 0 and (layer.own[layer.nodes == keyed] == handle).any():
                return len(shape.parts) + number
        return None

    def with_key_layer(self, project: Project, shape: GraphCharacter, handle: int, key: MotionKey) -> Project:
        """Adds a layer with the key on top of all other layers. It bends the mesh around the node."""
        own_nodes, follow = find_followers(shape, handle)
        name = unused(f"{shape.id} node {handle} keys", project.streams)
        rest = shape.positions[own_nodes]
        layer = GraphLayer(name, np.arange(len(own_nodes)), own_nodes, rest)
        shape = shape.with_changes(over=(*shape.over, layer))
        return project.with_streams(make_keyed_stream(name, rest, follow, [key])).with_characters(shape)

    def move(self, shape: GraphCharacter, offset: Float, turn: Float, about: Float) -> GraphCharacter:
        """Moves the motion of the shape. Its rest pose does not change, and parts with a ride follow their
        carrier."""
        parts = tuple(
            part
            if part.ride is not None
            else replace(
                part,
                turn=normalized(multiply(turn, part.turn)),
                place=rotate(turn, part.place - about) + about + offset,
            )
            for part in shape.parts
        )
        return shape.with_changes(parts=parts)

    def scale(self, shape: GraphCharacter, factor: float) -> GraphCharacter:
        """Scales the rest pose and the motion by ``factor`` about the centre."""
        centre = self.centre(shape)

        def larger(points: Float) -> Float:
            return centre + factor * (points - centre)

        parts = tuple(
            replace(
                part,
                size=part.size * factor,
                place=larger(part.place),
                ride=None if part.ride is None else replace(part.ride, place=larger(part.ride.place)),
            )
            for part in shape.parts
        )
        mesh = replace(shape.mesh, vertices=larger(shape.mesh.vertices))
        ends, joints = larger(shape.ends), larger(shape.joints)
        over = tuple(replace(layer, size=layer.size * factor) for layer in shape.over)
        return shape.with_changes(
            positions=larger(shape.positions), mesh=mesh, parts=parts, over=over, ends=ends, joints=joints
        )

    def mirror(self, project: Project, shape: GraphCharacter, axes: Axes) -> GraphCharacter:
        """Mirrors the rest pose and the motion. Left and right ends are swapped."""
        centre, flip = self.centre(shape), Axes(IDENTITY, True)
        parts = []
        for part in shape.parts:
            # A point x of a part is at turn S^k x + place. S is the reflection in the plane x = 0, and k is 1
            # for a mirrored part, else 0. Let M be the map of ``axes``, a reflection. Then M (turn S^k x +
            # place) = (M turn S) S^(k+1) x + M place, and M turn S is a rotation again. So only the part's
            # ``mirror`` changes.
            turn = normalized(multiply(axes.turn, flip.rotations(part.turn)))
            rest = normalized(multiply(axes.turn, flip.rotations(part.axes)))
            place, ride = centre + axes.vectors(part.place - centre), part.ride
            if ride is not None:
                ride_place = centre + axes.vectors(ride.place - centre)
                ride = Ride(ride.node, normalized(axes.rotations(ride.turn)), ride_place)
            flipped = not part.mirrored
            parts.append(replace(part, turn=turn, axes=rest, place=place, mirrored=flipped, ride=ride))
        mesh = convert_mesh_axes(shape.mesh, centre, axes, centre)
        positions = centre + axes.vectors(shape.positions - centre)
        ends = centre + axes.vectors(shape.ends - centre)
        ends = ends[_MIRRORED_ENDS] if len(ends) else ends
        joints = centre + axes.vectors(shape.joints - centre)
        joints = joints[list(MIRROR)] if len(joints) else joints
        over = tuple(
            replace(
                layer,
                axes=normalized(multiply(axes.turn, flip.rotations(layer.axes))),
                mirrored=not layer.mirrored,
            )
            for layer in shape.over
        )
        return shape.with_changes(
            positions=positions, mesh=mesh, parts=tuple(parts), over=over, ends=ends, joints=joints
        )

    def convert_to_graph_shape(
        self, project: Project, shape: GraphCharacter, times: Float, stream_id: str
    ) -> tuple[GraphCharacter, PoseStream, str]:
        """Combines the motion of all parts in one stream, sampled at ``times`` (T,)."""
        poses = [graph_pose(project, shape, float(time)) for time in times]
        linear, positions = (np.stack(each) for each in zip(*poses, strict=True))
        stream = PoseStream(stream_id, linear, positions, float(times[1] - times[0]))
        part = GraphPart(stream_id, np.arange(len(shape.positions)), offset=float(times[0]))
        return shape.with_changes(parts=(part,), over=()), stream, ""
