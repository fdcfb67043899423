"""A puppet to begin with: control points, joints, symmetry and key poses as a first guess."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph import extremities
from enliven.document import Clip, Plane, Project, Skeleton, unused
from enliven.errors import InputError
from enliven.examples import guess_joints, partners_of, performed, reflected, suggest_poses
from enliven.mapping import SkeletonLimb, anatomy_of
from enliven.meshes import Mesh
from enliven.modeling.mesh import plane_of_symmetry
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point
from enliven.modeling.puppet.poses import add_key_pose, set_symmetry

_LOW = 0.08
"""Share of the mesh's height below which a control point can be a foot."""
_ACROSS = 0.7
"""Cosine to the left-right axis from which on a plane's normal goes across."""
_HAND = 0.35
"""Share of a limb, from its end, that is its hand or foot."""
_OFF = 0.1
"""Share of the control points' extent by which a mirror image may be off."""


def suggested_puppet(
    project: Project, mesh: Mesh, take: str, puppet_id: str, points: int = 6, poses: int | None = None
) -> Project:
    """A project with a puppet that is complete but for its key poses, which are all at rest.

    Control points are at the extremities, and their mirror images where the mesh is symmetric; joints are
    guessed by side and height; key poses are those of the take that are farthest from one another.

    Args:
        take: id of the take that shows the key poses, which the puppet plays.
        points: how many extremities at most; their mirror images come on top.
        poses: how many key poses; None for as many as are enough.

    Raises:
        InputError: for fewer than one point or two key poses, and for a take without any motion.
    """
    if points < 1 or (poses is not None and poses < 2):
        what = f"{points} control points and {poses} key poses are too few"
        raise InputError(what, where=f"puppet {puppet_id!r}", mend="At least one point and two poses.")
    project = make_puppet(project, mesh, puppet_id)
    clip, plane = project.takes[take], _left_right(mesh)
    vertices = [int(vertex) for vertex in extremities(mesh, points)]
    if plane is not None:
        vertices = _with_images(mesh, vertices, plane)
    rest = mesh.vertices[vertices]
    partners = None if plane is None else _partners(rest, plane)
    joints = guess_joints(clip.skeleton, rest)
    if partners is not None:
        joints = symmetric_joints(clip.skeleton, joints, rest, partners)
    kept = one_a_hand(clip.skeleton, joints, partners or range(len(joints)))
    vertices, joints, rest = [vertices[k] for k in kept], tuple(joints[k] for k in kept), rest[kept]
    for vertex, joint, foot in zip(vertices, joints, _feet(clip, joints, rest, mesh), strict=True):
        taken = {point.name: point for point in project.puppets[puppet_id].points}
        project = add_point(project, puppet_id, vertex, unused(joint, taken), joint, foot)
    found = suggest_poses(performed(clip, joints).poses)
    for frame in sorted(found.frames[: poses or found.count]):
        project = add_key_pose(project, puppet_id, take, frame * clip.step, rest)
    if partners is not None:
        project = set_symmetry(project, puppet_id, plane)
    return play_take(project, puppet_id, take)


def _left_right(mesh: Mesh) -> Plane | None:
    """The plane of symmetry between left and right: a mesh looks to +Z."""
    plane = plane_of_symmetry(mesh)
    return plane if plane is not None and abs(plane.normal[0]) > _ACROSS else None


def _with_images(mesh: Mesh, vertices: list[int], plane: Plane) -> list[int]:
    """The vertices, and the mirror images of those without a partner that are not on the plane."""
    used = np.unique(mesh.faces)
    rest = mesh.vertices[vertices]
    images = reflected(rest, np.array(plane.point), np.array(plane.normal))
    away = np.linalg.norm(images[:, None] - rest[None], axis=2)
    nearest = away.argmin(1)
    near = _OFF * float(np.linalg.norm(np.ptp(rest, axis=0)))
    out = list(vertices)
    for own, other in enumerate(nearest):
        if nearest[other] == own and away[own, other] < near:
            continue
        image = int(used[np.linalg.norm(mesh.vertices[used] - images[own], axis=1).argmin()])
        if image not in out:
            out.append(image)
    return out


def _partners(rest: Float, plane: Plane) -> tuple[int, ...] | None:
    """For each control point its mirror image; None where one has none, or all are on the plane."""
    try:
        partners = partners_of(rest, np.array(plane.point), np.array(plane.normal), _OFF)
    except InputError:
        return None
    return partners if any(other != own for own, other in enumerate(partners)) else None


def symmetric_joints(
    skeleton: Skeleton, joints: Sequence[str], rest: Float, partners: Sequence[int]
) -> tuple[str, ...]:
    """Joints made symmetric: mirror images follow the joints of both sides, points on the plane middle ones.

    Args:
        joints: (P,) as they were guessed one by one.
        rest: (P, 3) metres, the control points.
        partners: (P,) the mirror image of each, as a number.
    """
    anatomy, out = anatomy_of(skeleton), list(joints)
    sides = {
        skeleton.names[a]: skeleton.names[b]
        for pair in anatomy.pairs
        for left, right in (pair, pair[::-1])
        for a, b in zip(_own(left)[::-1], _own(right)[::-1], strict=False)
    }
    limbs = {joint for pair in anatomy.pairs for limb in pair for joint in skeleton.below(_own(limb)[0])}
    middle = [joint for joint in range(len(skeleton)) if joint not in limbs]
    heights = _shares(skeleton.positions[:, 1])
    for own, other in enumerate(partners):
        if own < other:
            shown = out[own] if out[own] in sides or out[other] not in sides else sides[out[other]]
            out[own], out[other] = shown, sides.get(shown, shown)
        elif own == other and skeleton.index(out[own]) in limbs and middle:
            high = _shares(rest[:, 1])[own]
            out[own] = skeleton.names[min(middle, key=lambda joint: abs(float(heights[joint] - high)))]
    return tuple(out)


def one_a_hand(skeleton: Skeleton, joints: Sequence[str], partners: Sequence[int]) -> list[int]:
    """Numbers of the control points without those at a hand or foot where another joint is followed already.

    Points that share a joint, for want of others, stay.

    Args:
        joints: (P,) what each follows, the most important first.
        partners: (P,) the mirror image of each, which goes with it.
    """
    anatomy = anatomy_of(skeleton)
    limbs = [limb for pair in anatomy.pairs for limb in pair]
    parts = {joint: limb.chain[-1] for limb in limbs for joint in _hand(skeleton, limb)}
    taken, dropped = dict[int, str](), set[int]()
    for own, joint in enumerate(joints):
        part = parts.get(skeleton.index(joint))
        if part is not None and taken.get(part, joint) != joint:
            dropped |= {own, partners[own]}
        elif part is not None and own not in dropped:
            taken[part] = joint
    return [own for own in range(len(joints)) if own not in dropped]


def _hand(skeleton: Skeleton, limb: SkeletonLimb) -> set[int]:
    """The joints of the last part of a limb: a hand with its fingers, a foot with its toes."""
    proper = limb.proper
    left = np.cumsum(skeleton.lengths[list(proper[1:])][::-1])[::-1]
    first = next((j for j, rest in zip(proper[1:], left[1:], strict=False) if rest < _HAND * left[0]), None)
    return set(skeleton.below(first)) if first is not None else {limb.chain[-1]}


def _own(limb: SkeletonLimb) -> tuple[int, ...]:
    """The joints of a limb without the fork that it leaves."""
    return limb.chain[max(limb.start, 1) :]


def _shares(heights: Float) -> Float:
    """Heights as 0 to 1 from the lowest to the highest."""
    return np.asarray((heights - heights.min()) / max(float(np.ptp(heights)), 1e-12))


def _feet(clip: Clip, joints: tuple[str, ...], rest: Float, mesh: Mesh) -> list[bool]:
    """Which control points can stand: low on the mesh, and paired with a leg.

    One alone is none: what stands on one pot would hop whenever the performer lifts that foot.
    """
    low, high = mesh.vertices[:, 1].min(), mesh.vertices[:, 1].max()
    anatomy = anatomy_of(clip.skeleton)
    legs = {clip.skeleton.names[j] for pair in anatomy.legs for limb in pair for j in _own(limb)}
    feet = [
        joint in legs and bool(place[1] < low + _LOW * (high - low))
        for joint, place in zip(joints, rest, strict=True)
    ]
    return feet if sum(feet) > 1 else [False] * len(feet)
