"""Converts a puppet's key poses to examples, and lists the data that is missing before it can move."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from operator import itemgetter
from typing import Generic, TypeVar

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    Clip,
    ControlPoint,
    ExampleCharacter,
    ExampleSettings,
    KeyPose,
    LocomotionSettings,
    Plane,
    Project,
    PuppetLayer,
    Skeleton,
    smooth_take,
)
from enliven.errors import InputError
from enliven.examples.performer import extract_performer_clip
from enliven.examples.performers import match_performer
from enliven.examples.poses import Examples, drop_repeated_poses
from enliven.examples.symmetric import add_mirror_images, find_partners
from enliven.meshes import Mesh

T = TypeVar("T")


class IdentityKey(Generic[T]):
    """A cache key that compares its object by identity, and does not keep the object alive."""

    def __init__(self, value: T) -> None:
        self._value, self._id = weakref.ref(value), id(value)

    def __call__(self) -> T:
        """Returns the object. The creator of the key must keep the object alive."""
        value = self._value()
        assert value is not None
        return value

    def __hash__(self) -> int:
        return self._id

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return (
            isinstance(other, IdentityKey) and self._value() is not None and self._value() is other._value()
        )


@dataclass(frozen=True)
class MotionInputs:
    """The inputs of a layer's motion. They form the cache key of the solved motion, and are compared by value
    or by identity.

    Attributes:
        points, poses, symmetry: attributes of the puppet.
        mesh: the puppet's mesh.
        shown: the takes in which the performer shows the key poses.
        take: the take that the layer plays.
        layer: the layer, with default values for attributes that only affect its timing.
        examples, locomotion: the settings of the examples and of the locomotion.
        puppet: the puppet's name, for messages.
    """

    points: tuple[ControlPoint, ...]
    poses: tuple[KeyPose, ...]
    symmetry: Plane | None
    mesh: IdentityKey[Mesh]
    shown: tuple[IdentityKey[Clip], ...]
    take: IdentityKey[Clip]
    layer: PuppetLayer
    examples: ExampleSettings
    locomotion: LocomotionSettings
    puppet: str = field(compare=False)


def collect_motion_inputs(project: Project, puppet: ExampleCharacter, layer: PuppetLayer) -> MotionInputs:
    """Returns the inputs that the motion of a layer depends on."""
    shown = tuple(IdentityKey(project.takes[pose.take]) for pose in puppet.poses)
    timeless = replace(layer.with_default_timing(), muted=False)
    values = (puppet.points, puppet.poses, puppet.symmetry, IdentityKey(puppet.mesh), shown)
    take = IdentityKey(smooth_take(project.takes[layer.take], layer.smooth))
    return MotionInputs(*values, take, timeless, puppet.examples, puppet.locomotion, puppet.id)


def examples_from_key_poses(project: Project, puppet: ExampleCharacter) -> Examples:
    """Converts the key poses to examples, with joints in the performer's body frame. If the puppet is
    symmetric, mirrored examples are added.

    Raises:
        InputError: if data is missing (see :func:`find_missing_examples`), or the examples cannot be used.
    """
    takes = [project.takes[pose.take] for pose in puppet.poses]
    return build_examples(puppet.id, puppet.mesh, puppet.points, puppet.poses, takes, puppet.symmetry)


def build_examples(
    name: str,
    mesh: Mesh,
    points: Sequence[ControlPoint],
    poses: Sequence[KeyPose],
    takes: Sequence[Clip],
    symmetry: Plane | None,
) -> Examples:
    """Builds the examples of the given control points from the key poses in the given takes."""
    lacking = find_missing(mesh, points, [take.skeleton for take in takes], symmetry)
    if lacking:
        raise InputError(lacking[0], where=f"puppet {name!r}", remedy=" ".join(lacking[1:]))
    joints = tuple(point.joint for point in points)
    names = tuple(point.name for point in points)
    reference = find_reference_skeleton([take.skeleton for take in takes], joints)
    targets = np.stack([pose.places for pose in poses])
    examples = Examples(joints, names, _list_performed_key_poses(takes, poses, joints, reference), targets)
    if symmetry is None:
        return examples
    plane_point, plane_normal = np.array(symmetry.point), np.array(symmetry.normal)
    rest = mesh.vertices[[point.vertex for point in points]]
    partners = find_partners(rest, plane_point, plane_normal, names=names)
    return add_mirror_images(
        examples, partners, rest, plane_normal, _compute_left_right_axis(reference, joints, partners)
    )


def select_pairs(examples: Examples, pairs: Sequence[int]) -> Examples:
    """Returns the examples restricted to a subset of the pairs. If several examples have equal joint
    positions, only the first is kept.
    """
    joints, points = (tuple(names[k] for k in pairs) for names in (examples.joints, examples.points))
    sources, targets = examples.sources[:, pairs], examples.targets[:, pairs]
    kept_numbers = drop_repeated_poses(sources)
    return Examples(joints, points, sources[kept_numbers], targets[kept_numbers])


def _compute_left_right_axis(
    reference: Skeleton, joints: Sequence[str], partners: Sequence[int]
) -> Float | None:
    """Returns the performer's horizontal left-right axis (3,). It is measured at rest, because during a
    stride the feet are farther apart in depth than in width.
    """
    places = reference.positions[[reference.index(name) for name in joints]]
    offsets = (places - places[list(partners)]) * [1.0, 0.0, 1.0]
    widest = offsets[int(np.linalg.norm(offsets, axis=1).argmax())]
    length = float(np.linalg.norm(widest))
    return widest / length if length > 1e-6 else None


def reference_performer(project: Project, puppet: ExampleCharacter) -> Skeleton:
    """Returns the skeleton of the reference performer, which defines size and joints of a puppet's examples;
    see :mod:`enliven.examples.performers`.

    Raises:
        InputError: if the puppet has no key poses.
    """
    if not puppet.poses:
        raise InputError(
            "the puppet has no key pose", where=f"puppet {puppet.id!r}", remedy="Pose two examples."
        )
    skeletons = [project.takes[pose.take].skeleton for pose in puppet.poses]
    return find_reference_skeleton(skeletons, tuple(point.joint for point in puppet.points))


def find_reference_skeleton(skeletons: Sequence[Skeleton], joints: Sequence[str]) -> Skeleton:
    """Returns the first skeleton that has all of the joints, or the first skeleton if none has."""
    return next((skeleton for skeleton in skeletons if set(joints) <= set(skeleton.names)), skeletons[0])


def find_missing_examples(project: Project, puppet: ExampleCharacter) -> tuple[str, ...]:
    """Returns sentences about the data that a puppet still lacks. The list is empty if the puppet is ready to
    move.
    """
    skeletons = [project.takes[pose.take].skeleton for pose in puppet.poses]
    return find_missing(puppet.mesh, puppet.points, skeletons, puppet.symmetry)


def find_missing(
    mesh: Mesh, points: Sequence[ControlPoint], skeletons: Sequence[Skeleton], symmetry: Plane | None
) -> tuple[str, ...]:
    """Returns sentences about missing parts of control points and key poses, for performers with these
    skeletons."""
    if not points:
        return ("Put control points on the mesh.",)
    sentences = [f"Pair {point.name!r} with a joint." for point in points if not point.joint]
    if skeletons:
        joint_names = find_reference_skeleton(skeletons, [point.joint for point in points]).names
        sentences += [
            f"Pair {point.name!r} with another joint: the performer of the key poses has no {point.joint!r}"
            f"{_find_similar_names(point.joint, joint_names)}."
            for point in points
            if point.joint and point.joint not in joint_names
        ]
    if len(skeletons) < 2:
        sentences.append("Pose one more example." if skeletons else "Pose two examples.")
    if symmetry is not None:
        rest = mesh.vertices[[point.vertex for point in points]]
        names = [point.name for point in points]
        try:
            find_partners(rest, np.array(symmetry.point), np.array(symmetry.normal), names=names)
        except InputError as error:
            sentence = error.what[0].upper() + error.what[1:]
            sentences.append(
                f"{sentence}: add a control point at the mirrored position, or turn symmetry off."
            )
    return tuple(sentences)


def _find_similar_names(name: str, known: Sequence[str]) -> str:
    """Returns similar names as part of a sentence: names with the same words in another order, or else the
    most similarly spelt names.
    """
    words = sorted(name.split())
    reordered = [other for other in known if sorted(other.split()) == words]
    matches = reordered or get_close_matches(name, known, n=3, cutoff=0.4)
    return f" (there are {', '.join(matches)})" if matches else ""


def find_nearest_frame(clip: Clip, seconds: float) -> int:
    """Returns the frame of a take nearest to a time.

    Raises:
        InputError: if the time is outside the take.
    """
    frames = float(seconds) / float(clip.step)  # The division may overflow to infinity.
    frame = round(frames) if math.isfinite(frames) else -1
    if not 0 <= frame < len(clip.turns):
        problem = f"the time {seconds:g} s is outside the take"
        raise InputError(
            problem, where=f"take {clip.id!r}", remedy=f"Choose a time from 0 to {clip.duration:g} s."
        )
    return frame


def _list_performed_key_poses(
    takes: Sequence[Clip], poses: Sequence[KeyPose], joints: tuple[str, ...], reference: Skeleton
) -> Float:
    """Returns the paired joints (n, P, 3) at the key poses, in the body frame, converted to the reference
    performer, metres.
    """
    all_poses = np.empty((len(poses), len(joints), 3))
    for take in dict.fromkeys(takes):
        pose_numbers = [n for n, other in enumerate(takes) if other is take]
        frames = [find_nearest_frame(take, poses[n].time) for n in pose_numbers]
        role = match_performer(reference, take.skeleton, joints, take.id)
        clip = take.map_values(itemgetter(frames))
        all_poses[pose_numbers] = role.convert_poses(extract_performer_clip(clip, role.joints).poses)
    return all_poses
