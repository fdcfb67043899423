"""Creates puppets, and adds takes to them. Each edit maps a project to a new project.

    project = make_puppet(project, mesh, "cactus")
    project = add_point(project, "cactus", 4711, "left arm", joint="LeftHand")
    project = add_key_pose(project, "cactus", "traffic", 3.2, places)
    project = play_take(project, "cactus", "traffic", loop=True)

An invalid edit raises InputError and changes nothing. For changes of layers, moves, mirroring and copies, see
:mod:`enliven.modeling.edits`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.document import ExampleCharacter, Project, PuppetLayer
from enliven.errors import InputError
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_solve import check_layer
from enliven.meshes import Mesh
from enliven.modeling.rig import check_names


def make_puppet(project: Project, mesh: Mesh, puppet_id: str) -> Project:
    """Adds a mesh as a puppet without control points.

    Args:
        mesh: in metres, +Y up, with its lowest point at y = 0 (see :func:`enliven.meshes.mesh.fit_height`).

    Raises:
        InputError: if the name is taken, or the mesh cannot be a puppet.
    """
    location = f"puppet {puppet_id!r}"
    if not puppet_id or puppet_id in project.characters:
        problem = (
            "another character already has this name" if puppet_id else "the name of the puppet is empty"
        )
        raise InputError(problem, where=location, remedy="Choose another name.")
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        problem = (
            "the mesh has no faces"
            if len(mesh.faces) == 0
            else "some vertex positions of the mesh are not finite numbers"
        )
        raise InputError(problem, where=location, remedy="Export the mesh again.")
    return project.with_characters(ExampleCharacter(puppet_id, mesh))


def play_take(project: Project, puppet_id: str, take: str, **attributes: Any) -> Project:
    """Adds a layer that plays a take on top of the puppet's other layers.

    Args:
        attributes: attributes of the ``PuppetLayer``: points, offset, speed, loop, weight, travel, positions,
            ...

    Raises:
        InputError: if the take or a control point does not exist, or if constraints contradict each other.
            The message names them.
    """
    puppet = project.puppet(puppet_id)
    check_names(attributes, PuppetLayer, f"layer of {take!r}")
    layer = check_layer_number(project, puppet, PuppetLayer(take, **attributes))
    return project.with_characters(puppet.with_changes(layers=(*puppet.layers, layer)))


def check_layer_number(project: Project, puppet: ExampleCharacter, layer: PuppetLayer) -> PuppetLayer:
    """Returns a layer after checking it. For an unfinished puppet, checks that need the missing data are
    skipped."""
    location = f"puppet {puppet.id!r}"
    if layer.take not in project.takes:
        remedy = f"Known takes: {', '.join(project.takes)}." if project.takes else "Import a take first."
        raise InputError(f"the project has no take {layer.take!r}", where=location, remedy=remedy)
    for name in layer.points:
        puppet.index(name)
    if not find_missing_examples(project, puppet):
        check_layer(project, puppet, layer)
    return layer
