"""The part of the edits of whole characters that puppets do their own way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import (
    GraphShape,
    Plane,
    PoseStream,
    Project,
    Puppet,
    PuppetLayer,
    character_of_puppet,
)
from enliven.examples import in_world, missing, pose_of_state
from enliven.modeling.puppet.baking import baked
from enliven.modeling.puppet.dragging import drag_point
from enliven.modeling.puppet.edits import checked_layer
from enliven.modeling.puppet.merge import merge_puppets
from enliven.modeling.puppet.parts import state_at, surface_of_puppet
from enliven.modeling.puppet.surgery import cut_puppet
from enliven.modeling.rig import Player, Posed, RigEdits
from enliven.modeling.rigged import Axes, moved_mesh
from enliven.rotation import IDENTITY, multiply, normalized, rotate


class PuppetRig(RigEdits):
    """Control points that example poses move; each frame of a bake solves its surface."""

    frames = 30.0
    drawn = staticmethod(character_of_puppet)
    cut = staticmethod(cut_puppet)
    merged = staticmethod(merge_puppets)

    def centre(self, puppet: Puppet) -> Float:
        """On the floor under the middle of the mesh at rest."""
        low, high = puppet.mesh.bounds
        middle = (low + high) / 2.0 * [1.0, 0.0, 1.0]
        return np.asarray(rotate(puppet.turn, middle) + puppet.place)

    def seen(self, project: Project, puppet: Puppet, time: float) -> Float:
        """The vertices at a time."""
        return self.surface(project, puppet)(time)

    def player(self, project: Project, puppet: Puppet) -> Player:
        """Its frame and its control points; the surface between them is solved by what draws it."""

        def at(time: float) -> Posed:
            state = state_at(project, puppet, time)
            pose = pose_of_state(puppet, state, round(time * 1e9))
            return Posed(pose, in_world(puppet, state, state.places))

        return at

    def surface(self, project: Project, puppet: Puppet) -> Callable[[float], Float]:
        """Its surface, prepared once and settled at each time."""
        solver = surface_of_puppet(puppet)

        def at(time: float) -> Float:
            state = state_at(project, puppet, time)
            return in_world(puppet, state, solver.settle(state.places))

        return at

    def lacking(self, project: Project, puppet: Puppet) -> tuple[str, ...]:
        """Points, pairs and key poses that are missing, and a take."""
        plays = any(not layer.muted for layer in puppet.layers)
        return (*missing(project, puppet), *([] if plays else [f"Choose a take for {puppet.id}."]))

    def check_layers(self, project: Project, puppet: Puppet, numbers: set[int]) -> None:
        """Constraints must not contradict one another."""
        for number in numbers:
            checked_layer(project, puppet, puppet.layers[number])

    def dragged(self, project: Project, puppet: Puppet, handle: int, place: Float, time: float) -> Project:
        """The pose of that moment becomes a key pose in which the control point is there."""
        return drag_point(project, puppet.id, handle, place, time)

    def moved(self, puppet: Puppet, offset: Float, turn: Float, about: Float) -> Puppet:
        """Its own frame stays."""
        place = rotate(turn, puppet.place - about) + about + offset
        return puppet.with_changes(turn=normalized(multiply(turn, puppet.turn)), place=place)

    def scaled(self, puppet: Puppet, factor: float) -> Puppet:
        """Examples and strides grow along; what flies falls as gravity has it, whatever its size."""

        def scaled(vectors: AnyArray) -> Float:
            return np.asarray(vectors, np.float64) * factor

        mesh = replace(puppet.mesh, vertices=scaled(puppet.mesh.vertices))
        made = _mapped(puppet, scaled, lambda normal: normal).with_changes(mesh=mesh)
        return made.with_changes(place=puppet.place + self.centre(puppet) - self.centre(made))

    def mirrored(self, project: Project, puppet: Puppet, axes: Axes) -> Puppet:
        """Its own frame is mirrored left to right, and then turned to where the mirror shows it."""
        flip = Axes(IDENTITY, True)
        # M T (Ry(yaw) x + root) = (M T S) (Ry(-yaw) S x + S root), S the reflection in the plane x = 0.
        turn, stood = normalized(multiply(axes.turn, flip.rotations(puppet.turn))), self.centre(puppet)
        made = _mapped(puppet, flip.vectors, flip.vectors)
        return made.with_changes(
            mesh=moved_mesh(puppet.mesh, np.zeros(3), flip, np.zeros(3)),
            layers=tuple(replace(layer, mirrored=not layer.mirrored) for layer in made.layers),
            turn=turn,
            place=stood + axes.vectors(puppet.place - stood),
        )

    def as_graph(
        self, project: Project, puppet: Puppet, times: Float, stream_id: str
    ) -> tuple[GraphShape, PoseStream, str]:
        """Baked: nodes that follow the solved surface."""
        rate, ids = 1.0 / float(times[1] - times[0]), (puppet.id, stream_id)
        graph, stream, error = baked(project, puppet, float(times[0]), float(times[-1]), rate, ids)
        return graph, stream, f", {error}"


def _mapped(
    puppet: Puppet, vectors: Callable[[AnyArray], Float], normals: Callable[[AnyArray], AnyArray]
) -> Puppet:
    """The puppet with examples, constraints and plane of symmetry in other axes or sizes."""
    plane = puppet.symmetry
    if plane is not None:
        plane = Plane(_three(vectors(np.array(plane.point))), _three(normals(np.array(plane.normal))))
    return puppet.with_changes(
        poses=tuple(replace(pose, places=vectors(pose.places)) for pose in puppet.poses),
        layers=tuple(_mapped_layer(layer, vectors) for layer in puppet.layers),
        symmetry=plane,
    )


def _mapped_layer(layer: PuppetLayer, map_of: Callable[[AnyArray], Float]) -> PuppetLayer:
    """A layer with its constraints in other axes or sizes; these keep each axis by itself."""
    return replace(
        layer,
        positions=tuple(replace(one, place=_three(map_of(np.array(one.place)))) for one in layer.positions),
        velocities=tuple(
            replace(one, velocity=_three(map_of(np.array(one.velocity)))) for one in layer.velocities
        ),
        couplings=tuple(replace(one, apart=_three(map_of(np.array(one.apart)))) for one in layer.couplings),
    )


def _three(vector: AnyArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
