"""A puppet to begin with: control points, joints, symmetry and key poses as a first guess."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.pairing import guess_joints
from enliven.examples.performer import performed
from enliven.examples.suggest import suggest_poses
from enliven.examples.symmetric import partners_of, reflected
from enliven.mapping.anatomy import anatomy_of
from enliven.mesh import Mesh
from enliven.modeling.extremities import extremities
from enliven.modeling.mirror_plane import plane_of_symmetry
from enliven.modeling.puppets import add_key_pose, add_point, make_puppet, play_take, set_symmetry
from enliven.motion.clip import Clip
from enliven.project import Project, unused
from enliven.puppet import Plane

_LOW = 0.08
"""Share of the mesh's height below which a control point can be a foot."""
_OFF = 0.1
"""Share of the control points' extent by which a mirror image may be off."""


def suggested_puppet(
    project: Project, mesh: Mesh, take: str, puppet_id: str, points: int = 6, poses: int | None = None
) -> Project:
    """A project with a puppet that lacks nothing but that its key poses are posed: they are all at rest.

    Control points are at the extremities, and their mirror images where the mesh is symmetric; joints are
    guessed by side and height; key poses are those of the take that are farthest from one another.

    Args:
        take: id of the take that shows the key poses, which the puppet plays.
        points: how many extremities; their mirror images come on top.
        poses: how many key poses; None for as many as are enough.

    Raises:
        InputError: for fewer than one point or two key poses, and for a take in which nobody moves.
    """
    if points < 1 or (poses is not None and poses < 2):
        what = f"{points} control points and {poses} key poses are too few"
        raise InputError(what, where=f"puppet {puppet_id!r}", mend="At least one point and two poses.")
    project = make_puppet(project, mesh, puppet_id)
    clip, plane = project.takes[take], plane_of_symmetry(mesh)
    vertices = [int(vertex) for vertex in extremities(mesh, points)]
    if plane is not None:
        vertices = _with_images(mesh, vertices, plane)
    rest = mesh.vertices[vertices]
    joints = guess_joints(clip.skeleton, rest)
    for vertex, joint, foot in zip(vertices, joints, _feet(clip, joints, rest, mesh), strict=True):
        taken = {point.name: point for point in project.puppets[puppet_id].points}
        project = add_point(project, puppet_id, vertex, unused(joint, taken), joint, foot)
    found = suggest_poses(performed(clip, joints).poses)
    for frame in sorted(found.frames[: poses or found.count]):
        project = add_key_pose(project, puppet_id, take, frame * clip.step, rest)
    if plane is not None and _has_images(rest, plane):
        project = set_symmetry(project, puppet_id, plane)
    return play_take(project, puppet_id, take)


def _with_images(mesh: Mesh, vertices: list[int], plane: Plane) -> list[int]:
    """The vertices, and the mirror images of those that have none, and are not on the plane."""
    used = np.unique(mesh.faces)
    rest = mesh.vertices[vertices]
    near = _OFF * float(np.linalg.norm(np.ptp(rest, axis=0)))
    out = list(vertices)
    for vertex, place in zip(
        vertices, reflected(rest, np.array(plane.point), np.array(plane.normal)), strict=True
    ):
        there = np.linalg.norm(mesh.vertices[out] - place, axis=1)
        if there.min() > near:
            image = int(used[np.linalg.norm(mesh.vertices[used] - place, axis=1).argmin()])
            if image != vertex:
                out.append(image)
    return out


def _has_images(rest: Float, plane: Plane) -> bool:
    """Whether every control point has a mirror image, one of them at least another than itself."""
    try:
        partners = partners_of(rest, np.array(plane.point), np.array(plane.normal), _OFF)
    except InputError:
        return False
    return any(other != own for own, other in enumerate(partners))


def _feet(clip: Clip, joints: tuple[str, ...], rest: Float, mesh: Mesh) -> list[bool]:
    """Which control points can stand: low on the mesh, and paired with a leg."""
    low, high = mesh.vertices[:, 1].min(), mesh.vertices[:, 1].max()
    anatomy = anatomy_of(clip.skeleton)
    legs = {clip.skeleton.names[j] for pair in anatomy.legs for limb in pair for j in limb.proper}
    return [
        joint in legs and bool(place[1] < low + _LOW * (high - low))
        for joint, place in zip(joints, rest, strict=True)
    ]
