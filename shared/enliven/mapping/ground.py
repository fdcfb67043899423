"""The floor under a retargeted shape. The shape stands on it whenever its performer stands on the floor.

stands_on_floor(shape)                        # True for legs, or a lowest point at y = 0
posed_surfaces(project, shape_id, times)   # yields the vertices at each time
keep_on_floor(project, shape_id, clip, duration)    # moves the root up and down with the lowest point
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Bool, Float
from enliven.deformation import skin_vertices
from enliven.document import Clip, Layer, Project, Shape, Skeleton, character_of, joint_places, unused
from enliven.mapping.anatomy import anatomy_of
from enliven.mapping.human_names import names_object
from enliven.mapping.resting import heading_of
from enliven.motion.layers import Player, pose_from, set_travel, travel_scale
from enliven.rotation import IDENTITY

_MAX_RATE_HZ = 60.0
"""Maximum number of moments a second at which the lowest point is searched: the rate of common displays."""
_MAX_FLOOR_DISTANCE = 0.02
"""A shape without legs stands on the floor if its lowest point is within this fraction of its height of
y = 0."""
_FOOT_ROLL_HEIGHT = 0.04
"""Rise of the lowest joint while a foot rolls from heel to toe, as a fraction of the performer's height."""
_FLOOR_PERCENTILE = 5.0
"""Percentile of the lowest joint's height over a take that is used as the height of the floor."""
_TOUCHING_HEIGHT = 0.01
"""Points within this fraction of the height above the lowest point count as standing, too."""
_MIN_STRIDE_FACTOR = 0.1
"""Smallest factor for a stride, so that a shape with shuffling legs still moves forward."""
_MAX_STRIDE_FACTOR = 1.5
"""Largest factor for a stride. Feet that slide ahead would give a larger one."""
_MAX_HAND_DISTANCE = 1.5
"""Largest distance of a hand's points from its wrist, in forearm lengths. People have 0.75, toons 1.2."""
_MIN_TWIST_NORM = 0.2
"""Minimum norm of the twist about the vertical for a rotation to have a heading. It is smaller if the body is
upside down."""


def body_points(shape: Shape) -> Bool:
    """Returns (V,) True for the points of a shape's surface that belong to its body.

    All other points belong to an object in a hand: the joint's name contains a word for an object, or the
    point is too far from the wrist. An object such as a weapon may touch the floor, but the shape does not
    stand on it. If the shape has no mesh, the points are its joints.
    """
    skeleton, arms = shape.skeleton, [arm for pair in anatomy_of(shape.skeleton).arms for arm in pair]
    named = np.array([bool(arms) and names_object(name) for name in skeleton.names])
    # A bone is named after the joint at its end. All bones below a weapon's joint belong to the weapon.
    objects = np.array([any(named[j] for j in skeleton.path(0, bone)) for bone in range(len(skeleton))])
    at, leader = skeleton.positions, np.arange(len(skeleton))
    if shape.mesh is not None:
        if shape.skin is None:
            return np.ones(len(shape.mesh.vertices), np.bool_)
        strongest = shape.skin.weights.argmax(1)[:, None]
        at, leader = shape.mesh.vertices, np.take_along_axis(shape.skin.indices, strongest, axis=1)[:, 0]
    carried = objects[leader]
    for arm in (arm for arm in arms if arm.knots):
        elbow, wrist = (skeleton.positions[arm.chain[k]] for k in arm.knots[1:3])
        hand = np.isin(leader, skeleton.below(arm.chain[arm.knots[2]])[1:])
        carried |= hand & (
            np.linalg.norm(at - wrist, axis=1) > _MAX_HAND_DISTANCE * np.linalg.norm(wrist - elbow)
        )
    return np.asarray(~carried if not carried.all() else np.ones_like(carried))


def stands_on_floor(shape: Shape) -> bool:
    """Returns True if a shape at rest stands, or lies, on the floor."""
    rest = _body_at_rest(shape)
    low, tall = float(rest[:, 1].min()), float(np.ptp(rest[:, 1]))
    return abs(low) < _MAX_FLOOR_DISTANCE * tall or bool(anatomy_of(shape.skeleton).legs)


def floor_of(shape: Shape) -> float:
    """Returns the height in metres of the floor under a shape that stands in its rest pose."""
    return float(_body_at_rest(shape)[:, 1].min() + shape.place[1])


def _body_at_rest(shape: Shape) -> Float:
    """Returns the points (V, 3) in metres of a shape's body at rest."""
    rest = shape.skeleton.positions if shape.mesh is None else shape.mesh.vertices
    return np.asarray(rest[body_points(shape)])


def posed_surfaces(project: Project, shape_id: str, times: AnyArray) -> Iterator[Float]:
    """Yields the vertices (V, 3) of a shape in metres at times (T,), or its joints if it has no mesh."""
    player, shape = Player(project, shape_id), project.shape(shape_id)
    character = None if shape.mesh is None else character_of(shape)
    for seconds in times:
        at = player.at(float(seconds))
        if character is None:
            yield at.joints
        else:
            yield skin_vertices(character, pose_from(shape, at, seconds)).astype(np.float64)


def clearance(clip: Clip) -> Float:
    """Returns the height (F,) in metres of a performer above the floor, 0 while any part touches it."""
    height = joint_places(clip)[..., 1]
    low = height.min(1)
    roll = _FOOT_ROLL_HEIGHT * float(np.ptp(height, axis=1).max())
    return np.asarray(np.maximum(low - np.percentile(low, _FLOOR_PERCENTILE) - roll, 0.0))


def keep_on_floor(
    project: Project,
    shape_id: str,
    clip: Clip,
    duration: float,
    own_stride: bool = True,
    on_feet: Float | None = None,
) -> Project:
    """Returns a project in which the lowest point of a shape is on the floor, or above it in a leap.

    The root's motion becomes a take of its own, of one joint, which the shape's travel plays.

    Args:
        clip: the performer's.
        duration: seconds of the project that are used.
        own_stride: True to scale the path to the strides of the shape's legs. Otherwise the path is the
            performer's, scaled to the shape's size.
        on_feet: (F,) 0 to 1 for each frame of the take: 1 while the performer is on their feet, if the feet
            were planted already. None if they were not.
    """
    shape = project.shape(shape_id)
    watched = moments_of(duration, min(_MAX_RATE_HZ, 1.0 / clip.step))
    body = body_points(shape)
    low, steps = _lowest_point_path(
        (at[body] for at in posed_surfaces(project, shape_id, watched)), len(watched)
    )
    # The path has the take's frame rate. With a coarser path standing feet would tremble.
    times = moments_of(duration, max(_MAX_RATE_HZ, 1.0 / clip.step))
    root = Player(project, shape_id).root(times)
    up = np.interp(times, watched, floor_of(shape) - low)
    frames = np.arange(len(clip.turns)) * clip.step
    if shape.travel is not None:
        leapt = clearance(clip)
        up += travel_scale(shape, clip) * np.interp(times, frames, leapt) if on_feet is None else 0.0
        level = root[:, [0, 2]]
        coarse = np.stack([np.interp(watched, times, level[:, k]) for k in range(2)], axis=1)
        leaping = np.interp(watched, frames, leapt) > 0.0
        stride = _stride_factor(np.diff(coarse, axis=0), steps, leaping) if own_stride else 1.0
        root[:, [0, 2]] = level[0] + stride * (level - level[0])
    if on_feet is not None:
        # Planted feet are on the floor already, or above it in a leap.
        up = np.maximum(up, 0.0) + np.minimum(up, 0.0) * (1.0 - np.interp(times, frames, on_feet))
    root[:, 1] += up
    count = len(times)
    return follow_path(project, shape_id, clip.id, root, duration / (count - 1) if count > 1 else clip.step)


def follow_path(project: Project, shape_id: str, name: str, root: Float, step: float) -> Project:
    """Returns a project in which the root of a shape follows ``root`` (F, 3), ``step`` seconds apart.

    The path becomes a take of its own, of one joint, named after the take ``name``.
    """
    shape, count = project.shape(shape_id), len(root)
    still = Skeleton(("root",), np.array([-1], np.int32), shape.skeleton.positions[:1] + shape.place)
    way = Clip(unused(f"{name}: way", project.takes), still, np.tile(IDENTITY, (count, 1, 1)), root, step)
    layer = Layer(unused(way.id, project.layer_names), way.id, (0,))
    moved = shape.with_changes(layers=(*shape.layers, layer), travel=layer.id)
    return set_travel(project.with_takes(way).with_characters(moved), shape_id, layer.id, 1.0)


def foot_contact_weights(clip: Clip, feet: Collection[int]) -> Float:
    """Returns (F,) 1 while the lowest joint is a foot, 0 while it is another, with smooth transitions."""
    height = joint_places(clip)[..., 1]
    others = [j for j in range(height.shape[1]) if j not in feet]
    lead = height[:, others].min(1) - height[:, list(feet)].min(1)
    return np.asarray(
        np.clip(0.5 + lead / (_FOOT_ROLL_HEIGHT * float(np.ptp(height, axis=1).max())), 0.0, 1.0)
    )


def moments_of(duration: float, rate: float) -> Float:
    """Returns times (T,) in seconds from 0 to ``duration``, at ``rate`` Hz or slightly more."""
    return np.linspace(0.0, duration, int(np.ceil(duration * rate)) + 1)


def _lowest_point_path(moments: Iterator[Float], count: int) -> tuple[Float, Float]:
    """Returns the height (F,) of the lowest point, and the steps (F - 1, 2) of the lowest part, in metres."""
    low, steps = np.empty(count), np.zeros((max(count - 1, 0), 2))
    before = np.empty((0, 3))
    for f, at in enumerate(moments):
        if f:
            touching = before[:, 1] < low[f - 1] + _TOUCHING_HEIGHT * np.ptp(before[:, 1])
            steps[f - 1] = np.median((at - before)[touching][:, [0, 2]], axis=0)
        low[f], before = at[:, 1].min(), at.copy()
    return low, steps


def _stride_factor(ways: Float, steps: Float, leaping: Bool) -> float:
    """Returns the factor for a root's path (F - 1, 2) with which the standing part does not slide.

    A model's legs swing less far than the performer's, or have another build, so its stride differs. The
    factor is the median over the path. Moments at which the lowest part moves ahead of the root are ignored:
    a swinging foot touches the floor.
    """
    root_distance = np.linalg.norm(ways, axis=1)
    root_distance[leaping[:-1]] = 0.0
    if root_distance.sum() < 1e-9:
        return 1.0
    wanted = 1.0 - np.einsum("fc,fc->f", steps, ways) / np.maximum(root_distance, 1e-12) ** 2
    used = (root_distance > 1e-3 * root_distance.max()) & (wanted > 0.0)
    if not used.any():
        return 1.0
    wanted = wanted[used]
    order = np.argsort(wanted)
    middle = np.searchsorted(np.cumsum(root_distance[used][order]), root_distance[used].sum() / 2.0)
    return float(np.clip(wanted[order][middle], _MIN_STRIDE_FACTOR, _MAX_STRIDE_FACTOR))


def level_root(clip: Clip, chest: int) -> Clip:
    """Returns the take with a level root: it rotates about the vertical only, midway from hips to chest.

    Bodies on four legs move like that. The limbs and the spine keep their world rotations.
    """
    towards = clip.turns[:, chest] * np.sign(np.sum(clip.turns[:, chest] * clip.turns[:, 0], 1))[:, None]
    turns = clip.turns[:, 0] + towards
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    sure = np.hypot(turns[:, 0], turns[:, 2]) > _MIN_TWIST_NORM
    last = np.maximum.accumulate(np.where(sure, np.arange(len(turns)), 0))
    level_turns = clip.turns.copy()
    level_turns[:, 0] = heading_of(turns[last])
    return replace(clip, turns=level_turns, fine=None)
