"""Keeps a retargeted shape on the floor while its performer is on the floor.

stands_on_floor(shape)                        # True for legs, or a lowest point at y = 0
compute_posed_surfaces(project, shape_id, times)   # yields the vertices at each time
keep_on_floor(project, shape_id, clip, duration)    # moves the root up and down with the lowest point
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Bool, Float
from enliven.deformation.skinning import skin_vertices
from enliven.document import (
    Clip,
    Layer,
    Project,
    RiggedCharacter,
    Skeleton,
    character_of,
    joint_places,
    unused,
)
from enliven.mapping.resting import heading_from_rotation
from enliven.motion.layers.evaluate import Player, pose_from
from enliven.motion.layers.retarget import set_travel
from enliven.motion.layers.travel import travel_scale
from enliven.rotation import IDENTITY
from enliven.skeletons.anatomy import find_anatomy
from enliven.skeletons.human_names import names_object

_MAX_RATE_HZ = 60.0
"""Maximum rate at which the lowest point of a shape is searched: the frame rate of common displays."""
_MAX_FLOOR_DISTANCE = 0.02
"""Maximum distance of the lowest point from y = 0 at which a shape without legs stands on the floor, as a
fraction of its height."""
_FOOT_ROLL_HEIGHT = 0.04
"""Rise of the lowest joint while a foot rolls from heel to toe, as a fraction of the performer's height."""
_FLOOR_PERCENTILE = 5.0
"""Percentile of the lowest joint's height over a take that is used as the height of the floor."""
_TOUCHING_HEIGHT = 0.01
"""Maximum height above the lowest point at which other points also touch the floor, as a fraction of the body
height."""
_MIN_STRIDE_FACTOR = 0.1
"""Smallest factor on the length of the performer's strides. With it, a shape with shuffling legs still moves
forward."""
_MAX_STRIDE_FACTOR = 1.5
"""Largest factor on the length of the performer's strides. Feet that slide forward would give a larger
factor."""
_MAX_HAND_DISTANCE = 1.5
"""Largest distance of a hand's points from its wrist, in forearm lengths. Human hands reach 0.75, cartoon
hands 1.2."""
_MAX_FRAME_ERROR = 1e-3
"""Largest difference of a number of frames from a whole number that is a rounding error."""
_MIN_TWIST_NORM = 0.2
"""Minimum norm of a rotation's twist about the vertical. With a smaller norm the body is nearly upside down,
and its heading is undefined."""


def body_points(shape: RiggedCharacter) -> Bool:
    """Returns (V,) True for the points of a shape's surface that belong to its body.

    All other points belong to an object in a hand: the joint that moves them has the name of an object, or
    the point is too far from the wrist. An object such as a weapon may touch the floor, but the shape does
    not stand on the object. If the shape has no mesh, the points are its joints.
    """
    skeleton, arms = shape.skeleton, [arm for pair in find_anatomy(shape.skeleton).arms for arm in pair]
    is_object_name = np.array([bool(arms) and names_object(name) for name in skeleton.names])
    # A bone is named after the joint at its end. All descendants of a weapon's joint belong to the weapon.
    is_object_bone = np.array(
        [any(is_object_name[j] for j in skeleton.path(0, bone)) for bone in range(len(skeleton))]
    )
    points, main_bone = skeleton.positions, np.arange(len(skeleton))
    if shape.mesh is not None:
        if shape.skin is None:
            return np.ones(len(shape.mesh.vertices), np.bool_)
        strongest = shape.skin.weights.argmax(1)[:, None]
        points, main_bone = (
            shape.mesh.vertices,
            np.take_along_axis(shape.skin.indices, strongest, axis=1)[:, 0],
        )
    is_object = is_object_bone[main_bone]
    for arm in (arm for arm in arms if arm.knots):
        elbow, wrist = (skeleton.positions[arm.chain[knot]] for knot in arm.knots[1:3])
        hand = np.isin(main_bone, skeleton.list_subtree(arm.chain[arm.knots[2]])[1:])
        is_object |= hand & (
            np.linalg.norm(points - wrist, axis=1) > _MAX_HAND_DISTANCE * np.linalg.norm(wrist - elbow)
        )
    return np.asarray(~is_object if not is_object.all() else np.ones_like(is_object))


def stands_on_floor(shape: RiggedCharacter) -> bool:
    """Returns True if a shape has legs, or if its lowest point at rest is on the floor."""
    rest = _body_at_rest(shape)
    lowest, height = float(rest[:, 1].min()), float(np.ptp(rest[:, 1]))
    return abs(lowest) < _MAX_FLOOR_DISTANCE * height or bool(find_anatomy(shape.skeleton).legs)


def floor_height_under(shape: RiggedCharacter) -> float:
    """Returns the height in metres of the floor under a shape that stands in its rest pose."""
    return float(_body_at_rest(shape)[:, 1].min() + shape.place[1])


def _body_at_rest(shape: RiggedCharacter) -> Float:
    """Returns the points (V, 3) in metres of a shape's body at rest."""
    rest = shape.skeleton.positions if shape.mesh is None else shape.mesh.vertices
    return np.asarray(rest[body_points(shape)])


def compute_posed_surfaces(project: Project, shape_id: str, times: AnyArray) -> Iterator[Float]:
    """Yields the vertices (V, 3) of a shape in metres at times (T,), or its joints if it has no mesh."""
    player, shape = Player(project, shape_id), project.shape(shape_id)
    character = None if shape.mesh is None else character_of(shape)
    for seconds in times:
        posed = player.compute_pose(float(seconds))
        if character is None:
            yield posed.joints
        else:
            yield skin_vertices(character, pose_from(shape, posed, seconds)).astype(np.float64)


def leap_heights(clip: Clip) -> Float:
    """Returns the height (F,) in metres of a leaping performer above the floor. It is 0 while any body part
    touches the floor."""
    return leap_heights_of_joints(joint_places(clip)[..., 1])


def leap_heights_of_joints(height: Float) -> Float:
    """Returns the leap height (F,) in metres of a performer, given the heights (F, N) of all joints in
    metres; see :func:`leap_heights`."""
    lowest = height.min(1)
    roll = _FOOT_ROLL_HEIGHT * float(np.ptp(height, axis=1).max())
    return np.asarray(np.maximum(lowest - np.percentile(lowest, _FLOOR_PERCENTILE) - roll, 0.0))


def keep_on_floor(
    project: Project,
    shape_id: str,
    clip: Clip,
    duration: float,
    own_stride: bool = True,
    on_feet: Float | None = None,
) -> Project:
    """Returns a project in which the lowest point of a shape is on the floor, or above it in a leap.

    The root's motion is stored as a new take with a single joint, which the shape's travel plays.

    Args:
        clip: the performer's take.
        duration: duration of the motion in seconds.
        own_stride: True to scale the path to the strides of the shape's legs. Otherwise the path is the
            performer's, scaled to the shape's size.
        on_feet: (F,) weight for each frame of the take: 1 while the performer stands on the feet. Required if
            the shape's feet were planted before, otherwise None.
    """
    shape = project.shape(shape_id)
    contact_times = sample_times(duration, min(_MAX_RATE_HZ, 1.0 / clip.step))
    body = body_points(shape)
    low, steps = _compute_lowest_point_path(
        (surface[body] for surface in compute_posed_surfaces(project, shape_id, contact_times)),
        len(contact_times),
    )
    # The sampling rate of the path is at least the take's frame rate. At a lower rate, standing feet would
    # tremble.
    times = sample_times(duration, max(_MAX_RATE_HZ, 1.0 / clip.step))
    root = Player(project, shape_id).compute_root(times)
    rise = np.interp(times, contact_times, floor_height_under(shape) - low)
    frames = np.arange(len(clip.turns)) * clip.step
    if shape.travel is not None:
        leap_height = leap_heights(clip)
        rise += travel_scale(shape, clip) * np.interp(times, frames, leap_height) if on_feet is None else 0.0
        ground_path = root[:, [0, 2]]
        coarse = np.stack(
            [np.interp(contact_times, times, ground_path[:, axis]) for axis in range(2)], axis=1
        )
        is_leaping = np.interp(contact_times, frames, leap_height) > 0.0
        stride = _stride_factor(np.diff(coarse, axis=0), steps, is_leaping) if own_stride else 1.0
        root[:, [0, 2]] = ground_path[0] + stride * (ground_path - ground_path[0])
    if on_feet is not None:
        # Planted feet are on the floor already, or above it in a leap.
        rise = np.maximum(rise, 0.0) + np.minimum(rise, 0.0) * (1.0 - np.interp(times, frames, on_feet))
    root[:, 1] += rise
    count = len(times)
    return follow_path(project, shape_id, clip.id, root, duration / (count - 1) if count > 1 else clip.step)


def follow_path(project: Project, shape_id: str, name: str, root: Float, step: float) -> Project:
    """Returns a project in which the root of a shape follows the path ``root`` (F, 3) in metres, with
    ``step`` seconds between frames.

    The path is stored as a new take with a single joint, named after the take ``name``.
    """
    shape, count = project.shape(shape_id), len(root)
    root_skeleton = Skeleton(("root",), np.array([-1], np.int32), shape.skeleton.positions[:1] + shape.place)
    path = Clip(
        unused(f"{name}: way", project.takes), root_skeleton, np.tile(IDENTITY, (count, 1, 1)), root, step
    )
    layer = Layer(unused(path.id, project.layer_names), path.id, (0,))
    moved_shape = shape.with_changes(layers=(*shape.layers, layer), travel=layer.id)
    return set_travel(project.with_takes(path).with_characters(moved_shape), shape_id, layer.id, 1.0)


def foot_contact_weights(clip: Clip, feet: Collection[int]) -> Float:
    """Returns weights (F,): 1 while the performer's lowest joint is one of ``feet``, otherwise 0, with smooth
    transitions."""
    height = joint_places(clip)[..., 1]
    others = [j for j in range(height.shape[1]) if j not in feet]
    height_difference = height[:, others].min(1) - height[:, list(feet)].min(1)
    return np.asarray(
        np.clip(0.5 + height_difference / (_FOOT_ROLL_HEIGHT * float(np.ptp(height, axis=1).max())), 0.0, 1.0)
    )


def sample_times(duration: float, rate: float) -> Float:
    """Returns times (T,) in seconds from 0 to ``duration``, at ``rate`` Hz or slightly more.

    A rounding error does not add a sample. With one sample more, the times would no longer be those of the
    take's frames.
    """
    return np.linspace(0.0, duration, int(np.ceil(duration * rate - _MAX_FRAME_ERROR)) + 1)


def _compute_lowest_point_path(moments: Iterator[Float], count: int) -> tuple[Float, Float]:
    """Returns the height (F,) of the lowest point of a shape, and the steps (F - 1, 2) of its lowest part, in
    metres.

    A step is the median motion (2,) along x and z, from one frame to the next, of the points that touch the
    floor.
    """
    low, steps = np.empty(count), np.zeros((max(count - 1, 0), 2))
    previous = np.empty((0, 3))
    for f, surface in enumerate(moments):
        if f:
            touching = previous[:, 1] < low[f - 1] + _TOUCHING_HEIGHT * np.ptp(previous[:, 1])
            steps[f - 1] = np.median((surface - previous)[touching][:, [0, 2]], axis=0)
        low[f], previous = surface[:, 1].min(), surface.copy()
    return low, steps


def _stride_factor(root_steps: Float, part_steps: Float, leaping: Bool) -> float:
    """Returns the factor on a root's path that prevents the standing part of the body from sliding.

    A model's legs swing less far than the performer's, or have other proportions, so its stride differs. The
    factor is the median over the path. Frames in which the lowest part moves forward faster than the root are
    ignored, because the lowest foot is swinging in these frames.

    Args:
        root_steps: (F - 1, 2) metres along x and z, the motion of the root from frame to frame.
        part_steps: (F - 1, 2) metres along x and z, the motion of the lowest part from frame to frame.
        leaping: (F,) True while the body is in the air.
    """
    root_distance = np.linalg.norm(root_steps, axis=1)
    root_distance[leaping[:-1]] = 0.0
    if root_distance.sum() < 1e-9:
        return 1.0
    factors = 1.0 - np.einsum("fc,fc->f", part_steps, root_steps) / np.maximum(root_distance, 1e-12) ** 2
    is_used = (root_distance > 1e-3 * root_distance.max()) & (factors > 0.0)
    if not is_used.any():
        return 1.0
    factors = factors[is_used]
    order = np.argsort(factors)
    middle = np.searchsorted(np.cumsum(root_distance[is_used][order]), root_distance[is_used].sum() / 2.0)
    return float(np.clip(factors[order][middle], _MIN_STRIDE_FACTOR, _MAX_STRIDE_FACTOR))


def level_root(clip: Clip, chest: int) -> Clip:
    """Returns the take with a root that rotates about the vertical only. Its heading is the mean of the
    headings of hips and chest.

    Bodies on four legs move with a level trunk. The limbs and the spine keep their world rotations.
    """
    chest_turns = clip.turns[:, chest] * np.sign(np.sum(clip.turns[:, chest] * clip.turns[:, 0], 1))[:, None]
    turns = clip.turns[:, 0] + chest_turns
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    has_heading = np.hypot(turns[:, 0], turns[:, 2]) > _MIN_TWIST_NORM
    last_frame = np.maximum.accumulate(np.where(has_heading, np.arange(len(turns)), 0))
    level_turns = clip.turns.copy()
    level_turns[:, 0] = heading_from_rotation(turns[last_frame])
    return replace(clip, turns=level_turns, fine=None)
