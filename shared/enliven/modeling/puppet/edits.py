"""Puppets made and given examples: pure edits, Project -> Project.

    project = make_puppet(project, mesh, "cactus")
    project = add_point(project, "cactus", 4711, "left arm", joint="LeftHand")
    project = add_key_pose(project, "cactus", "traffic", 3.2, places)
    project = play_take(project, "cactus", "traffic", loop=True)

An edit that is refused raises InputError and changes nothing. A layer is changed by
:mod:`enliven.modeling.puppet.layers`, a whole puppet is moved, mirrored and copied by
:mod:`enliven.modeling.edits`.
"""

from __future__ import annotations

import numpy as np

from enliven.document import Project, Puppet
from enliven.errors import InputError
from enliven.meshes import Mesh


def make_puppet(project: Project, mesh: Mesh, puppet_id: str) -> Project:
    """A project with a mesh as a puppet that has no control points yet.

    Args:
        mesh: metres, +Y up; it stands on y = 0 (:func:`enliven.meshes.mesh.fit_height` puts it there).

    Raises:
        InputError: for a name that something has already, and for a mesh that cannot be one.
    """
    where = f"puppet {puppet_id!r}"
    if not puppet_id or puppet_id in project.characters:
        what = "something has that name already" if puppet_id else "it needs a name"
        raise InputError(what, where=where, mend="Choose another name.")
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        what = (
            "its mesh has no faces" if len(mesh.faces) == 0 else "its mesh has vertices that are not finite"
        )
        raise InputError(what, where=where, mend="Export the mesh again.")
    return project.with_characters(Puppet(puppet_id, mesh))
