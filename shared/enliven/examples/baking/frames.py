"""Computes a puppet's surface frame by frame, and the pose of its coordinate frame in the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document import ExampleCharacter, Project
from enliven.examples.puppet_motion import PuppetState, evaluate_state
from enliven.rotation import from_rotation_vector, multiply, rotate


@dataclass(eq=False)
class SurfaceFrames:
    """The vertices of a surface over time, solved from its control points. Each call returns a new iterator
    over all frames.

    Attributes:
        puppet: the puppet with the surface.
        places: (F, P, 3) positions of the control points in the mesh's frame, metres.
        kept: size of the cache in MB. If the cache can store all frames, they are solved only once. Otherwise
            they are solved again at each call.
    """

    puppet: ExampleCharacter
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
        fits_cache = puppet.mesh.vertices.size * 4e-6 * len(self.places) <= self.kept
        for number, places in enumerate(self.places):
            vertices = surface.solve(places) if number else surface.solve_from_rest(places)
            if fits_cache:
                solved.append(vertices.astype(np.float32))
                vertices = solved[-1].astype(np.float64)
            yield vertices
        self._known = solved


def evaluate_states(project: Project, puppet: ExampleCharacter, times: Float) -> tuple[Float, Float, Float]:
    """Evaluates a puppet at ``times`` (F,).

    Returns:
        (F, P, 3) control points in the mesh's frame, metres, and the pose of the mesh's frame in the world:
        (F, 4) rotations and (F, 3) positions, metres.
    """
    states = [evaluate_state(project, puppet, float(time)) for time in times]
    rotations, positions = frame_poses(puppet, states)
    return np.array([state.places for state in states]).reshape(len(times), -1, 3), rotations, positions


def frame_poses(puppet: ExampleCharacter, states: list[PuppetState]) -> tuple[Float, Float]:
    """Returns rotations (F, 4) and positions (F, 3) of the puppet's frame. A point x in this frame is at
    rotation x + position in the world.
    """
    yaws = np.array([state.yaw for state in states])
    about_y = from_rotation_vector(np.stack([0.0 * yaws, yaws, 0.0 * yaws], 1))
    roots = np.array([state.root for state in states])
    return multiply(puppet.turn, about_y), rotate(puppet.turn, roots) + puppet.place
