"""Key poses of a puppet: a pose of the performer, and the control points' places on the mesh for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import KeyPose, Plane, Project, Puppet
from enliven.errors import InputError
from enliven.examples import examples_of, frame_at, mirrored_places, missing, partners_of
from enliven.modeling.mesh import plane_of_symmetry
from enliven.modeling.rig import check_names


def add_key_pose(project: Project, puppet_id: str, take: str, time: float, places: AnyArray) -> Project:
    """A project with an example more, the last: where the control points are at a time of a take.

    Args:
        take: its id.
        time: seconds since its begin; the nearest frame counts.
        places: (P, 3) metres in the mesh's own frame, a row a control point.

    Raises:
        InputError: for a take that is not there, a time outside of it or with a key pose already, for places
            that are not finite or not one a control point, and where the performer's pose is another's.
    """
    puppet = project.puppet(puppet_id)
    pose = _checked(project, puppet, KeyPose(take, float(time), np.asarray(places, np.float64)), None)
    return _checked_to_differ(project, puppet.with_changes(poses=(*puppet.poses, pose)))


def change_key_pose(project: Project, puppet_id: str, number: int, **changes: Any) -> Project:
    """A project with other ``places`` of a key pose, or another ``time`` or ``take`` of the performer's.

    Raises:
        InputError: where there is no key pose of that number, and as :func:`add_key_pose` does.
    """
    puppet = project.puppet(puppet_id)
    old = _pose(puppet, number)
    check_names(changes, KeyPose, f"key pose {number}")
    pose = _checked(project, puppet, replace(old, **changes), number)
    return _checked_to_differ(project, _with_pose(puppet, number, pose))


def remove_key_pose(project: Project, puppet_id: str, number: int) -> Project:
    """A project without an example; the take stays.

    Raises:
        InputError: where there is none of that number.
    """
    puppet = project.puppet(puppet_id)
    _pose(puppet, number)
    return project.with_characters(
        puppet.with_changes(poses=puppet.poses[:number] + puppet.poses[number + 1 :])
    )


def mirror_key_pose(project: Project, puppet_id: str, number: int) -> Project:
    """A project with a key pose's places mirrored in the plane of symmetry, left and right exchanged.

    The plane is the puppet's; where it has none, the mesh's.

    Raises:
        InputError: where there is no such pose, the mesh is not symmetric, or a control point has no mirror
            image.
    """
    puppet = project.puppet(puppet_id)
    pose = _pose(puppet, number)
    plane = puppet.symmetry or plane_of_symmetry(puppet.mesh)
    if plane is None:
        mend = "Set a plane of symmetry first."
        raise InputError("its mesh has no plane of symmetry", where=f"puppet {puppet.id!r}", mend=mend)
    names = [point.name for point in puppet.points]
    partners = partners_of(puppet.rest, np.array(plane.point), np.array(plane.normal), names=names)
    places = mirrored_places(pose.places, puppet.rest, partners, np.array(plane.normal))
    return project.with_characters(_with_pose(puppet, number, replace(pose, places=places)))


def set_symmetry(project: Project, puppet_id: str, plane: Plane | None) -> Project:
    """A project in which key poses of one side count for the other side too, or no longer.

    Control points that have no mirror image are named by :func:`enliven.examples.puppet_motion.missing`.

    Raises:
        InputError: for a plane that is none.
    """
    puppet = project.puppet(puppet_id)
    if plane is not None:
        length = float(np.linalg.norm(plane.normal))
        if not np.isfinite([*plane.point, length]).all() or length == 0.0:
            what = f"a plane at {plane.point} across {plane.normal} is none"
            raise InputError(what, where=f"puppet {puppet.id!r}", mend="Give a point and a direction.")
    return project.with_characters(puppet.with_changes(symmetry=plane))


def _checked_to_differ(project: Project, puppet: Puppet) -> Project:
    """The project with the puppet; its examples must differ as soon as they can be compared."""
    made = project.with_characters(puppet)
    if not missing(made, puppet):
        examples_of(made, puppet)
    return made


def _pose(puppet: Puppet, number: int) -> KeyPose:
    if not 0 <= number < len(puppet.poses):
        mend = f"It has {len(puppet.poses)}."
        raise InputError(f"there is no key pose {number}", where=f"puppet {puppet.id!r}", mend=mend)
    return puppet.poses[number]


def _with_pose(puppet: Puppet, number: int, pose: KeyPose) -> Puppet:
    poses = (*puppet.poses[:number], pose, *puppet.poses[number + 1 :])
    return puppet.with_changes(poses=poses)


def _checked(project: Project, puppet: Puppet, pose: KeyPose, number: int | None) -> KeyPose:
    """A key pose that can be in the place of ``number``, or be the last."""
    where = f"puppet {puppet.id!r}"
    if pose.take not in project.takes:
        mend = f"Known: {', '.join(project.takes)}." if project.takes else "Import one first."
        raise InputError(f"there is no take {pose.take!r}", where=where, mend=mend)
    frame = frame_at(project.takes[pose.take], pose.time)
    if pose.places.shape != (len(puppet.points), 3) or not np.isfinite(pose.places).all():
        what = (
            f"places {pose.places.shape} of {len(puppet.points)} control points, all of which must be finite"
        )
        raise InputError(what, where=where, mend="Give one place a control point.")
    for other, known in enumerate(puppet.poses):
        same = known.take == pose.take and frame_at(project.takes[known.take], known.time) == frame
        if other != number and same:
            what = f"key pose {other} is of frame {frame} of {pose.take!r} already"
            raise InputError(what, where=where, mend="Change that one, or choose another time.")
    return pose
