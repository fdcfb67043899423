"""Pose error: the angles between the limbs of a shape and the limbs of the performer.

    limb_errors(project, shape_id, clip, plan, duration) -> (LimbError("left shin", median=0.4, p90=1.2), ...)

For each limb segment that a chain of the take drives, the direction from its first joint to its last joint is
compared with the performer's direction, in the shape's axes. With mode "pose" both directions should be
equal. With mode "move" the segment should rotate from the shape's rest pose as the performer's segment
rotates from the rest pose of the take. So the expected direction is the shape's rest direction, rotated by
the smallest rotation from the performer's rest direction to the performer's current direction. This formula
serves both modes: with mode "pose" the two rest directions are equal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, RiggedCharacter, joint_places
from enliven.mapping.applying import apply_plan, source_anatomy
from enliven.mapping.legs.gait import find_posed_stepping_legs, legs_that_step
from enliven.mapping.plan import Plan
from enliven.motion.layers.evaluate import Player
from enliven.rotation import rotate, swing, unit
from enliven.skeletons.anatomy import SkeletonLimb, find_anatomy, is_tip_start

_MAX_FRAMES = 120
"""Maximum number of compared frames. With 120 frames, the 90th percentile is determined by a dozen frames."""
_SEGMENT_NAMES = {(True, 2): ("thigh", "shin"), (False, 2): ("upper arm", "forearm")}
"""Names of a limb's segments. The key is (True if the limb stands on the floor, number of segments)."""


@dataclass(frozen=True)
class LimbError:
    """The angle between a limb segment and the performer's, in degrees over the motion.

    Attributes:
        limb: name of the segment, such as "left forearm".
        median, p90: median and 90th percentile of the angle, in degrees.
    """

    limb: str
    median: float
    p90: float


def limb_errors(
    project: Project, shape_id: str, clip: Clip, plan: Plan, duration: float
) -> tuple[LimbError, ...]:
    """Returns the pose errors of all limb segments that are driven by the take alone, at its own speed.

    Stepping legs that do not keep the performer's pose are excluded: they do not follow the performer's
    angles.

    Args:
        project: the project, in which the plan moves the shape.
        shape_id: id of the shape.
        clip: the performer's take.
        plan: the mapping.
        duration: duration of the compared motion in seconds.
    """
    retargeted = project.shape(shape_id)
    posed = find_posed_stepping_legs(retargeted, clip, plan)
    stepping = {limb.proper for limb in legs_that_step(retargeted, clip, plan) if limb not in posed}
    # The expected motion is the result of the plan without steps and foot locks.
    planned, _ = apply_plan(Project(), retargeted.at_rest(retargeted.mesh)[0], clip, plan)
    shape = planned.shape(shape_id)
    # Compare at frames of the take only. Between frames, interpolated directions differ from the directions
    # of interpolated rotations.
    last_frame = min(round(duration / clip.step), len(clip.turns) - 1)
    times = clip.step * np.unique(np.round(np.linspace(0, last_frame, min(_MAX_FRAMES, last_frame + 1))))
    joints = Player(project, shape_id).sample(times)[1]
    errors = list[LimbError]()
    starts = {limb.proper[0] for pair in source_anatomy(clip).pairs for limb in pair}
    for name, layer, chain in _find_driven_segments(planned, shape, clip, stepping):
        expected = _compute_expected_directions(planned.takes[layer.take], layer, starts, shape, chain, times)
        angles = _degrees_between(joints[:, chain[-1]] - joints[:, chain[0]], expected)
        errors.append(LimbError(name, float(np.median(angles)), float(np.percentile(angles, 90.0))))
    return tuple(errors)


def _find_driven_segments(
    project: Project, shape: RiggedCharacter, clip: Clip, without: set[tuple[int, ...]]
) -> Iterator[tuple[str, Layer, tuple[int, ...]]]:
    """Yields the name, layer and joints of each limb segment that one layer of the performer's take drives.

    Args:
        without: limbs that are excluded, given by their joints.
    """
    for number, pair in enumerate(find_anatomy(shape.skeleton).pairs, 1):
        for side, limb in zip(("left", "right"), pair, strict=True):
            if limb.proper in without:
                continue
            layers = _bone_layers(project, shape, clip, limb.main)
            segments = list(dict.fromkeys(layer.id for layer in layers if layer is not None))
            for k, name in enumerate(segments):
                bones = [
                    j for j, layer in zip(limb.main[1:], layers, strict=True) if layer and layer.id == name
                ]
                layer = shape.layer(name)
                chain = shape.skeleton.path(int(shape.skeleton.parents[bones[0]]), bones[-1])
                if is_tip_start(shape.skeleton, limb, chain[0]):
                    continue  # A hand or foot keeps the model's rest rotation, so it has no pose error.
                yield f"{side} {_segment_name(limb, number, k, len(segments))}", layer, chain


def _segment_name(limb: SkeletonLimb, number: int, segment: int, count: int) -> str:
    """Returns the name of a segment of a limb. ``number`` is the number of the limb's pair, from 1."""
    names = _SEGMENT_NAMES.get((limb.grounded, count), ()) if limb.knots else ()
    if names:
        return names[segment]
    kind = "leg" if limb.grounded else "arm"
    return f"{kind} {number}" if count == 1 else f"{kind} {number}, segment {segment + 1}"


def _bone_layers(
    project: Project, shape: RiggedCharacter, clip: Clip, chain: tuple[int, ...]
) -> list[Layer | None]:
    """Returns the layer of the take for each bone of a chain, or None if another layer moves the bone."""
    sole_layers = list[Layer | None]()
    for bone in chain[1:]:
        layer_names = {ref.layer for span in shape.spans[bone] for ref in span.refs}
        layers = [shape.layer(name) for name in layer_names]
        unchanged_layers = [layer for layer in layers if _plays_unchanged(project, layer, clip)]
        sole_layers.append(unchanged_layers[0] if len(layers) == len(unchanged_layers) == 1 else None)
    return sole_layers


def _plays_unchanged(project: Project, layer: Layer, clip: Clip) -> bool:
    """Returns True if a layer plays the performer's take at its own speed."""
    has_default_timing = (layer.offset, layer.speed, layer.loop) == (0.0, 1.0, False) and len(layer.chain) > 1
    return has_default_timing and project.takes[layer.take].skeleton.names == clip.skeleton.names


def _compute_expected_directions(
    take: Clip, layer: Layer, starts: set[int], shape: RiggedCharacter, chain: tuple[int, ...], times: Float
) -> Float:
    """Returns (T, 3) directions that a chain of the shape should point in, in the shape's axes.

    Args:
        take: the take.
        layer: the layer that plays the take on the chain.
        starts: the first joints of the performer's limbs, after the girdle. Girdles are not compared.
        shape: the shape.
        chain: joints of the shape's segment.
        times: (T,) seconds.
    """
    first = next((joint for joint in layer.chain[:-1] if joint in starts), layer.chain[0])
    last = layer.chain[-1]
    source_joints, rest = joint_places(take, (first, last)), take.skeleton.positions
    mirror = np.array([-1.0 if layer.mirrored else 1.0, 1.0, 1.0])
    directions = rotate(layer.basis, mirror * (source_joints[:, last] - source_joints[:, first]))
    source_rest_direction = unit(rotate(layer.basis, mirror * (rest[last] - rest[first])))
    frames = np.arange(len(directions)) * take.step
    source_directions = np.stack([np.interp(times, frames, directions[:, k]) for k in range(3)], axis=1)
    rest_direction = shape.skeleton.positions[chain[-1]] - shape.skeleton.positions[chain[0]]
    return np.asarray(rotate(swing(source_rest_direction, unit(source_directions)), rest_direction))


def _degrees_between(first: Float, second: Float) -> Float:
    """Returns the angles (T,) in degrees between vectors (T, 3)."""
    cosines = np.sum(unit(first) * unit(second), axis=1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))
