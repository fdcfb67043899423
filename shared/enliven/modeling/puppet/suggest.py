"""Suggests an initial puppet: control points, joints, feet, symmetry and key frames.

suggest_puppet(project, mesh, "walk", "cow")       # a puppet that needs only key poses
suggest_extremities(mesh, 6)                       # control points only, for the studio's panel
suggest_pairs(project, "cow", "walk")              # a joint for each control point that is not paired
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.surface_ends import find_extremity_vertices
from enliven.document import Clip, ExampleCharacter, Plane, Project, unused
from enliven.errors import InputError
from enliven.examples.pairing import (
    foot_joints,
    guess_joints,
    keep_one_point_per_hand,
    measure_joint_motion,
    mirror_joint,
)
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_examples import IdentityKey
from enliven.examples.suggest import suggest_poses
from enliven.examples.symmetric import find_partners, reflect_points
from enliven.meshes import Mesh
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point, change_point, remove_point
from enliven.modeling.puppet.poses import add_key_pose, set_symmetry

_MAX_FOOT_HEIGHT = 0.08
"""Maximum height of a foot's control point above the lowest vertex, as a fraction of the mesh's height."""
_MIN_AXIS_COSINE = 0.7
"""Minimum cosine between a symmetry plane's normal and the left-right axis."""
_CACHED_MESHES = 16
"""Number of meshes for which symmetry planes are cached (least recently used are dropped)."""
_MAX_MIRROR_ERROR = 0.1
"""Maximum error of a mirror image, as a fraction of the control points' extent."""


@dataclass(frozen=True)
class SuggestedPair:
    """A suggested joint for a control point that is not paired.

    Attributes:
        point: name of the control point.
        joint: the performer's joint.
        foot: True if the puppet can stand on the control point.
    """

    point: str
    joint: str
    foot: bool


def suggest_puppet(
    project: Project, mesh: Mesh, take: str, puppet_id: str, points: int = 6, poses: int | None = None
) -> Project:
    """Adds a puppet that is complete except for its key poses. In these, all control points are still at
    rest.

    Key poses are created at the frames of the take that differ most from each other.

    Args:
        take: id of the take that the puppet plays. It also contains the frames of the key poses.
        points: maximum number of extremities (ends of limbs). Their mirror images are added.
        poses: number of key poses; None chooses a sufficient number.

    Raises:
        InputError: if ``points`` is below 1 or ``poses`` below 2, or if the take contains no motion.
    """
    if points < 1 or (poses is not None and poses < 2):
        problem = f"{points} control points and {poses} key poses are too few"
        raise InputError(
            problem, where=f"puppet {puppet_id!r}", remedy="Pass at least 1 control point and 2 key poses."
        )
    project = make_puppet(project, mesh, puppet_id)
    plane = _compute_left_right_plane(mesh)
    for vertex in _suggest_extremities(mesh, points, plane):
        project = add_point(project, puppet_id, vertex)
    if plane is not None and _mirror_partners(project.puppet(puppet_id).rest, plane) is not None:
        project = set_symmetry(project, puppet_id, plane)
    project = _pair_points(project, puppet_id, take)
    puppet, clip = project.puppet(puppet_id), project.takes[take]
    joints = [point.joint for point in puppet.points]
    suggestion = suggest_poses(extract_performer_clip(clip, joints).poses)
    for frame in sorted(suggestion.frames[: poses or suggestion.count]):
        project = add_key_pose(project, puppet_id, take, frame * clip.step, puppet.rest)
    return play_take(project, puppet_id, take)


def suggest_extremities(mesh: Mesh, count: int) -> list[int]:
    """Returns vertices at the extremities of a mesh, and their mirror images if it is symmetric.

    Args:
        count: maximum number of extremities (ends of limbs). Their mirror images are added.
    """
    return _suggest_extremities(mesh, count, _compute_left_right_plane(mesh))


def suggest_pairs(project: Project, puppet_id: str, take: str) -> tuple[SuggestedPair, ...]:
    """Suggests a joint for each control point that is not paired: a joint that moves in the take, on the same
    side and at a similar height.

    Control points that are mirror images get the corresponding joints of both sides. A control point low on
    the mesh is a foot if its joint is a foot.
    """
    puppet, clip = project.puppet(puppet_id), project.takes[take]
    plane = puppet.symmetry or _compute_left_right_plane(puppet.mesh)
    partners = None if plane is None else _mirror_partners(puppet.rest, plane)
    joints = _with_mirrored_joints(clip, [point.joint for point in puppet.points], partners)
    unpaired = [number for number, joint in enumerate(joints) if not joint]
    used_joints = [joint for joint in joints if joint]
    motion = measure_joint_motion(clip)
    guesses = guess_joints(clip.skeleton, puppet.rest, used_joints, unpaired, motion, partners)
    for number, joint in zip(unpaired, guesses, strict=True):
        joints[number] = joint
    feet = _find_standing_points(clip, joints, puppet)
    return tuple(
        SuggestedPair(point.name, joint, foot)
        for point, joint, foot in zip(puppet.points, joints, feet, strict=True)
        if not point.joint
    )


def _suggest_extremities(mesh: Mesh, count: int, plane: Plane | None) -> list[int]:
    vertices = [int(vertex) for vertex in find_extremity_vertices(mesh, count)]
    return vertices if plane is None else _with_mirror_images(mesh, vertices, plane)


def suggest_joint(project: Project, puppet_id: str, take: str, point: str) -> str:
    """Returns a joint for a control point, given the joints of the other control points."""
    project = change_point(project, puppet_id, point, joint="")
    return next(pair.joint for pair in suggest_pairs(project, puppet_id, take) if pair.point == point)


def _pair_points(project: Project, puppet_id: str, take: str) -> Project:
    """Pairs all control points with joints, and names them after these joints. Only one control point is kept
    for each hand or foot."""
    for pair in suggest_pairs(project, puppet_id, take):
        points_by_name = {point.name: point for point in project.puppet(puppet_id).points}
        named = {"name": unused(pair.joint, points_by_name), "joint": pair.joint, "foot": pair.foot}
        project = change_point(project, puppet_id, pair.point, **named)
    puppet, skeleton = project.puppet(puppet_id), project.takes[take].skeleton
    partners = None if puppet.symmetry is None else _mirror_partners(puppet.rest, puppet.symmetry)
    joints = [point.joint for point in puppet.points]
    chosen = keep_one_point_per_hand(skeleton, joints, partners or range(len(joints)))
    for number in set(range(len(joints))) - set(chosen):
        project = remove_point(project, puppet_id, puppet.points[number].name)
    return project


def _with_mirrored_joints(clip: Clip, joints: list[str], partners: Sequence[int] | None) -> list[str]:
    """Returns the names of the joints (P,). A point without a joint gets the mirrored joint of its mirror
    image."""
    if partners is None:
        return joints
    return [
        joint or (mirror_joint(clip.skeleton, joints[other]) if joints[other] and other != number else "")
        for number, (joint, other) in enumerate(zip(joints, partners, strict=True))
    ]


def _compute_left_right_plane(mesh: Mesh) -> Plane | None:
    """Returns the symmetry plane between left and right, from a cache. The mesh faces +Z."""
    return _symmetry_plane(IdentityKey(mesh))


@lru_cache(maxsize=_CACHED_MESHES)
def _symmetry_plane(mesh: IdentityKey[Mesh]) -> Plane | None:
    plane = plane_of_symmetry(mesh())
    return plane if plane is not None and abs(plane.normal[0]) > _MIN_AXIS_COSINE else None


def _with_mirror_images(mesh: Mesh, vertices: list[int], plane: Plane) -> list[int]:
    """Returns the vertices, and adds the mirror image of each vertex that has no partner and is not on the
    plane.
    """
    used = np.unique(mesh.faces)
    rest = mesh.vertices[vertices]
    images = reflect_points(rest, np.array(plane.point), np.array(plane.normal))
    away = np.linalg.norm(images[:, None] - rest[None], axis=2)
    nearest = away.argmin(1)
    near = _MAX_MIRROR_ERROR * float(np.linalg.norm(np.ptp(rest, axis=0)))
    out = list(vertices)
    for number, other in enumerate(nearest):
        if nearest[other] == number and away[number, other] < near:
            continue
        image = int(used[np.linalg.norm(mesh.vertices[used] - images[number], axis=1).argmin()])
        if image not in out:
            out.append(image)
    return out


def _mirror_partners(rest: Float, plane: Plane) -> tuple[int, ...] | None:
    """Returns the number of each control point's mirror image. Returns None if a point has no mirror image,
    or if all points are on the plane.
    """
    try:
        partners = find_partners(rest, np.array(plane.point), np.array(plane.normal), _MAX_MIRROR_ERROR)
    except InputError:
        return None
    return partners if any(other != number for number, other in enumerate(partners)) else None


def _find_standing_points(clip: Clip, joints: Sequence[str], puppet: ExampleCharacter) -> list[bool]:
    """Returns (P,) True for control points that can stand: these are low on the mesh and paired with a foot.

    If only one such point exists, it is not used, because the mesh would hop whenever the performer lifts
    that foot.
    """
    feet_of = foot_joints(clip.skeleton)
    low, high = puppet.mesh.bounds[:, 1]
    feet = [
        joint in feet_of and bool(place[1] < low + _MAX_FOOT_HEIGHT * (high - low))
        for joint, place in zip(joints, puppet.rest, strict=True)
    ]
    return feet if sum(feet) > 1 else [False] * len(feet)
