"""Implements the edits of whole characters for puppets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import (
    ExampleCharacter,
    GraphCharacter,
    Plane,
    PoseStream,
    Project,
    PuppetLayer,
    character_from_puppet,
)
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import convert_to_world_frame, pose_of_state
from enliven.modeling.puppet.baking import bake_motion
from enliven.modeling.puppet.dragging import drag_point
from enliven.modeling.puppet.edits import check_layer_number
from enliven.modeling.puppet.merge import merge_puppets
from enliven.modeling.puppet.parts import evaluate_puppet_state, surface_of_puppet
from enliven.modeling.puppet.surgery import cut_puppet
from enliven.modeling.rig import CharacterState, HandleMotion, Player, RigEdits
from enliven.modeling.rigged.axes import Axes, convert_mesh_axes
from enliven.rotation import IDENTITY, from_matrix, multiply, normalized, rotate


class PuppetRig(RigEdits):
    """Implements the edits of whole characters for puppets. Their control points are driven by example poses.
    Baking solves the surface for each frame."""

    frames = 30.0
    make_drawing = staticmethod(character_from_puppet)
    cut = staticmethod(cut_puppet)
    merge = staticmethod(merge_puppets)

    def centre(self, puppet: ExampleCharacter) -> Float:
        """Returns the point (3,) on the floor below the centre of the mesh at rest, in metres."""
        low, high = puppet.mesh.bounds
        middle = (low + high) / 2.0 * [1.0, 0.0, 1.0]
        return np.asarray(rotate(puppet.turn, middle) + puppet.place)

    def compute_vertices(self, project: Project, puppet: ExampleCharacter, time: float) -> Float:
        """Returns the vertices (V, 3) in metres at a time of the project."""
        return self.create_surface_player(project, puppet)(time)

    def create_player(self, project: Project, puppet: ExampleCharacter) -> Player:
        """Returns a function from a time to the puppet's frame and control points. The renderer solves the
        surface from these."""

        def at(time: float) -> CharacterState:
            state = evaluate_puppet_state(project, puppet, time)
            pose = pose_of_state(puppet, state, round(time * 1e9))
            return CharacterState(pose, convert_to_world_frame(puppet, state, state.places))

        return at

    def handle_motion(
        self, puppet: ExampleCharacter, player: Player, handle: int | None, layer: int | None
    ) -> HandleMotion | None:
        """Returns the motion of a control point in the frame of the mesh, like its key poses."""
        if handle is None or handle >= len(puppet.handles):
            return None

        def at(time: float) -> tuple[Float, Float]:
            pose, handles = player(time)
            frame = np.asarray(pose.linear[0], np.float64)
            return from_matrix(frame), frame.T @ (handles[handle] - pose.positions[0])

        return at

    def create_surface_player(self, project: Project, puppet: ExampleCharacter) -> Callable[[float], Float]:
        """Returns a function from a time to the surface (V, 3) in metres. The solver is prepared only
        once."""
        solver = surface_of_puppet(puppet)

        def at(time: float) -> Float:
            state = evaluate_puppet_state(project, puppet, time)
            return convert_to_world_frame(puppet, state, solver.solve_from_rest(state.places))

        return at

    def find_missing_data(self, project: Project, puppet: ExampleCharacter) -> tuple[str, ...]:
        """Returns sentences about missing control points, pairs, key poses and takes."""
        plays = any(not layer.muted for layer in puppet.layers)
        return (
            *find_missing_examples(project, puppet),
            *([] if plays else [f"Choose a take for {puppet.id}."]),
        )

    def check_layers(self, project: Project, puppet: ExampleCharacter, numbers: set[int]) -> None:
        """Raises an error if constraints of the layers ``numbers`` contradict each other."""
        for number in numbers:
            check_layer_number(project, puppet, puppet.layers[number])

    def drag_handle(
        self, project: Project, puppet: ExampleCharacter, handle: int, place: Float, time: float
    ) -> Project:
        """Adds the pose at ``time`` as a key pose, with the control point ``handle`` moved to ``place``."""
        return drag_point(project, puppet.id, handle, place, time)

    def move(self, puppet: ExampleCharacter, offset: Float, turn: Float, about: Float) -> ExampleCharacter:
        """Moves the puppet. Data in its own frame does not change."""
        place = rotate(turn, puppet.place - about) + about + offset
        return puppet.with_changes(turn=normalized(multiply(turn, puppet.turn)), place=place)

    def scale(self, puppet: ExampleCharacter, factor: float) -> ExampleCharacter:
        """Scales the mesh, its examples and strides. Flight still follows gravity, independent of size."""

        def scaled(vectors: AnyArray) -> Float:
            return np.asarray(vectors, np.float64) * factor

        mesh = replace(puppet.mesh, vertices=scaled(puppet.mesh.vertices))
        grown = _with_mapped_axes(puppet, scaled, lambda normal: normal).with_changes(mesh=mesh)
        return grown.with_changes(place=puppet.place + self.centre(puppet) - self.centre(grown))

    def mirror(self, project: Project, puppet: ExampleCharacter, axes: Axes) -> ExampleCharacter:
        """Mirrors the puppet's own frame left to right, then rotates it into the mirrored position."""
        flip = Axes(IDENTITY, True)
        # A point x of the mesh is at T (Ry(yaw) x + root) in the world, up to the puppet's translation. T is
        # the puppet's rotation. Let M be the map of ``axes``, and S the reflection in the plane x = 0. Then M
        # T (Ry(yaw) x + root) = (M T S) (Ry(-yaw) S x + S root). So the mirrored puppet has the rotation M T
        # S, the angle -yaw, and the mirrored mesh S x.
        turn, stood = normalized(multiply(axes.turn, flip.rotations(puppet.turn))), self.centre(puppet)
        flipped = _with_mapped_axes(puppet, flip.vectors, flip.vectors)
        return flipped.with_changes(
            mesh=convert_mesh_axes(puppet.mesh, np.zeros(3), flip, np.zeros(3)),
            layers=tuple(replace(layer, mirrored=not layer.mirrored) for layer in flipped.layers),
            turn=turn,
            place=stood + axes.vectors(puppet.place - stood),
        )

    def convert_to_graph_shape(
        self, project: Project, puppet: ExampleCharacter, times: Float, stream_id: str
    ) -> tuple[GraphCharacter, PoseStream, str]:
        """Bakes the puppet to nodes that follow the solved surface."""
        rate, ids = 1.0 / float(times[1] - times[0]), (puppet.id, stream_id)
        graph, stream, error = bake_motion(project, puppet, float(times[0]), float(times[-1]), rate, ids)
        return graph, stream, f", {error}"


def _with_mapped_axes(
    puppet: ExampleCharacter, vectors: Callable[[AnyArray], Float], normals: Callable[[AnyArray], AnyArray]
) -> ExampleCharacter:
    """Returns the puppet with its examples, constraints and symmetry plane in other axes or sizes."""
    plane = puppet.symmetry
    if plane is not None:
        plane = Plane(
            _float_triple(vectors(np.array(plane.point))), _float_triple(normals(np.array(plane.normal)))
        )
    return puppet.with_changes(
        poses=tuple(replace(pose, places=vectors(pose.places)) for pose in puppet.poses),
        layers=tuple(_map_layer(layer, vectors) for layer in puppet.layers),
        symmetry=plane,
    )


def _map_layer(layer: PuppetLayer, map_of: Callable[[AnyArray], Float]) -> PuppetLayer:
    """Returns a layer with its constraints in other axes or sizes. ``map_of`` maps the vector of each
    constraint."""
    return replace(
        layer,
        positions=tuple(
            replace(constraint, place=_float_triple(map_of(np.array(constraint.place))))
            for constraint in layer.positions
        ),
        velocities=tuple(
            replace(constraint, velocity=_float_triple(map_of(np.array(constraint.velocity))))
            for constraint in layer.velocities
        ),
        couplings=tuple(
            replace(constraint, apart=_float_triple(map_of(np.array(constraint.apart))))
            for constraint in layer.couplings
        ),
    )


def _float_triple(vector: AnyArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
