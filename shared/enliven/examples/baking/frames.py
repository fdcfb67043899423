"""A puppet's surface over time, frame by frame, and the pose of its coordinate frame in the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.arap import PuppetSurface
from enliven.document import Project, Puppet
from enliven.examples.puppet_motion import State, state_of
from enliven.rotation import from_rotation_vector, multiply, rotate


@dataclass(eq=False)
class SurfaceFrames:
    """The frames of a surface driven by control points. Each call iterates over all of them.

    Attributes:
        puppet: the puppet with the surface.
        places: (F, P, 3) metres in the mesh's frame, the control points.
        kept: memory in MB. If all frames fit into it, they are solved once. Otherwise they are solved at each
            call.
    """

    puppet: Puppet
    places: Float
    kept: float = 0.0
    _known: list[Float32] = field(default_factory=list, init=False)

    def __call__(self) -> Iterator[Float]:
        """Yields (V, 3) metres in the mesh's frame. The first frame is solved from rest, and each other one
        from the previous frame."""
        if len(self._known) == len(self.places):
            for frame in self._known:
                yield frame.astype(np.float64)
            return
        puppet, solved = self.puppet, []
        handles, weights = [p.vertex for p in puppet.points], [p.weight for p in puppet.points]
        surface = PuppetSurface(puppet.mesh, handles, weights, puppet.surface)
        keep = puppet.mesh.vertices.size * 4e-6 * len(self.places) <= self.kept
        for number, places in enumerate(self.places):
            vertices = surface.solve(places) if number else surface.settle(places)
            if keep:
                solved.append(vertices.astype(np.float32))
                vertices = solved[-1].astype(np.float64)
            yield vertices
        self._known = solved


def evaluate_states(project: Project, puppet: Puppet, times: Float) -> tuple[Float, Float, Float]:
    """Evaluates a puppet at ``times`` (F,).

    Returns:
        (F, P, 3) metres, its control points in the mesh's frame. (F, 4) rotations and (F, 3) metres, the pose
        of the mesh's frame in the world.
    """
    states = [state_of(project, puppet, float(time)) for time in times]
    turn, place = frame_poses(puppet, states)
    return np.array([state.places for state in states]).reshape(len(times), -1, 3), turn, place


def frame_poses(puppet: Puppet, states: list[State]) -> tuple[Float, Float]:
    """Returns rotations (F, 4) and positions (F, 3) of the puppet's frame. A point x of it is at turn x +
    place in the world."""
    yaws = np.array([state.yaw for state in states])
    about_y = from_rotation_vector(np.stack([0.0 * yaws, yaws, 0.0 * yaws], 1))
    roots = np.array([state.root for state in states])
    return multiply(puppet.turn, about_y), rotate(puppet.turn, roots) + puppet.place
