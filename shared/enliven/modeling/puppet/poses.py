"""Edits of a puppet's key poses. A key pose pairs a pose of the performer with positions of the control
points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import ExampleCharacter, KeyPose, Plane, Project
from enliven.errors import InputError
from enliven.examples.puppet_examples import (
    examples_from_key_poses,
    find_missing_examples,
    find_nearest_frame,
)
from enliven.examples.symmetric import find_partners, mirror_places
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry
from enliven.modeling.rig import check_names


def add_key_pose(project: Project, puppet_id: str, take: str, time: float, places: AnyArray) -> Project:
    """Adds a key pose at the end of the puppet's list: positions of the control points at a time of a take.

    Args:
        take: id of the take.
        time: seconds since the start of the take. The nearest frame is used.
        places: (P, 3) metres in the mesh's own frame, one row per control point.

    Raises:
        InputError: if the take does not exist, or the time is outside of it or already has a key pose. Also
            if a position is missing or not finite, or if another key pose has the same pose of the performer.
    """
    puppet = project.puppet(puppet_id)
    pose = _check_pose(project, puppet, KeyPose(take, float(time), np.asarray(places, np.float64)), None)
    return _check_to_differ(project, puppet.with_changes(poses=(*puppet.poses, pose)))


def change_key_pose(project: Project, puppet_id: str, number: int, **changes: Any) -> Project:
    """Changes the ``places`` of a key pose, or the ``time`` or ``take`` of the performer's pose.

    Raises:
        InputError: if no key pose has that number, or for any reason that :func:`add_key_pose` lists.
    """
    puppet = project.puppet(puppet_id)
    old = _find_key_pose(puppet, number)
    check_names(changes, KeyPose, f"key pose {number}")
    pose = _check_pose(project, puppet, replace(old, **changes), number)
    return _check_to_differ(project, _with_pose(puppet, number, pose))


def remove_key_pose(project: Project, puppet_id: str, number: int) -> Project:
    """Removes a key pose. Its take remains in the project.

    Raises:
        InputError: if no key pose has that number.
    """
    puppet = project.puppet(puppet_id)
    _find_key_pose(puppet, number)
    return project.with_characters(
        puppet.with_changes(poses=puppet.poses[:number] + puppet.poses[number + 1 :])
    )


def mirror_key_pose(project: Project, puppet_id: str, number: int) -> Project:
    """Mirrors the positions of a key pose in the symmetry plane, with left and right swapped.

    The plane is the puppet's own. If the puppet has no plane, the plane is the mesh's symmetry plane.

    Raises:
        InputError: if the pose does not exist, the mesh is not symmetric, or a control point has no mirror
            image.
    """
    puppet = project.puppet(puppet_id)
    pose = _find_key_pose(puppet, number)
    plane = puppet.symmetry or plane_of_symmetry(puppet.mesh)
    if plane is None:
        remedy = "Set a plane of symmetry for the puppet first."
        raise InputError(
            "no plane of symmetry was found for the puppet's mesh",
            where=f"puppet {puppet.id!r}",
            remedy=remedy,
        )
    names = [point.name for point in puppet.points]
    partners = find_partners(puppet.rest, np.array(plane.point), np.array(plane.normal), names=names)
    places = mirror_places(pose.places, puppet.rest, partners, np.array(plane.normal))
    return project.with_characters(_with_pose(puppet, number, replace(pose, places=places)))


def set_symmetry(project: Project, puppet_id: str, plane: Plane | None) -> Project:
    """Sets the symmetry plane: every key pose then also counts as mirrored in it. None removes the plane.

    :func:`enliven.examples.puppet_motion.missing` names control points without a mirror image.

    Raises:
        InputError: if the plane is invalid.
    """
    puppet = project.puppet(puppet_id)
    if plane is not None:
        length = float(np.linalg.norm(plane.normal))
        if not np.isfinite([*plane.point, length]).all() or length == 0.0:
            problem = f"the plane through {plane.point} with the normal {plane.normal} is not valid"
            raise InputError(
                problem,
                where=f"puppet {puppet.id!r}",
                remedy="Pass a finite point and a normal vector that is not 0.",
            )
    return project.with_characters(puppet.with_changes(symmetry=plane))


def _check_to_differ(project: Project, puppet: ExampleCharacter) -> Project:
    """Returns the project with the puppet. Raises an error if two of its examples are equal."""
    changed = project.with_characters(puppet)
    if not find_missing_examples(changed, puppet):
        examples_from_key_poses(changed, puppet)
    return changed


def _find_key_pose(puppet: ExampleCharacter, number: int) -> KeyPose:
    if not 0 <= number < len(puppet.poses):
        remedy = f"The key poses are numbered from 0. Number of key poses: {len(puppet.poses)}."
        raise InputError(f"the puppet has no key pose {number}", where=f"puppet {puppet.id!r}", remedy=remedy)
    return puppet.poses[number]


def _with_pose(puppet: ExampleCharacter, number: int, pose: KeyPose) -> ExampleCharacter:
    poses = (*puppet.poses[:number], pose, *puppet.poses[number + 1 :])
    return puppet.with_changes(poses=poses)


def _check_pose(project: Project, puppet: ExampleCharacter, pose: KeyPose, number: int | None) -> KeyPose:
    """Returns a key pose after checking that it can replace the pose ``number``, or be appended (None)."""
    location = f"puppet {puppet.id!r}"
    if pose.take not in project.takes:
        remedy = f"Known takes: {', '.join(project.takes)}." if project.takes else "Import a take first."
        raise InputError(f"the project has no take {pose.take!r}", where=location, remedy=remedy)
    frame = find_nearest_frame(project.takes[pose.take], pose.time)
    if pose.places.shape != (len(puppet.points), 3) or not np.isfinite(pose.places).all():
        problem = (
            f"the key pose has positions of shape {pose.places.shape} for {len(puppet.points)} "
            "control points, or a position is not finite"
        )
        raise InputError(
            problem, where=location, remedy="Pass one position (x, y, z) for each control point."
        )
    for other, existing in enumerate(puppet.poses):
        same = (
            existing.take == pose.take
            and find_nearest_frame(project.takes[existing.take], existing.time) == frame
        )
        if other != number and same:
            problem = f"frame {frame} of the take {pose.take!r} already has the key pose {other}"
            raise InputError(
                problem, where=location, remedy="Change the existing key pose, or choose another time."
            )
    return pose
