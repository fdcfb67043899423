"""Plays a puppet offline. Each frame contains the performer, the control points and the solved surface."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from example_cast import DATA, Act, Shown
from scipy.ndimage import gaussian_filter1d

from enliven.arrays import Float, Float32
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.character import Character, Pose
from enliven.document.project import Project
from enliven.document.puppet import ExampleCharacter, character_from_puppet
from enliven.examples.performer import yaw_from_rotation
from enliven.examples.puppet_motion import convert_to_world_frame, evaluate_state, pose_of_state
from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.capture_roles import find_roles
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.rotation import from_rotation_vector, multiply, rotate
from enliven_edge.importing.motion_capture import bodies_from_capture

_STEADY = 0.6
"""Time over which the camera path is smoothed, seconds."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One frame.

    Attributes:
        seconds: time in the take.
        local: (V, 3) metres, the surface in the mesh's frame.
        vertices: (V, 3) metres, in the world.
        pose: pose of the puppet's character.
        body: the performer.
        solve_ms: time for the surface, or in the first frame the time until it converged.
    """

    seconds: float
    local: Float
    vertices: Float32
    pose: Pose
    body: Body
    solve_ms: float


class Play:
    """A part of an act, played at a frame rate."""

    def __init__(self, act: Act, project: Project, shown: Shown, rate: float) -> None:
        self.act, self.project, self.shown = act, project, shown
        self.puppet: ExampleCharacter = next(iter(project.puppets.values()))
        take = project.takes[self.puppet.layers[0].take]
        self.times = np.arange(shown.first, min(shown.last, take.duration), shown.speed / rate)
        self._step = take.step

    @cached_property
    def character(self) -> Character:
        """Returns the character to draw. Only its control points are marked, in the colour of the act."""
        plain = character_from_puppet(self.puppet)
        colours = np.tile(np.array(self.act.colour, np.uint8), (len(plain.vertices), 1))
        return replace(plain, colours=colours, edges=np.zeros((0, 2), np.int32))

    @cached_property
    def bodies(self) -> tuple[Float, Float]:
        """Returns (F, 20, 3) metres and (F, 20, 4) rotations of the performer, which faces +Z at first, as
        puppets do."""
        path = DATA / self.act.take
        capture = read_expmap(path) if path.suffix == ".txt" else read_bvh(path)
        joints, turns = bodies_from_capture(capture, find_roles(capture))
        joints = joints - [0.0, np.percentile(joints[..., 1].min(1), 2), 0.0]
        begun = -yaw_from_rotation(self.project.takes[self.puppet.layers[0].take].turns[0, 0])
        whole = from_rotation_vector([0.0, float(begun), 0.0])
        return rotate(whole, joints), multiply(whole, turns)

    def surface(self) -> PuppetSurface:
        """Returns a new solver for the surface."""
        points = self.puppet.points
        held, weights = [point.vertex for point in points], [point.weight for point in points]
        return PuppetSurface(self.puppet.mesh, held, weights, self.puppet.surface)

    def shots(self) -> Iterator[Shot]:
        """Yields all frames in turn. Each surface starts from the previous one (warm start)."""
        surface = self.surface()
        for number, seconds in enumerate(self.times):
            state = evaluate_state(self.project, self.puppet, seconds)
            begun = time.perf_counter()
            local = surface.solve_from_rest(state.places) if number == 0 else surface.solve(state.places)
            took = 1000.0 * (time.perf_counter() - begun)
            vertices = convert_to_world_frame(self.puppet, state, local).astype(np.float32)
            yield Shot(
                float(seconds), local, vertices, pose_of_state(self.puppet, state), self.body(seconds), took
            )

    def body(self, seconds: float) -> Body:
        """Returns the performer at a time of the take."""
        joints, turns = self.bodies
        frame = min(round(seconds / self._step), len(joints) - 1)
        return Body(0, joints[frame], np.ones(J), turns[frame])

    @cached_property
    def ways(self) -> tuple[Float, Float]:
        """Returns two smooth paths on the floor, (N, 3) each, which the cameras of puppet and performer
        follow."""
        states = [evaluate_state(self.project, self.puppet, seconds) for seconds in self.times]
        puppet = np.array(
            [convert_to_world_frame(self.puppet, state, state.places).mean(0) for state in states]
        )
        joints = self.bodies[0]
        frames = np.minimum(np.round(self.times / self._step).astype(int), len(joints) - 1)
        return _smooth(puppet, self._sigma), _smooth(joints[frames].mean(1), self._sigma)

    @property
    def _sigma(self) -> float:
        step = self.times[1] - self.times[0]
        return float(_STEADY / step)


def _smooth(way: Float, sigma: float) -> Float:
    """Returns (N, 3) a path smoothed in time, with y set to 0."""
    return np.asarray(gaussian_filter1d(way, sigma, axis=0, mode="nearest") * [1.0, 0.0, 1.0])
