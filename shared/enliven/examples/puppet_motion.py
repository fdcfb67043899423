"""The motion of a puppet in the world. Its key poses retarget the takes of its layers to its control points.

    missing(project, puppet)                  # sentences about missing data; empty if it can move
    evaluate_state(project, puppet, seconds)    # its control points and its position
    solve_layer_motion(project, puppet, layer)  # a whole take, solved once (section 5)

The puppet's frame is the mesh's frame. The motion starts at the modeled position and facing direction of the
mesh, independent of those of the performer. A layer that travels adds a yaw and a root position to this start
(:mod:`enliven.examples.spacetime.locomotion`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import ExampleCharacter, Pose, Project, PuppetLayer
from enliven.errors import InputError
from enliven.examples.puppet_examples import MotionInputs, collect_motion_inputs
from enliven.examples.puppet_solve import solve_motion
from enliven.examples.puppet_trajectory import PuppetMotion
from enliven.rotation import from_rotation_vector, multiply, rotate, to_matrix
from enliven.skeletons.facing import rotate_about_y

_CACHED_MOTIONS = 64
"""Number of solved motions in the least-recently-used cache. All puppets, layers and edits share it."""


@dataclass(frozen=True, eq=False)
class PuppetState:
    """The state of a puppet at one time.

    Attributes:
        places: (P, 3) positions of the control points in the mesh's own frame, metres.
        yaw: radians about +Y.
        root: (3,) metres. A point x in the mesh's frame maps to yaw(x) + root. The puppet's own rotation and
            position are applied afterwards.
    """

    places: Float
    yaw: float
    root: Float


def solve_layer_motion(project: Project, puppet: ExampleCharacter, layer: int) -> PuppetMotion:
    """Returns the solved motion of a layer's whole take, from a cache if possible.

    Equal inputs return the same object. Offset, speed, loop and muting of the layer do not affect the result.

    Raises:
        InputError: if the puppet or the layer lacks data, or constraints contradict one another.
    """
    return _get_cached_motion(collect_motion_inputs(project, puppet, _find_layer(puppet, layer)))


def evaluate_state(project: Project, puppet: ExampleCharacter, time: float) -> PuppetState:
    """Returns the state of a puppet at a time of the project in seconds, with all layers mixed. Without
    layers, the puppet is at rest.

    Raises:
        InputError: in the same cases as :func:`solve_layer_motion`.
    """
    places, yaw, root, remaining_weight = puppet.rest.copy(), 0.0, np.zeros(3), 1.0
    for number, layer in enumerate(puppet.layers):
        if layer.muted or layer.weight == 0.0:
            continue
        motion = solve_layer_motion(project, puppet, number)
        length = (motion.frames - 1) * motion.step
        loop_moment, ends = layer.moment(time, length), layer.compute_ends(length)
        moved_points, frames = list(motion.points), [motion.frame_of(loop_moment.second)]
        weights = [1.0]
        if loop_moment.share > 0.0:
            frames, weights = (
                [*frames, motion.frame_of(loop_moment.other)],
                [1.0 - loop_moment.share, loop_moment.share],
            )
        mean_places = sum(
            weight * motion.places_at(frame) for weight, frame in zip(weights, frames, strict=True)
        )
        places[moved_points] += (
            layer.weight * loop_moment.weight * (np.asarray(mean_places)[moved_points] - places[moved_points])
        )
        if motion.travels:
            # The layers that travel determine the path. The first of them dominates, in proportion to its
            # weight.
            for weight, frame in zip(weights, frames, strict=True):
                layer_yaw, layer_root = motion.root_at(frame, loop_moment.rounds, ends)
                yaw, root = (
                    yaw + remaining_weight * loop_moment.weight * weight * layer_yaw,
                    root + remaining_weight * loop_moment.weight * weight * layer_root,
                )
            remaining_weight *= 1.0 - loop_moment.weight
    return PuppetState(places, yaw, root)


def loop_position(layer: PuppetLayer, motion: PuppetMotion, time: float) -> tuple[float, int]:
    """Returns the fractional frame of the take that a layer plays at ``time`` (seconds), and the number of
    completed loops."""
    second, rounds = layer.find_played_time(time, (motion.frames - 1) * motion.step)
    return motion.frame_of(second), rounds


def convert_to_world_frame(puppet: ExampleCharacter, state: PuppetState, points: AnyArray) -> Float:
    """Converts points (..., 3) in the mesh's frame to (..., 3) metres in the world."""
    local = rotate_about_y(np.asarray(points, np.float64), np.asarray(state.yaw)) + state.root
    return np.asarray(rotate(puppet.turn, local) + puppet.place)


def pose_of_state(puppet: ExampleCharacter, state: PuppetState, time_ns: int = 0) -> Pose:
    """Returns the pose of ``character_from_puppet``: transform 0 is the puppet's frame in the world.

    Transform k is control point k - 1, with the rotation of the frame and its position in the world.
    """
    turn = multiply(puppet.turn, from_rotation_vector(np.array([0.0, state.yaw, 0.0])))
    linear = np.tile(to_matrix(turn).astype(np.float32), (len(puppet.points) + 1, 1, 1))
    places = np.concatenate([np.zeros((1, 3)), state.places])
    return Pose(puppet.id, time_ns, linear, convert_to_world_frame(puppet, state, places).astype(np.float32))


def _find_layer(puppet: ExampleCharacter, number: int) -> PuppetLayer:
    if not 0 <= number < len(puppet.layers):
        problem = f"layer {number} does not exist"
        advice = f"The puppet has {len(puppet.layers)} layers, counted from 0."
        raise InputError(problem, where=f"puppet {puppet.id!r}", remedy=advice)
    return puppet.layers[number]


@lru_cache(maxsize=_CACHED_MOTIONS)
def _get_cached_motion(material: MotionInputs) -> PuppetMotion:
    return solve_motion(material)
