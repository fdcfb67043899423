"""The locomotion of a puppet: its stepping feet, and the distance that it travels per metre of the
performer's path.

    travel = find_travel(project, puppet)                # for all takes that it plays, and on the stage
    path = travel.path_of(took, facing, size)          # (F,) target path of the puppet on the floor

A puppet steps with the feet that alternate on the ground in its key poses. Its stride is measured in the
takes of the key poses. A puppet that does not step travels as far as its performer, scaled by size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from enliven.arrays import Bool, Complex, Float
from enliven.document import (
    Clip,
    ExampleCharacter,
    LocomotionSettings,
    Project,
    PuppetLayer,
    Skeleton,
    Switch,
)
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import PerformerClip, extract_performer_clip
from enliven.examples.performers import ReferenceConversion, match_performer
from enliven.examples.poses import Examples
from enliven.examples.puppet_examples import (
    MotionInputs,
    build_examples,
    collect_motion_inputs,
    find_missing_examples,
    find_reference_skeleton,
)
from enliven.examples.spacetime.following import complex_from_floor
from enliven.examples.spacetime.locomotion import (
    PlacedMotion,
    find_feet_on_floor,
    find_switches,
    place_motion,
)
from enliven.skeletons.facing import find_facing, rotate_about_y

_CACHED_TRAVELS = 64
"""Number of results in the least-recently-used cache. Each edit of a puppet gives a new result."""
_MIN_STEP_LENGTH = 0.05
"""Minimum movement of one foot relative to another foot, between key poses, that counts as a step. Fraction
of the puppet's size."""
_MAX_GROUND_HEIGHT = 0.02
"""Maximum height above the lowest foot at which a foot counts as on the ground, as a fraction of the puppet's
size."""
_SAMPLES_PER_SECOND = 30.0
"""Frames per second at which steps are measured. A stride takes half a second or more."""
_COMPARED_PATH_S = 1.0
"""Time span, in seconds, over which the displacements of puppet and performer are compared. It is longer than
a stride, so steps average out."""
_EXPLAINED_VARIANCE_RANGE = (0.7, 0.9)
"""Range of the explained variance of the puppet's path by the performer's path. Below this range, the stride
is the ratio of sizes. Above it, the stride is measured from the steps. Within the range, the two are blended.
The explained variance is above 0.9 in walks, and below 0.7 if the performer stays in place."""


@dataclass(frozen=True)
class PuppetTravel:
    """The feet and the stride of a puppet.

    Attributes:
        feet: numbers of the control points with which it steps. Without feet it only follows the performer.
        stride: the puppet's displacement on the floor, x + iz in metres, for one metre that the performer
            walks forward. The performer is that of the key poses.
    """

    feet: tuple[int, ...]
    stride: complex

    def compute_path(
        self, took: PerformerClip, facing: float, size: float, mirrored: bool = False
    ) -> Complex:
        """Returns the path (F,) of the puppet for a performer's take: complex numbers x + iz in metres,
        starting at 0.

        Args:
            facing: radians from +Z to the facing direction of the performer's skeleton at rest.
            size: size of the performer of the key poses divided by the size of this performer.
            mirrored: True if the puppet moves as in a mirror.
        """
        return self.stride * size * floor_path(took, facing, mirrored)


def floor_path(took: PerformerClip, facing: float, mirrored: bool = False) -> Complex:
    """Returns the path (F,) of a performer on the floor: complex numbers x + iz in metres, rotated so that
    the performer faces +Z at first.
    """
    path = complex_from_floor(rotate_about_y(took.root - took.root[0], -(took.yaw[0] + facing)))
    return -path.conj() if mirrored else path


def find_travel(project: Project, puppet: ExampleCharacter) -> PuppetTravel:
    """Returns the feet and the stride of a puppet, from a cache if possible.

    Raises:
        InputError: if the puppet lacks data.
    """
    lacking = find_missing_examples(project, puppet)
    if lacking:
        raise InputError(
            "the puppet is not ready to move", where=f"puppet {puppet.id!r}", remedy=" ".join(lacking)
        )
    return layer_travel(collect_motion_inputs(project, puppet, PuppetLayer(puppet.poses[0].take)))


def layer_travel(material: MotionInputs) -> PuppetTravel:
    """Returns the feet and the stride of a layer's puppet. The layer affects the result only by its
    mirroring.

    Raises:
        InputError: if the puppet lacks data.
    """
    layer = PuppetLayer("", mirrored=material.layer.mirrored)
    return _get_cached_travel(replace(material, layer=layer, take=(*material.shown, material.take)[0]))


def find_alternating_feet(targets: Float, feet: Sequence[int]) -> tuple[int, ...]:
    """Returns the numbers of the feet that alternate on the ground in the key poses (n, P, 3), metres.

    Two feet alternate if each is on the ground in at least one pose, and their relative position changes
    between poses.

    Args:
        feet: numbers of the control points that are feet.
    """
    places = targets[:, list(feet)]
    size = float(np.linalg.norm(np.ptp(targets.reshape(-1, 3), axis=0))) if len(feet) else 0.0
    grounded = (
        places[..., 1] <= places[..., 1].min(1, initial=np.inf, keepdims=True) + _MAX_GROUND_HEIGHT * size
    ).any(0)
    alternating = set[int]()
    for a, b in combinations(np.flatnonzero(grounded).tolist(), 2):
        spread = np.ptp(places[:, a] - places[:, b], axis=0).max()
        if spread > _MIN_STEP_LENGTH * size:
            alternating |= {feet[a], feet[b]}
    return tuple(sorted(alternating))


def convert_take(clip: Clip, role: ReferenceConversion) -> PerformerClip:
    """Converts a take to the performer of the key poses, including the size."""
    performer_clip = extract_performer_clip(clip, role.joints)
    return replace(performer_clip, poses=role.convert_poses(performer_clip.poses))


@dataclass(frozen=True, eq=False)
class PerformerFeet:
    """The feet of a performer in a take, and the control points that follow them.

    Attributes:
        seen: (F, K, 3) metres, positions of the performer's feet in the world.
        feet: (K,) numbers of the control points.
        legs: mean length of the bones from the root to the feet, metres.
        step: seconds between frames.
        how: the settings of locomotion.
    """

    seen: Float
    feet: tuple[int, ...]
    legs: float
    step: float
    how: LocomotionSettings

    def find_standing_feet(self) -> Bool:
        """Returns (F, K) True for feet that stand."""
        return find_feet_on_floor(self.seen, self.step, self.legs, self.how)

    def place_in_world(
        self, places: Float, yaw: Float, stands: Bool, switches: Sequence[Switch] | None = None
    ) -> PlacedMotion:
        """Returns the motion of control points (F, P, 3) in the world. Only the contact of these feet moves
        the mesh."""
        if switches is None:
            switches = find_switches(self.seen, self.step, self.legs, self.how)
        return place_motion(places, yaw, self.step, switches, self.feet, self.how, stands)


def performer_feet(
    skeleton: Skeleton,
    role: ReferenceConversion,
    took: PerformerClip,
    feet: Sequence[int],
    how: LocomotionSettings,
    rows: Sequence[int] | None = None,
) -> PerformerFeet:
    """Returns the feet of a performer in a take.

    Args:
        skeleton: the performer's skeleton.
        took: the take, one row per joint of the role.
        feet: numbers of the control points.
        rows: for each foot, the row of its joint in the role. If None, rows and control points have the same
            numbers.
    """
    rows = list(feet if rows is None else rows)
    bone_paths = [skeleton.path(0, skeleton.index(role.joints[row])) for row in rows]
    legs = float(np.mean([skeleton.lengths[list(bone_path)].sum() for bone_path in bone_paths])) or 1.0
    return PerformerFeet(took.world[:, rows], tuple(feet), legs, took.step, how)


@lru_cache(maxsize=_CACHED_TRAVELS)
def _get_cached_travel(material: MotionInputs) -> PuppetTravel:
    mesh, points, shown = material.mesh(), material.points, [load_clip() for load_clip in material.shown]
    examples = build_examples(material.puppet, mesh, points, material.poses, shown, material.symmetry)
    reference = find_reference_skeleton([clip.skeleton for clip in shown], examples.joints)
    size = _mean_size(mesh.vertices) / max(_mean_size(reference.positions), 1e-9)
    feet = find_alternating_feet(examples.targets, [k for k, point in enumerate(points) if point.foot])
    if not feet:
        return PuppetTravel((), complex(size))
    return PuppetTravel(
        feet, _fit_stride(material, examples, reference, list(dict.fromkeys(shown)), feet, size)
    )


def _fit_stride(
    material: MotionInputs,
    examples: Examples,
    reference: Skeleton,
    takes: Sequence[Clip],
    feet: tuple[int, ...],
    size: float,
) -> complex:
    """Returns the stride of a puppet that steps: the least-squares ratio of its path to the performer's.

    If the performer's path does not explain the puppet's path, for instance because the performer stays in
    place, the result is the ratio of their sizes.

    Args:
        size: the ratio of sizes.
    """
    mapping, mirrored = ExampleMap(examples, material.examples), material.layer.mirrored
    cross_product, puppet_square, performer_square = 0j, 0.0, 0.0
    for clip in takes:
        role = match_performer(reference, clip.skeleton, examples.joints, clip.id)
        resampled = _resample_take(convert_take(clip, role))
        yaw = (-1.0 if mirrored else 1.0) * (resampled.yaw - resampled.yaw[0])
        stepper = performer_feet(clip.skeleton, role, resampled, feet, material.locomotion)
        placed_motion = stepper.place_in_world(
            mapping.solve(resampled.poses, resampled.step), yaw, stepper.find_standing_feet()
        )
        performer_path = role.size * floor_path(resampled, find_facing(clip.skeleton), mirrored)
        puppet_moves, performer_moves = (
            _path_displacements(path, resampled.step)
            for path in (complex_from_floor(placed_motion.root), performer_path)
        )
        cross_product += complex(np.vdot(performer_moves, puppet_moves))
        puppet_square, performer_square = (
            puppet_square + float(np.vdot(puppet_moves, puppet_moves).real),
            performer_square + float(np.vdot(performer_moves, performer_moves).real),
        )
    explained = abs(cross_product) ** 2 / max(puppet_square * performer_square, 1e-12)
    step_confidence = float(
        np.clip(
            (explained - _EXPLAINED_VARIANCE_RANGE[0])
            / (_EXPLAINED_VARIANCE_RANGE[1] - _EXPLAINED_VARIANCE_RANGE[0]),
            0.0,
            1.0,
        )
    )
    return size + step_confidence * (cross_product / max(performer_square, 1e-12) - size)


def _path_displacements(path: Complex, step: float) -> Complex:
    """Returns the displacements (N,) of a path (F,) over :data:`_COMPARED_PATH_S`, starting at each frame."""
    frame_offset = max(min(round(_COMPARED_PATH_S / step), len(path) - 1), 1)
    return np.asarray(path[frame_offset:] - path[:-frame_offset])


def _resample_take(took: PerformerClip) -> PerformerClip:
    """Returns the take resampled to about :data:`_SAMPLES_PER_SECOND` frames per second."""
    frame_step = max(round(1.0 / (_SAMPLES_PER_SECOND * took.step)), 1)
    return PerformerClip(
        took.poses[::frame_step],
        took.world[::frame_step],
        took.root[::frame_step],
        took.yaw[::frame_step],
        took.step * frame_step,
    )


def _mean_size(places: Float) -> float:
    """Returns the geometric mean of the height and the largest extent of places (N, 3), metres."""
    extents = np.ptp(places, axis=0)
    return float(np.sqrt(extents[1] * extents.max()))
