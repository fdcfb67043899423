"""Animates a mesh by a few example poses (example-based retargeting, 2014)."""

from __future__ import annotations

from collections.abc import Mapping

from enliven.arrays import AnyArray
from enliven.document import Clip, Project, unused
from enliven.errors import InputError
from enliven.examples.puppet_examples import find_missing_examples
from enliven.meshes import Mesh
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point
from enliven.modeling.puppet.poses import add_key_pose


def fit_examples(
    mesh: Mesh,
    take: Clip,
    points: Mapping[str, tuple[int, str]],
    poses: Mapping[float, AnyArray],
    *,
    plays: Clip | None = None,
    project: Project | None = None,
) -> tuple[Project, str]:
    """Adds a mesh that plays a take, retargeted by a few example poses.

    Args:
        mesh: any triangle mesh, in metres.
        take: the motion that contains the performer's poses of the examples.
        points: the control points by name: a vertex of the mesh, and the joint of the take that it follows.
        poses: two or more example poses. Maps seconds of the take to the positions (P, 3) of the control
            points, metres in the mesh's frame, in the order of ``points``.
        plays: the motion to play. None means ``take``.
        project: the project that the mesh is added to. If None, a new project is created.

    Returns:
        The project, and the id of the mesh in it.

    Raises:
        InputError: if a vertex, a joint or a time does not exist, or two examples are equal.
    """
    project = (project or Project()).with_takes(take, *([plays] if plays else []))
    name = unused(mesh.name or "mesh", project.characters)
    project = make_puppet(project, mesh, name)
    for point, (vertex, joint) in points.items():
        project = add_point(project, name, vertex, point, joint)
    for seconds, places in poses.items():
        project = add_key_pose(project, name, take.id, seconds, places)
    if sentences := find_missing_examples(project, project.puppets[name]):
        raise InputError(
            "the examples are incomplete, so they define no motion", where=name, remedy=" ".join(sentences)
        )
    return play_take(project, name, (plays or take).id), name
